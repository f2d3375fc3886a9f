//! Every story, as it is.

use core::fmt::Write as _;
use std::collections::BTreeSet;

use cellwire_links::LINKS;
use cellwire_links::shadow::Kind;

use super::told::stories;

/// What a tap cannot know. Each of these is complained about, or its line goes.
const UNSEEN: [(&str, u64, &str); 7] = [
    ("kawasaki-msg", 206, "the PC sends more jobs than the numbers tell apart: none of them counts as sent"),
    ("laser-eb90", 224, "the controller drops a byte that has passed the tap"),
    ("mmacell-proto", 158, "what is written has another dialect than what is accepted: a tap has one"),
    ("val2-alter", 373, "the controller has no room to take a good reply"),
    ("fanuc-hmi-modbus", 186, "the reply of another unit stands among the requests, and is read as one"),
    ("fanuc-hmi-modbus", 187, "the reply of another unit stands among the requests, and is read as one"),
    ("fanuc-hmi-modbus", 210, "a frame that is too long ends where the server ends it"),
];

/// Whether what is said of our end in this story is wrong for that reason.
pub(super) fn is_unseen(link: &str, story: u64) -> bool {
    UNSEEN.iter().any(|(name, id, _)| (*name, *id) == (link, story))
}

/// Our sessions keep the rules, whatever the other end does: no story is complained about for the end that is ours.
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

/// The others are listed, with what is said of them.
#[test]
fn stories_of_peers_that_break_rules_are_listed() {
    for link in LINKS {
        let mut list = String::new();
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
                }
                last = line;
            }
        }
        let path = format!("{}/tests/it/shadow/{}.txt", env!("CARGO_MANIFEST_DIR"), link.name);
        if std::env::var_os("BLESS").is_some() {
            std::fs::write(&path, &list).unwrap();
        }
        assert_eq!(std::fs::read_to_string(&path).unwrap_or_default(), list, "{path}: set BLESS to write it");
    }
}
