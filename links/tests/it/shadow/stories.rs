//! Every story, as it is.

use core::fmt::Write as _;
use std::collections::{BTreeMap, BTreeSet};

use cellwire_links::shadow::Kind;
use cellwire_links::{LINKS, Link};

use super::counts::{STORIES, compare, keep};
use super::recorded::stories;

/// Facts that a tap cannot observe. Each causes a complaint; otherwise its line is to be removed.
const UNSEEN: [(&str, u64, &str); 5] = [
    ("kawasaki-msg", 146, "the PC sends more jobs than the numbers tell apart: none of them counts as sent"),
    ("laser-eb90", 164, "the controller drops a byte that has passed the tap"),
    ("val2-alter", 273, "the controller has no room to take a good reply"),
    ("fanuc-hmi-modbus", 157, "the reply of another unit stands among the requests, and is read as one"),
    ("fanuc-hmi-modbus", 174, "a frame that is too long ends where the server ends it"),
];

/// Returns whether the complaints about our end in this story are wrong for that reason.
pub(super) fn is_unseen(link: &str, story: u64) -> bool {
    UNSEEN.iter().any(|(name, id, _)| (*name, *id) == (link, story))
}

/// Our sessions follow the rules, whatever the other end does: no story causes a complaint about our end.
#[test]
fn our_ends_are_never_complained_about() {
    let (mut wrong, mut unseen) = (String::new(), BTreeSet::new());
    for link in LINKS {
        for story in stories(link) {
            for said in story.say(link, &story.told) {
                let it = &said.complaint;
                let is_broken = match it.kind {
                    Kind::Rule => true,
                    // A story may end before its end has answered.
                    Kind::Budget => !story.is_late && said.place < story.told.len(),
                    Kind::Assumption => false,
                };
                if it.end != story.end || !is_broken {
                    continue;
                }
                if is_unseen(link.name, story.id) {
                    unseen.insert((link.name, story.id));
                } else {
                    let _ = writeln!(wrong, "{} {}: {} ({it:?})", link.name, story.id, story.comment);
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong}");
    assert_eq!(unseen, UNSEEN.map(|(name, id, _)| (name, id)).into());
}

/// The complaints about the other ends are counted.
#[test]
fn complaints_about_peers_are_counted() {
    let mut rows = String::new();
    for link in LINKS {
        let (mut list, mut counts) = (String::new(), BTreeMap::<_, BTreeMap<_, u32>>::new());
        for story in stories(link) {
            let mut last = String::new();
            for said in story.say(link, &story.told) {
                let it = &said.complaint;
                if it.end == story.end {
                    continue;
                }
                let line = format!("{} {:?} {} {}", story.id, it.kind, it.clause, it.text);
                if line != last {
                    let _ = writeln!(list, "{line}");
                    *counts.entry(format!("{:?}", it.kind)).or_default().entry(it.clause).or_default() += 1;
                }
                last = line;
            }
        }
        for (kind, clauses) in &counts {
            let clauses: Vec<String> =
                clauses.iter().map(|(clause, count)| format!("{clause} {count}")).collect();
            let _ = writeln!(rows, "{} {kind}: {}", link.name, clauses.join(", "));
        }
        let checksum = keep(&format!("{}.txt", link.name), &list);
        // A link that was just made has no complaints.
        if !list.is_empty() {
            let _ = writeln!(rows, "{} {checksum}", link.name);
        }
    }
    compare(&rows, STORIES);
}

/// Where the conversations of the stories are on the way, and long after the end; each number is `n`.
#[test]
fn a_state_is_told_in_a_few_words() {
    let list = |states: BTreeSet<String>| states.into_iter().collect::<Vec<_>>().join(" | ");
    let plain = |state: &str| {
        let words = state.split(' ').map(|word| if word.parse::<u64>().is_ok() { "n" } else { word });
        words.collect::<Vec<_>>().join(" ")
    };
    let table = [
        (
            "val2-alter",
            "ALTER is off | ALTER runs | ALTER runs in mode n | ALTER starts | the state is not known yet",
            "ALTER is off | ALTER runs | ALTER runs in mode n | ALTER starts | the state is not known yet",
        ),
        (
            "val2-viewer",
            "a request has no packet | a request has no packet; the workstation is held | a request waits for its packet | \
             a request waits for its packet; the host is held | a request waits for its packet; the workstation is held | \
             no request is open | no request is open; the host is held | no request is open; the workstation is held | \
             the state is not known yet",
            "a request has no packet | no request is open | the state is not known yet",
        ),
        (
            "isra-ball",
            "a poll has no packet | a poll waits for its packet | no poll is open | the state is not known yet",
            "a poll has no packet | no poll is open | the state is not known yet",
        ),
        (
            "fanuc-hmi-modbus",
            "a request waits for its reply | n requests wait for their replies | no request is open | the state is not known yet",
            "no request is open | the state is not known yet",
        ),
        (
            "laser-eb90",
            "a frame waits for its answer | no frame was seen | the last frame has no answer | the last frame is answered | \
             the last frame is wanted again",
            "no frame was seen | the last frame has no answer | the last frame is answered | the last frame is wanted again",
        ),
    ];
    for (name, on_the_way, at_last) in table {
        let link = Link::by_name(name).unwrap();
        let (mut all, mut last) = (BTreeSet::new(), BTreeSet::new());
        for story in stories(link) {
            let mut state = String::new();
            story.watch(link, &story.told, &mut |now| {
                state = plain(&now);
                all.insert(state.clone());
            });
            last.insert(state);
        }
        assert_eq!([list(all), list(last)], [on_the_way, at_last], "{name}");
    }
}
