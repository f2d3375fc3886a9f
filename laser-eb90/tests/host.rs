//! The host's end by itself.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

mod common;

use core::time::Duration;

use common::{CUT, Event, MS, cut, echo, write_cut};
use laser_eb90::{
    Class, DecodeError, Doubt, EncodeError, ErrorCodes, Frame, Host, HostConfig, HostEvent, Refusal,
    SessionError, Words, timing,
};

/// §3(5): "只有在确认前一包指令正确应答之后,才可以发下一包指令": the next frame only after the answer to the last.
#[test]
fn one_frame_at_a_time() {
    let mut host = Host::new(HostConfig::default());
    let mut out = [0; Frame::MAX_LEN];
    host.submit(CUT, |p| write_cut(p, cut(0))).unwrap();
    assert!(host.poll_transmit(MS, &mut out).is_some());
    host.submit(CUT, |p| write_cut(p, cut(1))).unwrap();
    assert_eq!(host.poll_transmit(MS * 2, &mut out), None);
    host.handle_input(MS * 3, &echo(CUT));
    assert_eq!(host.poll_transmit(MS * 3, &mut out), None, "its outcome has not been taken yet");
    assert!(host.poll_event().is_some());
    assert!(host.poll_transmit(MS * 3, &mut out).is_some());
}

#[test]
fn resends_end_at_the_limit() {
    let mut host = Host::new(HostConfig::default());
    let mut out = [0; Frame::MAX_LEN];
    host.submit(CUT, |p| write_cut(p, cut(0))).unwrap();
    let mut now = Duration::ZERO;
    let mut frames = Vec::new();
    for _ in 0..4 {
        let n = host.poll_transmit(now, &mut out).unwrap();
        frames.push(out[..n].to_vec());
        host.handle_input(now + MS, &echo(0xE001));
        let settled = now + MS + timing::transmission_time(n, 9600) + MS * 100;
        assert_eq!(host.poll_transmit(settled - MS, &mut out), None, "the line has not settled");
        now = settled;
    }
    assert!(frames.windows(2).all(|w| w[0] == w[1]));
    assert_eq!(host.poll_transmit(now, &mut out), None);
    let event = host.poll_event().map(Event::from);
    assert_eq!(event, Some(Event::Refused { first: 0, count: 1, refusal: Refusal::BadChecksum }));
    assert!(host.is_held());
    host.submit(CUT, |p| write_cut(p, cut(1))).unwrap();
    assert_eq!(host.poll_transmit(now, &mut out), None, "held until the caller resumes");
    host.resume();
    assert!(host.poll_transmit(now, &mut out).is_some());
}

/// An error code speaks of the last transmission only: an unanswered one before it may have been taken.
#[test]
fn after_a_resend_on_silence_an_error_code_proves_nothing() {
    let mut host = Host::new(HostConfig { resend_on_silence: true, resends: 1, ..HostConfig::default() });
    let mut out = [0; Frame::MAX_LEN];
    host.submit(CUT, |p| write_cut(p, cut(0))).unwrap();
    host.poll_transmit(Duration::ZERO, &mut out).unwrap();
    host.handle_timeout(MS * 1000);
    host.poll_transmit(MS * 1200, &mut out).unwrap();
    host.handle_input(MS * 1250, &echo(0xE002));
    let event = host.poll_event().map(Event::from);
    let cause = Doubt::OtherWord { expected: CUT, found: 0xE002 };
    assert_eq!(event, Some(Event::Unknown { first: 0, count: 1, cause }));
}

/// §3(5): "将其中的命令字与保留的命令字比较,如果一样,则说明发送正确": the echo is compared with the word that was sent.
#[test]
fn another_word_in_the_answer_is_an_unknown_outcome() {
    let mut host = Host::new(HostConfig::default());
    let mut out = [0; Frame::MAX_LEN];
    host.submit(CUT, |p| write_cut(p, cut(0))).unwrap();
    host.poll_transmit(MS, &mut out).unwrap();
    host.handle_input(MS * 2, &echo(0x0102));
    let event = host.poll_event().map(Event::from);
    let cause = Doubt::OtherWord { expected: CUT, found: 0x0102 };
    assert_eq!(event, Some(Event::Unknown { first: 0, count: 1, cause }));
}

