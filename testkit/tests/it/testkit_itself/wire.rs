//! The soak's link, and its detection of corruption.

use core::time::Duration;

use testkit::link::{Delivery, End, Faults};
use testkit::soak::{Check, Log, Mark, Tally, Unseen, Wire};

const MS: Duration = Duration::from_millis(1);

/// Checks a pair: two equal bytes are a valid message.
fn pair(_: End, bytes: &[u8]) -> Check {
    match bytes {
        [a, b, ..] if a == b => Check::Good(2),
        [_, _, ..] => Check::Refused,
        _ => Check::Nothing,
    }
}

fn run(faults: Faults, messages: usize) -> (Tally, Vec<Unseen>, usize) {
    let mut wire = Wire::new(5, faults, ["a", "b"], false, Log::OFF);
    let mut changed = 0;
    for n in 0..messages {
        let message = [n as u8, n as u8];
        wire.send(End::A, MS * n as u32, &message);
        let mut received = Vec::new();
        while let Some(Delivery::Bytes(bytes)) = wire.receive(End::B, Duration::MAX) {
            received.extend(bytes);
        }
        changed += usize::from(!received.is_empty() && received != message);
    }
    let mut tally = Tally::default();
    let unseen = wire.settle(Duration::ZERO, &mut tally, 2, pair);
    (tally, unseen, changed)
}

#[test]
fn corruption_that_the_check_cannot_see_is_found_and_no_other() {
    let (tally, unseen, changed) = run(Faults { flip: 0.3, ..Faults::NONE }, 2000);
    assert_eq!(tally.corrupt as usize, changed);
    // Both bytes are hit in the same place: 9 % of messages, 1 in 8 of them. The last byte of one message and the first
    // of the next are next to one another too, which only corruption can make equal.
    assert!(unseen.len() > 15 && tally.unseen == unseen.len() as u64, "{}", unseen.len());
    assert!(unseen.iter().all(|unseen| unseen.bytes[0] == unseen.bytes[1]));
    // Of one transmission alone, and which.
    let is_of = |unseen: &Unseen, at| unseen.is_between(Mark(at, 0), Mark(at + 1, 0));
    let sources = |unseen| (0..2000).filter(|at| is_of(unseen, *at)).collect::<Vec<_>>();
    let single = |unseen| match sources(unseen)[..] {
        [at] => Some((unseen, at)),
        _ => None,
    };
    let (both, at) = unseen.iter().find_map(single).unwrap();
    assert!(both.is_between(Mark(0, 0), Mark::END));
    assert!(!both.is_between(Mark(at + 1, 0), Mark::END) && !both.is_between(Mark(0, 9), Mark(at, 9)));
}

#[test]
fn a_clean_line_and_whole_losses_make_no_message() {
    for faults in [Faults::NONE, Faults { lose: 0.3, flip: 1e-12, ..Faults::NONE }] {
        let (tally, unseen, _) = run(faults, 300);
        assert_eq!((tally.corrupt, unseen), (0, vec![]));
    }
}
