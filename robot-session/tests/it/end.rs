//! The loop that all ends share.

use core::time::Duration;

use crate::common::echo::{Echo, EchoEvent, EchoMachine, EchoStatistics, Input};
use robot_session::end::End as _;
#[cfg(feature = "model")]
use robot_session::end::Rules;
use robot_session::{Session, Step, Steps, Unexpected};

/// Returns the bytes that the end sends and the events that it reports until it is idle.
fn settled(echo: &mut Echo, now: Duration) -> (Vec<u8>, Vec<EchoEvent>) {
    let (mut sent, mut events) = (Vec::new(), Vec::new());
    let mut steps = Steps::NEW;
    loop {
        match steps.next(echo, now, &mut [0]) {
            Step::Event(event) => events.push(event),
            Step::Write(bytes) => sent.extend(bytes),
            Step::Wait { .. } => return (sent, events),
        }
    }
}

#[test]
fn what_is_not_read_waits_and_is_answered_in_order() {
    let mut echo = Echo::new(Duration::ZERO);
    echo.handle_connected(Duration::ZERO);
    assert!(echo.wants_input());
    let all: Vec<u8> = (0..32).collect();
    echo.handle_input(Duration::ZERO, &all);
    assert!(!echo.wants_input(), "an answer is due");
    let (sent, events) = settled(&mut echo, Duration::ZERO);
    assert_eq!(sent, all);
    assert_eq!(events, all.iter().map(|byte| EchoEvent::Answered(*byte)).collect::<Vec<_>>());
    assert!(echo.wants_input());
}

#[test]
fn a_caller_who_gives_more_than_fits_is_told() {
    let mut echo = Echo::new(Duration::ZERO);
    echo.handle_connected(Duration::ZERO);
    echo.handle_input(Duration::ZERO, &[7; 40]);
    let (sent, events) = settled(&mut echo, Duration::ZERO);
    assert_eq!(sent, [7; 33], "one was read, and 32 waited");
    assert_eq!(events[0], EchoEvent::Overrun);
    assert_eq!(events.len(), 34);
}

#[test]
fn a_call_that_the_state_refuses_changes_and_reports_nothing() {
    let mut echo = Echo::new(Duration::from_secs(3));
    assert_eq!(*echo.config(), Duration::from_secs(3));
    let refused = echo.ask(Duration::ZERO, Input::Byte(7));
    assert_eq!(refused, Err(Unexpected { state: "Disconnected", input: "Byte" }));
    assert_eq!((*echo.machine(), echo.statistics().unexpected), (EchoMachine::Disconnected, 0));
    assert_eq!(echo.poll_event(), None);
    assert_eq!(echo.ask(Duration::ZERO, Input::Overrun), Ok(()));
    assert_eq!(echo.poll_event(), Some(EchoEvent::Overrun));
}

#[test]
fn nothing_is_read_or_sent_without_room_for_its_outcome() {
    let mut echo = Echo::new(Duration::ZERO);
    echo.handle_connected(Duration::ZERO);
    echo.handle_input(Duration::ZERO, b"abcd");
    let mut out = [0];
    let mut sent = Vec::new();
    while echo.poll_transmit(Duration::ZERO, &mut out).is_some() {
        sent.extend(out);
    }
    assert_eq!(sent, b"abc", "the fourth is read when there is room for two outcomes");
    assert!(!echo.wants_input());
    echo.handle_connected(Duration::ZERO);
    assert!(echo.poll_event().is_some() && echo.poll_event().is_some());
    echo.handle_input(Duration::ZERO, b"e");
    assert_eq!(echo.poll_transmit(Duration::ZERO, &mut out), None);
    assert_eq!(echo.poll_event(), Some(EchoEvent::Answered(b'c')));
    let without = Unexpected { state: "Disconnected", input: "Byte" };
    assert_eq!(
        echo.poll_event(),
        Some(EchoEvent::Unexpected(without)),
        "the connection had no room for its outcomes"
    );
    assert_eq!(echo.statistics(), EchoStatistics { unexpected: 1, dropped_notices: 0 });
}

#[test]
fn more_is_wanted_when_what_waits_is_read() {
    let mut echo = Echo::new(Duration::ZERO);
    echo.handle_connected(Duration::ZERO);
    echo.handle_input(Duration::ZERO, b"abcd");
    while echo.poll_transmit(Duration::ZERO, &mut [0]).is_some() {}
    while echo.poll_event().is_some() {}
    assert!(!echo.wants_input(), "there is room, and the fourth waits");
    assert_eq!(settled(&mut echo, Duration::ZERO), (b"d".to_vec(), vec![EchoEvent::Answered(b'd')]));
    assert!(echo.wants_input());
}

#[test]
fn bytes_are_never_discarded_unless_the_end_says_so() {
    assert_eq!(Session::discards_after(&Echo::new(Duration::ZERO)), None);
}

#[test]
fn a_buffer_that_is_too_short_changes_nothing() {
    let mut echo = Echo::new(Duration::from_secs(1));
    echo.handle_connected(Duration::ZERO);
    echo.handle_input(Duration::ZERO, b"x");
    assert_eq!(echo.poll_timeout(), Some(Duration::from_secs(1)));
    assert_eq!(echo.poll_transmit(Duration::ZERO, &mut [0]), None, "not due yet");
    let now = Duration::from_secs(2);
    assert_eq!(echo.poll_transmit(now, &mut []), None);
    assert_eq!(settled(&mut echo, now), (b"x".to_vec(), vec![EchoEvent::Answered(b'x')]));
}

#[cfg(feature = "model")]
robot_session::rules! {
    pub enum Kept {
        Order,
        Room,
    }
}

#[cfg(feature = "model")]
#[test]
fn a_configuration_shows_which_rules_are_kept() {
    let all = Rules::<Kept>::default();
    assert_eq!(format!("{all:?}"), "All");
    assert!(all.keeps(Kept::Order) && all.keeps(Kept::Room));
    assert_eq!(format!("{:?}", Rules::without(Kept::Order)), "All but Order");
    assert_eq!(format!("{:?}", Rules::without_both(Kept::Order, Kept::Room)), "All but Order and Room");
}