#[test]
fn a_damaged_answer_is_an_unknown_outcome_that_says_what_was_wrong() {
    let mut host = Host::new(HostConfig::default());
    let mut out = [0; Frame::MAX_LEN];
    host.submit(CUT, |p| write_cut(p, cut(0))).unwrap();
    host.poll_transmit(MS, &mut out).unwrap();
    let mut answer = echo(CUT);
    *answer.last_mut().unwrap() ^= 1;
    host.handle_input(MS * 2, &answer);
    assert_eq!(host.poll_event(), None, "a good answer may still follow");
    host.handle_timeout(MS * 500);
    let event = host.poll_event().map(Event::from);
    let error = DecodeError::Checksum { offset: 10, expected: 0xF4, found: 0xF5 };
    assert_eq!(event, Some(Event::Unknown { first: 0, count: 1, cause: Doubt::Damaged(error) }));
}

#[test]
fn what_comes_unasked_is_ignored() {
    let mut host = Host::new(HostConfig::default());
    let mut out = [0; Frame::MAX_LEN];
    host.handle_input(MS, &echo(CUT));
    host.submit(CUT, |p| write_cut(p, cut(0))).unwrap();
    host.handle_input(MS, &echo(CUT)[..7]);
    host.poll_transmit(MS, &mut out).unwrap();
    host.handle_input(MS * 2, &echo(CUT)[7..]);
    assert_eq!(host.poll_event(), None, "half of that answer came before the frame was sent");
}

#[test]
fn an_answer_that_comes_twice_is_no_answer_to_the_next_frame() {
    let mut host = Host::new(HostConfig::default());
    let mut out = [0; Frame::MAX_LEN];
    host.submit(CUT, |p| write_cut(p, cut(0))).unwrap();
    host.poll_transmit(MS, &mut out).unwrap();
    host.handle_input(MS * 50, &echo(CUT).repeat(2));
    assert!(matches!(host.poll_event(), Some(HostEvent::Done { first: 0, count: 1, .. })));
    host.submit(CUT, |p| write_cut(p, cut(1))).unwrap();
    host.poll_transmit(MS * 100, &mut out).unwrap();
    host.handle_input(MS * 101, &[0]);
    assert_eq!(host.poll_event(), None, "the second echo came before the frame was sent");
    host.handle_input(MS * 150, &echo(CUT));
    assert!(matches!(host.poll_event(), Some(HostEvent::Done { first: 1, count: 1, .. })));
}

#[test]
fn parameters_that_read_as_a_command_word_are_refused() {
    let mut host = Host::new(HostConfig::default());
    assert_eq!(host.submit(CUT, |p| p.i16(&[1]).map(drop)), Err(SessionError::LoneShort));
    assert_eq!(host.submit(0x7777, |_| Ok(())), Err(SessionError::UnknownWord { word: 0x7777 }));
    let error = EncodeError::TooManyValues { count: 256 };
    assert_eq!(host.submit(CUT, |p| p.u8(&[0; 256]).map(drop)), Err(SessionError::Encode(error)));
    assert!(host.is_idle());
    assert_eq!(host.submit(CUT, |p| p.u8(&[0; 255]).map(drop)), Ok(0));
    assert_eq!(host.submit(CUT, |p| p.u8(&[0; 255]).map(drop)), Err(SessionError::Full), "512 bytes");
    assert_eq!(host.take_back(), 1);
    assert!(host.is_idle());
}

#[test]
fn every_word_has_one_meaning() {
    const TWICE: &[(core::ops::RangeInclusive<u16>, Class)] =
        &[(1..=9, Class::Interpreted), (5..=20, Class::Immediate)];
    const ERROR: &[(core::ops::RangeInclusive<u16>, Class)] = &[(0xE000..=0xE00F, Class::Query)];
    let message = |words: Result<Words, SessionError>| words.unwrap_err().to_string();
    assert_eq!(
        message(Words::new(TWICE, ErrorCodes::default())),
        "0005h is a command word and a command word at once"
    );
    assert_eq!(
        message(Words::new(ERROR, ErrorCodes::default())),
        "E001h is a command word and an error code at once"
    );
    let codes = ErrorCodes { queue_full: 0xE001, ..ErrorCodes::default() };
    assert_eq!(message(Words::new(&[], codes)), "E001h is an error code and an error code at once");
    let words = Words::default();
    assert_eq!(
        [0x00FF, 0x0100, 0x01FF, 0x0200, 0x02FF, 0x0300, 0x03FF, 0x0400].map(|word| words.class(word)),
        [
            None,
            Some(Class::Interpreted),
            Some(Class::Interpreted),
            Some(Class::Immediate),
            Some(Class::Immediate),
            Some(Class::Query),
            Some(Class::Query),
            None
        ]
    );
}
