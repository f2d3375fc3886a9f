//! The host's counters, calls and answers. Its rules are the stories of `reference/sessions/laser-eb90.json`.

use core::time::Duration;

use crate::common::{CUT, MS, READY, WHERE, cut, echo, encoded, host, write_cut};
use laser_eb90::robot_session::{Session, Unexpected};
use laser_eb90::{
    DecodeError, Frame, Host, HostConfig, HostEvent, Item, Payload, Profile, Refusal, SessionError,
    UnknownReason, timing,
};

fn submit(host: &mut Host, index: u32) -> Result<u64, SessionError> {
    host.submit(CUT, |payload| write_cut(payload, cut(index)))
}

fn transmit(host: &mut Host, now: Duration) -> Option<Vec<u8>> {
    let mut out = [0; Frame::MAX_LEN];
    host.poll_transmit(now, &mut out).map(|length| out[..length].to_vec())
}

/// Creates a host that has one cut in flight, sent at `READY`.
fn awaiting(config: HostConfig) -> (Host, Duration) {
    let mut host = host(config);
    submit(&mut host, 0).unwrap();
    let frame = transmit(&mut host, READY).unwrap();
    (host, timing::transmission_time(frame.len(), 9600))
}

fn events(host: &mut Host) -> Vec<HostEvent> {
    core::iter::from_fn(|| host.poll_event()).collect()
}

fn unknown(reason: UnknownReason) -> HostEvent {
    HostEvent::Unknown { first: 0, count: 1, reason }
}

#[test]
fn resends_end_at_the_limit() {
    let (mut host, line) = awaiting(HostConfig::default());
    let mut sent = READY;
    let mut frames = vec![];
    for resends in 1..=3 {
        host.handle_input(sent + MS, &echo(0xE001));
        let settled = sent + line + MS * 400;
        assert_eq!(host.poll_timeout(), Some(settled));
        assert_eq!(transmit(&mut host, settled - MS), None, "the line has not settled");
        frames.extend(transmit(&mut host, settled));
        assert_eq!(frames.len(), resends);
        sent = settled;
    }
    assert!(frames.windows(2).all(|pair| pair[0] == pair[1]));
    host.handle_input(sent + MS, &echo(0xE001));
    assert_eq!(events(&mut host), [HostEvent::Refused { first: 0, count: 1, refusal: Refusal::BadChecksum }]);
    assert!(host.is_held());
    submit(&mut host, 1).unwrap();
    assert_eq!(transmit(&mut host, sent + MS * 9000), None, "held until the caller resumes");
    host.resume();
    assert!(!host.is_held());
    assert!(transmit(&mut host, sent + MS * 9000).is_some());
    assert_eq!((host.statistics().frames, host.statistics().resends), (5, 3));
}

/// An unsolicited answer is the only sign that an assumption of the configuration is wrong.
#[test]
fn an_echo_that_ends_after_it_was_given_up_is_reported() {
    let (mut host, line) = awaiting(HostConfig::default());
    host.handle_input(READY + MS, &echo(0xE002));
    host.handle_input(READY + line + MS * 399, &echo(CUT)[..5]);
    host.handle_timeout(READY + line + MS * 400);
    assert_eq!(events(&mut host), [unknown(UnknownReason::PartialFrame)]);
    host.handle_input(READY + line + MS * 401, &echo(CUT)[5..]);
    assert_eq!(events(&mut host), [HostEvent::Unasked { word: CUT }]);
}

#[test]
fn a_corrupt_answer_is_an_unknown_outcome() {
    let (mut host, line) = awaiting(HostConfig::default());
    let mut answer = echo(CUT);
    *answer.last_mut().unwrap() ^= 1;
    host.handle_input(READY + MS, &answer);
    let error = DecodeError::Checksum { offset: 10, expected: 0xF4, found: 0xF5 };
    assert_eq!(events(&mut host), [HostEvent::Corrupt(error)], "a good answer may still follow");
    host.handle_timeout(READY + line + MS * 250);
    assert_eq!(events(&mut host), [unknown(UnknownReason::Corrupt)]);
    // Half an answer when it is overdue is one, too.
    let (mut host, line) = awaiting(HostConfig::default());
    host.handle_input(READY + MS, &answer[..5]);
    host.handle_timeout(READY + line + MS * 250);
    let error = DecodeError::Incomplete { held: 5 };
    assert_eq!(events(&mut host), [HostEvent::Corrupt(error), unknown(UnknownReason::Corrupt)]);
    assert_eq!(host.statistics().corrupt, 1);
}

