//! The tests of the contract themselves: a link that keeps the contract passes, and each broken rule is found.

use core::cell::{Cell, RefCell};
use core::panic::AssertUnwindSafe;
use core::time::Duration;
use std::panic::catch_unwind;

use crate::common::{Asker, Event, Line, Lines, TooLong};
use arbitrary::{Arbitrary as _, Unstructured};
use robot_session::contract::{self, Rng, Script, Subject};
use robot_session::end::EventQueue;
use robot_session::{Decoder, Session};

/// The fault of a broken decoder.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Fault {
    None,
    /// A byte that is pushed alone is lost.
    LosesSingleBytes,
    /// The position does not move with errors.
    StandsStill,
    /// The end is not noticed.
    NeverFinishes,
    /// Held bytes stay.
    ClearsNothing,
    /// The line after an error is an error too.
    TakesTwo,
    /// The line after one with a mark is an error. Marks are digits with a bit less.
    MindsMarks,
    /// The lines of a piece with several bytes are shown with the next piece.
    IsLate,
    /// Only the first of several lines is shown, and the next one with the next piece.
    ShowsOne,
    /// A push of no bytes undoes the end.
    ForgetsItsEnd,
}

struct Broken {
    lines: Lines,
    fault: Fault,
    errors: u64,
    failed: bool,
    /// Whether waiting lines are not shown.
    hides: bool,
    finished: bool,
}

impl Decoder for Broken {
    type Frame<'a> = Line;
    type Error = TooLong;

    fn push(&mut self, bytes: &[u8]) -> usize {
        self.hides = match self.fault {
            Fault::IsLate => bytes.len() > 1,
            Fault::ForgetsItsEnd => bytes.is_empty(),
            _ => false,
        };
        if self.fault == Fault::LosesSingleBytes && bytes.len() == 1 { 1 } else { self.lines.push(bytes) }
    }

    fn next_frame(&mut self) -> Option<Result<Line, TooLong>> {
        if self.hides {
            return None;
        }
        let before = self.lines.position();
        let mut frame = self.lines.next_frame()?;
        if core::mem::take(&mut self.failed) {
            frame = Err(TooLong);
        }
        self.failed = match (&frame, self.fault) {
            (Err(_), Fault::TakesTwo) => true,
            (Ok(Line(text)), Fault::MindsMarks) => text.contains(|mark| ('#'..=')').contains(&mark)),
            _ => false,
        };
        if frame.is_err() {
            self.errors += self.lines.position() - before;
        }
        self.hides = self.fault == Fault::ShowsOne && !self.finished;
        Some(frame)
    }

    fn finish(&mut self) {
        if self.fault != Fault::NeverFinishes {
            self.lines.finish();
        }
        (self.hides, self.finished) = (false, true);
    }

    fn position(&self) -> u64 {
        self.lines.position() - if self.fault == Fault::StandsStill { self.errors } else { 0 }
    }

    fn clear(&mut self) {
        if self.fault != Fault::ClearsNothing {
            self.lines.clear();
        }
    }
}

fn check(fault: Fault, lines: &[&str], spread: usize) -> bool {
    let frames: Vec<_> = lines.iter().map(|line| line.as_bytes().to_vec()).collect();
    let lines = Lines::default;
    let new =
        move || Broken { lines: lines(), fault, errors: 0, failed: false, hides: false, finished: false };
    catch_unwind(move || contract::decoder("toy", new, &frames, spread)).is_ok()
}

#[test]
fn each_broken_rule_of_a_decoder_is_found() {
    // A corrupt line end makes one line of two.
    let mixed = ["one\n", "12\n", "3456789\n", "\n"];
    assert!(check(Fault::None, &mixed, 1));
    let faults = [
        Fault::LosesSingleBytes,
        Fault::StandsStill,
        Fault::NeverFinishes,
        Fault::ClearsNothing,
        Fault::IsLate,
        Fault::ShowsOne,
        Fault::ForgetsItsEnd,
    ];
    for fault in faults {
        assert!(!check(fault, &mixed, 1), "{fault:?}");
    }
    // Lines of the greatest length have nothing to do with one another.
    assert!(!check(Fault::None, &mixed, 0));
    assert!(check(Fault::None, &["3456789\n"], 0));
    assert!(!check(Fault::TakesTwo, &["3456789\n"], 0));
    assert!(!check(Fault::MindsMarks, &["3456789\n"], 0));
}

