//! Every story from each place on: a shadow that begins in the middle does not report anything that one from the start does not
//! report.

use core::fmt::Write as _;

use cellwire_links::LINKS;
use cellwire_links::shadow::Kind;

use super::recorded::{RecordedBody, stories};
use super::stories::is_unseen;

#[test]
fn from_the_middle_nothing_is_said_that_cannot_be_known() {
    let mut wrong = String::new();
    let mut begun = 0;
    for link in LINKS {
        for story in stories(link) {
            let whole = story.say(link, &story.told);
            for from in 1..story.told.len() {
                // Start neither at the beginning of a connection nor within a message.
                if story.told[from].what == RecordedBody::Opened {
                    continue;
                }
                begun += 1;
                for said in story.say(link, &story.told[from..]) {
                    let (place, it) = (said.place + from, &said.complaint);
                    let is_known = |other: &&super::recorded::LocatedComplaint| {
                        (other.place, other.complaint.end, other.complaint.clause)
                            == (place, it.end, it.clause)
                    };
                    if it.kind == Kind::Rule
                        && !is_unseen(link.name, story.id)
                        && whole.iter().find(is_known).is_none()
                    {
                        let _ = writeln!(wrong, "{} {} from {from} at {place}: {it:?}", link.name, story.id);
                    }
                }
            }
        }
    }
    assert!(begun > 5000, "{begun}");
    assert!(wrong.is_empty(), "{wrong}");
}