#[test]
fn what_comes_unasked_is_reported() {
    let mut host = host(HostConfig::default());
    host.handle_input(READY, &echo(CUT));
    assert_eq!(events(&mut host), [HostEvent::Unasked { word: CUT }]);
    submit(&mut host, 0).unwrap();
    host.handle_input(READY, &echo(CUT)[..7]);
    transmit(&mut host, READY).unwrap();
    host.handle_input(READY + MS, &echo(CUT)[7..]);
    assert_eq!(events(&mut host), [], "half of that answer came before the frame was sent");
    assert_eq!(host.statistics().unasked, 1);
}

#[test]
fn a_lost_connection_makes_the_outcome_unknown_and_what_was_not_sent_waits() {
    let (mut host, _) = awaiting(HostConfig::default());
    submit(&mut host, 1).unwrap();
    host.handle_disconnected(READY + MS);
    assert_eq!(events(&mut host), [unknown(UnknownReason::Disconnected)]);
    host.handle_input(READY + MS * 2, &echo(CUT));
    let unexpected = Unexpected { state: "DisconnectedHeld", input: "Answer" };
    assert_eq!(events(&mut host), [HostEvent::Unexpected(unexpected)]);
    assert_eq!((host.is_held(), host.poll_timeout()), (true, None));
    host.handle_connected(READY + MS * 10);
    assert_eq!(host.poll_timeout(), None, "the caller has not looked yet");
    host.resume();
    assert_eq!(host.poll_timeout(), Some(READY * 2 + MS * 10));
    transmit(&mut host, READY * 2 + MS * 10).unwrap();
    // A connection without an end of the previous one.
    host.handle_connected(READY * 3);
    let lost = HostEvent::Unknown { first: 1, count: 1, reason: UnknownReason::Disconnected };
    assert_eq!(events(&mut host), [lost]);
    assert!(!host.is_idle());
    host.resume();
    assert!(host.is_idle());
    host.resume();
    let unexpected = Unexpected { state: "Idle", input: "Resume" };
    assert_eq!(events(&mut host), [HostEvent::Unexpected(unexpected)]);
    assert_eq!(host.statistics().unexpected, 2);
}

#[test]
fn what_answers_no_query_leaves_the_values_of_the_last() {
    let mut host = host(HostConfig::default());
    let mut buffer = [0; 16];
    let mut values = Payload::new(&mut buffer, &Profile::default());
    values.word(WHERE).unwrap().f32(&[1.5]).unwrap();
    let answers = [(WHERE, encoded(&values)), (CUT, echo(CUT)), (WHERE, echo(0xE003))];
    for ((word, answer), now) in answers.into_iter().zip([READY, READY + MS * 100, READY + MS * 200]) {
        host.submit(word, |_| Ok(())).unwrap();
        transmit(&mut host, now).unwrap();
        host.handle_input(now + MS, &answer);
        assert_eq!(events(&mut host).len(), 1);
        let Some(Ok(Item::F32(values))) = host.answer().next() else { panic!("{word:04X}") };
        assert_eq!(values.array(), Some([1.5]));
    }
}

/// A frame whose answer is given up must not be executed later: a driver discards its bytes.
#[test]
fn bytes_that_nobody_has_taken_are_discarded_when_the_answer_is_given_up() {
    let config = HostConfig { answer_timeout: MS * 700, ..HostConfig::default() };
    assert_eq!(Session::discards_after(&host(config)), Some(MS * 700));
    let never = HostConfig { answer_timeout: Duration::MAX, ..config };
    assert_eq!(Session::discards_after(&host(never)), None);
}
