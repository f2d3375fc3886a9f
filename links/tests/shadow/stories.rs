//! Every story, as it is.

use core::fmt::Write as _;

use cellwire_links::LINKS;
use cellwire_links::shadow::Kind;

use super::told::stories;

/// Our sessions keep the rules, whatever the other end does: no story is complained about for the end that is ours.
#[test]
fn our_ends_are_never_complained_about() {
    let mut wrong = String::new();
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
                if it.end == story.end && is_broken {
                    let _ = writeln!(wrong, "{} {}: {} ({it:?})", link.name, story.id, story.comment);
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong}");
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
        let path = format!("{}/tests/shadow/{}.txt", env!("CARGO_MANIFEST_DIR"), link.name);
        if std::env::var_os("BLESS").is_some() {
            std::fs::write(&path, &list).unwrap();
        }
        assert_eq!(std::fs::read_to_string(&path).unwrap_or_default(), list, "{path}: set BLESS to write it");
    }
}