/// A session around the toy's that breaks one rule.
struct Sloppy<const FAULT: u8> {
    asker: Asker,
    connected: bool,
    sent: u32,
    is_deaf: Cell<bool>,
}

/// Input between a call of `poll_timeout` and the next `poll_event` is lost: only a driver polls no event before the input.
const IS_DEAF_WHEN_IT_WAITS: u8 = 1;
/// The fifth request and those after it are lost if the buffer is too small.
const TAKES_A_SMALL_BUFFER: u8 = 2;

impl<const FAULT: u8> Session for Sloppy<FAULT> {
    type Event = Event;
    type Statistics = u32;
    const MAX_INPUT: usize = Asker::MAX_INPUT;
    const MAX_TRANSMIT: usize = Asker::MAX_TRANSMIT;

    fn handle_connected(&mut self, now: Duration) {
        self.connected = true;
        self.asker.handle_connected(now);
    }

    fn handle_disconnected(&mut self, now: Duration) {
        self.connected = false;
        self.asker.handle_disconnected(now);
    }

    fn handle_input(&mut self, now: Duration, bytes: &[u8]) {
        if FAULT != IS_DEAF_WHEN_IT_WAITS || !self.is_deaf.get() {
            self.asker.handle_input(now, bytes);
        }
    }

    fn handle_timeout(&mut self, now: Duration) {
        self.asker.handle_timeout(now);
    }

    fn poll_event(&mut self) -> Option<Event> {
        self.is_deaf.set(false);
        self.asker.poll_event()
    }

    fn poll_transmit(&mut self, now: Duration, out: &mut [u8]) -> Option<usize> {
        if FAULT == TAKES_A_SMALL_BUFFER && out.is_empty() && self.sent >= 4 {
            self.asker.requests.pop_front();
        }
        let length = if self.connected { self.asker.poll_transmit(now, out)? } else { return None };
        self.sent += 1;
        Some(length)
    }

    fn poll_timeout(&self) -> Option<Duration> {
        self.is_deaf.set(true);
        self.asker.poll_timeout()
    }

    fn statistics(&self) -> u32 {
        self.sent
    }
}

struct OfTheToy<const FAULT: u8>;

impl<const FAULT: u8> Subject for OfTheToy<FAULT> {
    type Session = Sloppy<FAULT>;
    type Input = u8;
    type Call = u8;

    fn session(&self, _: usize, is_endless: bool) -> Sloppy<FAULT> {
        let mut asker = Asker::new(&[]);
        asker.timeout = if is_endless { Duration::MAX } else { asker.timeout };
        Sloppy { asker, connected: false, sent: 0, is_deaf: Cell::new(false) }
    }

    fn input(&self, _: &Sloppy<FAULT>, _: usize, number: &u8) -> Vec<u8> {
        format!("{}\n", number % 100).into()
    }

    fn call(&self, session: &mut Sloppy<FAULT>, _: usize, _: Duration, number: &u8) -> Option<String> {
        let request = (number % 100).to_string();
        session.asker.requests.push_back(request.clone());
        Some(request)
    }
}

/// Returns the message of the rule that a session breaks, if it breaks one.
fn fault(subject: &impl Subject) -> Option<String> {
    let panic = catch_unwind(AssertUnwindSafe(|| contract::session(subject, 60))).err()?;
    Some(*panic.downcast().expect("a text"))
}

#[test]
fn each_broken_rule_of_a_session_is_found() {
    assert_eq!(fault(&OfTheToy::<0>), None);
    assert!(fault(&OfTheToy::<IS_DEAF_WHEN_IT_WAITS>).is_some());
    assert!(fault(&OfTheToy::<TAKES_A_SMALL_BUFFER>).is_some());
}

/// Returns whether scripts that are read from a fuzzer's bytes find a fault.
fn is_found_by_scripts<const FAULT: u8>() -> bool {
    (0..60).any(|seed| {
        let bytes = Rng::new(seed).bytes(800);
        let script = Script::arbitrary(&mut Unstructured::new(&bytes)).unwrap();
        catch_unwind(|| contract::scripted(&OfTheToy::<FAULT>, &script)).is_err()
    })
}

#[test]
fn bytes_are_never_discarded_unless_the_session_says_so() {
    assert_eq!(OfTheToy::<0>.session(0, false).discards_after(), None);
}

#[test]
fn each_broken_rule_of_a_session_is_found_by_scripts() {
    assert!(!is_found_by_scripts::<0>());
    assert!(is_found_by_scripts::<IS_DEAF_WHEN_IT_WAITS>());
    assert!(is_found_by_scripts::<TAKES_A_SMALL_BUFFER>());
}

#[test]
fn what_led_to_a_difference_is_shown_and_not_all_before_that() {
    let text = fault(&OfTheToy::<TAKES_A_SMALL_BUFFER>).unwrap();
    let from = text.lines().next().and_then(|line| line.split_once("SmallBuffer, from "));
    let from: usize = from.expect("where it begins").1.parse().unwrap();
    // Four requests were made and sent before.
    assert!(from >= 2 * 4 + 1 - 6, "{text}");
}

/// Reports the number of bytes in each read, drops an event that is unread at the next read, and records how it was called.
struct Reads<'a> {
    events: EventQueue<usize, 1>,
    timeouts: u32,
    called: How,
    log: &'a RefCell<Vec<How>>,
}

#[derive(Debug, Clone, Copy, Default)]
struct How {
    is_small: bool,
    is_often: bool,
}

impl Drop for Reads<'_> {
    fn drop(&mut self) {
        self.log.borrow_mut().push(self.called);
    }
}

impl Session for Reads<'_> {
    type Event = usize;
    type Statistics = u64;
    const MAX_INPUT: usize = 64;
    const MAX_TRANSMIT: usize = 1;

    fn handle_connected(&mut self, _: Duration) {}

    fn handle_disconnected(&mut self, _: Duration) {}

    fn handle_input(&mut self, _: Duration, bytes: &[u8]) {
        self.events.push_notice(bytes.len());
    }

    fn handle_timeout(&mut self, _: Duration) {
        self.timeouts += 1;
        self.called.is_often |= self.timeouts > 1;
    }

    fn poll_event(&mut self) -> Option<usize> {
        self.timeouts = 0;
        self.events.pop()
    }

    fn poll_transmit(&mut self, _: Duration, out: &mut [u8]) -> Option<usize> {
        self.called.is_small |= out.is_empty();
        None
    }

    fn poll_timeout(&self) -> Option<Duration> {
        None
    }

    fn statistics(&self) -> u64 {
        self.events.dropped_notices()
    }
}

/// The subject of `Reads`; `tells`: whether it reports the number of dropped notices.
struct OfReads<'a> {
    tells: bool,
    log: &'a RefCell<Vec<How>>,
}

impl<'a> Subject for OfReads<'a> {
    type Session = Reads<'a>;
    type Input = u8;
    type Call = ();

    fn session(&self, _: usize, _: bool) -> Reads<'a> {
        Reads { events: EventQueue::new(), timeouts: 0, called: How::default(), log: self.log }
    }

    fn input(&self, _: &Reads<'_>, _: usize, length: &u8) -> Vec<u8> {
        vec![7; 1 + usize::from(length % 8)]
    }

    fn dropped_notices(&self, dropped: &u64) -> u64 {
        if self.tells { *dropped } else { 0 }
    }
}

#[test]
fn where_notices_are_dropped_the_events_of_pieces_are_not_compared() {
    let log = RefCell::default();
    assert_eq!(fault(&OfReads { tells: true, log: &log }), None, "in pieces alone some are dropped");
    assert!(fault(&OfReads { tells: false, log: &log }).is_some());
}

#[test]
fn one_caller_of_six_asks_more_often_than_it_must_and_one_with_a_small_buffer() {
    let log = RefCell::default();
    contract::session(&OfReads { tells: true, log: &log }, 2);
    let log = log.into_inner();
    // In the first string of calls bytes also arrive without a connection, so no caller divides them.
    assert_eq!(log.len(), 2 * (5 + 6));
    assert!(log.iter().all(|how| !(how.is_small && how.is_often)));
    let count = |is: fn(&How) -> bool| log.iter().filter(|how| is(how)).count();
    assert_eq!((count(|how| how.is_often), count(|how| how.is_small)), (4, 4));
}

#[test]
fn a_session_has_its_type_as_its_name_and_no_calls_and_drops_nothing_unless_its_subject_says_so() {
    let toy = OfTheToy::<0>;
    assert!(toy.name().ends_with("Sloppy<0>"), "{}", toy.name());
    assert_eq!(toy.dropped_notices(&toy.session(0, false).statistics()), 0);
    let log = RefCell::default();
    let reads = OfReads { tells: true, log: &log };
    assert_eq!(reads.call(&mut reads.session(0, false), 0, Duration::ZERO, &()), None);
}
