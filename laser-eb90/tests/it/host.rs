//! The host's end by itself.

use core::time::Duration;

use crate::common::{CUT, MS, READY, STOP, WHERE, cut, echo, encoded, host, write_cut};
use laser_eb90::robot_session::end::{End as _, Machine as _};
use laser_eb90::robot_session::{EchoError, Session, Unexpected};
use laser_eb90::{
    DecodeError, EncodeError, Frame, Host, HostConfig, HostEvent, Item, Payload, Profile, Refusal,
    SessionError, UnknownReason, timing,
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

const DONE: HostEvent = HostEvent::Done { first: 0, count: 1, resends: 0, unanswered: 0 };

fn unknown(reason: UnknownReason) -> HostEvent {
    HostEvent::Unknown { first: 0, count: 1, reason }
}

/// §3(5): "只有在确认前一包指令正确应答之后,才可以发下一包指令": the next frame only after the answer to the last.
#[test]
fn one_frame_at_a_time() {
    let (mut host, _) = awaiting(HostConfig::default());
    submit(&mut host, 1).unwrap();
    assert_eq!(transmit(&mut host, READY + MS), None);
    host.handle_input(READY + MS * 2, &echo(CUT));
    assert_eq!(transmit(&mut host, READY + MS * 2), None, "its outcome has not been taken yet");
    assert_eq!(events(&mut host), [DONE]);
    assert!(transmit(&mut host, READY + MS * 2).is_some());
}

/// A frame of an earlier host may still be on the line: the longest frame, the longest pause, the time to settle.
#[test]
fn the_first_frame_of_a_connection_waits_until_an_earlier_one_has_passed() {
    let longest = timing::transmission_time(Frame::MAX_LEN, 9600);
    assert_eq!(READY, longest + MS * 400);
    let mut host = host(HostConfig::default());
    submit(&mut host, 0).unwrap();
    assert_eq!(host.poll_timeout(), Some(READY));
    assert_eq!(transmit(&mut host, READY - MS), None);
    assert!(transmit(&mut host, READY).is_some());
    let config = HostConfig { longest_frame: 0, earlier_execution: MS * 700, ..HostConfig::default() };
    let mut host = crate::common::host(config);
    submit(&mut host, 0).unwrap();
    assert_eq!(host.poll_timeout(), Some(MS * 1100));
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

/// An error of the frame itself would occur again. A failed execution may have had effects.
#[test]
fn only_what_was_not_taken_is_sent_again() {
    for (word, code, expected) in [
        (CUT, 0xE003, Some(Refusal::UnknownCommand)),
        (CUT, 0xE004, Some(Refusal::BadBatch)),
        (CUT, 0xE005, Some(Refusal::BadParameters)),
        (WHERE, 0xE005, Some(Refusal::BadParameters)),
        (STOP, 0xE005, None),
    ] {
        let mut host = host(HostConfig::default());
        host.submit(word, |_| Ok(())).unwrap();
        transmit(&mut host, READY).unwrap();
        host.handle_input(READY + MS * 100, &echo(code));
        let event = match expected {
            Some(refusal) => HostEvent::Refused { first: 0, count: 1, refusal },
            None => unknown(UnknownReason::ExecutionFailed),
        };
        assert_eq!(events(&mut host), [event]);
        assert!(host.is_held());
    }
}

/// A controller may keep the first half of a frame when it answers "bad frame", and take the rest.
#[test]
fn an_early_bad_frame_proves_nothing_unless_the_controller_drops_partial_frames() {
    let (mut host, line) = awaiting(HostConfig::default());
    host.handle_input(READY + MS, &echo(0xE002));
    let settled = READY + line + MS * 400;
    assert_eq!((host.poll_timeout(), host.poll_event()), (Some(settled), None));
    host.handle_timeout(settled);
    assert_eq!(events(&mut host), [unknown(UnknownReason::PartialFrame)]);

    let (mut host, line) = awaiting(HostConfig::default());
    host.handle_input(READY + MS, &echo(0xE002));
    host.handle_input(READY + line + MS * 80, &echo(CUT));
    assert_eq!(events(&mut host), [DONE], "the echo follows");

    let (mut host, line) = awaiting(HostConfig::default());
    host.handle_input(READY + line + MS * 341, &[]);
    host.handle_input(READY + line + MS * 249, &echo(0xE002));
    assert_eq!(host.machine().name(), "AwaitingRest", "a pause of 300 ms and an answer that took 40");

    let (mut host, _) = awaiting(HostConfig { controller_drops_partial: true, ..HostConfig::default() });
    host.handle_input(READY + MS, &echo(0xE002));
    assert!(transmit(&mut host, settled).is_some());
    host.handle_input(settled + MS, &echo(0xE002));
    host.handle_input(settled + MS * 2, &echo(CUT));
    let done = HostEvent::Done { first: 0, count: 1, resends: 2, unanswered: 0 };
    assert_eq!(events(&mut host), [done], "an echo confirms, also while the line settles");
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

/// A driver that knows when the last byte has left makes the assumption about pauses unnecessary.
#[test]
fn a_driver_that_reports_the_last_byte_makes_max_pause_unnecessary() {
    let (mut host, _) = awaiting(HostConfig::default());
    let left = READY + MS * 5000;
    host.handle_transmitted(left);
    assert_eq!(host.poll_timeout(), Some(left + MS * 250));
    host.handle_input(left + MS * 39, &echo(0xE002));
    assert_eq!(host.machine().name(), "AwaitingRest");

    let (mut host, _) = awaiting(HostConfig::default());
    host.handle_transmitted(left);
    host.handle_input(left + MS * 40, &echo(0xE002));
    assert_eq!(host.poll_timeout(), Some(left + MS * 140), "not `max_pause`");
    assert!(transmit(&mut host, left + MS * 140).is_some());
}

/// An error code refers to the last transmission only: an unanswered one before it may have been taken.
#[test]
fn after_a_resend_on_silence_an_error_code_proves_nothing() {
    let config = HostConfig { resend_on_silence: true, resends: 1, ..HostConfig::default() };
    let (mut host, line) = awaiting(config);
    host.handle_timeout(READY + line + MS * 250);
    let again = READY + line + MS * 400;
    assert_eq!(host.poll_timeout(), Some(again));
    transmit(&mut host, again).unwrap();
    host.handle_input(again + line + MS * 345, &echo(0xE002));
    assert_eq!(events(&mut host), [unknown(UnknownReason::Silence)]);
}

/// §3(5): "将其中的命令字与保留的命令字比较,如果一样,则说明发送正确": the echo is compared with the word that was sent.
#[test]
fn another_word_in_the_answer_is_an_unknown_outcome() {
    let (mut host, _) = awaiting(HostConfig::default());
    host.handle_input(READY + MS, &echo(0x0102));
    assert_eq!(events(&mut host), [unknown(UnknownReason::OtherWord { expected: CUT, found: 0x0102 })]);
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
fn an_answer_that_comes_twice_is_no_answer_to_the_next_frame() {
    let (mut host, _) = awaiting(HostConfig::default());
    host.handle_input(READY + MS * 50, &echo(CUT).repeat(2));
    assert_eq!(events(&mut host), [DONE, HostEvent::Unasked { word: CUT }]);
    submit(&mut host, 1).unwrap();
    transmit(&mut host, READY + MS * 100).unwrap();
    host.handle_input(READY + MS * 101, &[0]);
    assert_eq!(events(&mut host), []);
    host.handle_input(READY + MS * 150, &echo(CUT));
    let done = HostEvent::Done { first: 1, count: 1, resends: 0, unanswered: 0 };
    assert!(events(&mut host).contains(&done));
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

/// An execution that began before may be answered after: it is waited for, on the next connection too.
#[test]
fn after_an_unknown_immediate_instruction_its_execution_is_waited_for() {
    let mut host = host(HostConfig::default());
    host.submit(STOP, |_| Ok(())).unwrap();
    let line = timing::transmission_time(transmit(&mut host, READY).unwrap().len(), 9600);
    host.handle_disconnected(READY + MS);
    host.handle_connected(READY + MS * 2);
    host.resume();
    host.submit(STOP, |_| Ok(())).unwrap();
    assert_eq!(host.poll_timeout(), Some(READY + line + MS * 30_400));
}

#[test]
fn the_values_of_a_query_stay_until_the_next_is_answered() {
    let mut host = host(HostConfig::default());
    let answer = |host: &mut Host, ticket: u64, value: f32, early: Option<u16>| {
        host.submit(WHERE, |_| Ok(())).unwrap();
        let now = READY + MS * (100 + 100 * u32::try_from(ticket).unwrap());
        transmit(host, now).unwrap();
        if let Some(code) = early {
            host.handle_input(now + MS, &echo(code));
            assert_eq!(host.machine().name(), "AwaitingRest");
        }
        let mut buffer = [0; 16];
        let mut payload = Payload::new(&mut buffer, &Profile::default());
        payload.word(WHERE).unwrap().f32(&[value]).unwrap();
        host.handle_input(now + MS, &encoded(&payload));
        host.handle_input(now + MS, &echo(WHERE)); // an unsolicited one
        assert_eq!(events(host), [HostEvent::Answer { ticket }, HostEvent::Unasked { word: WHERE }]);
        match host.answer().next() {
            Some(Ok(Item::F32(values))) => values.array().unwrap(),
            other => panic!("{other:?}"),
        }
    };
    let values: [[f32; 1]; 3] = [
        answer(&mut host, 0, 1.5, None),
        answer(&mut host, 1, -2.5, None),
        // The first half of the query was answered too.
        answer(&mut host, 2, 3.5, Some(0xE002)),
    ];
    assert_eq!(values, [[1.5], [-2.5], [3.5]]);
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

#[test]
fn parameters_that_read_as_a_command_word_are_refused() {
    let mut host = host(HostConfig::default());
    assert_eq!(host.submit(CUT, |p| p.i16(&[1]).map(drop)), Err(SessionError::LoneShort));
    assert_eq!(host.submit(STOP, |p| p.word(CUT).map(drop)), Err(SessionError::LoneShort));
    assert_eq!(host.submit(0x7777, |_| Ok(())), Err(SessionError::UnknownWord { word: 0x7777 }));
    let error = EncodeError::TooManyValues { count: 256 };
    assert_eq!(host.submit(CUT, |p| p.u8(&[0; 256]).map(drop)), Err(SessionError::Encode(error)));
    for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let error = EncodeError::NotFinite { index: 1 };
        let refused = host.submit(CUT, |p| p.f32(&[0.0, value]).map(drop));
        assert_eq!(refused, Err(SessionError::Encode(error)));
    }
    let error = EncodeError::BufferTooSmall { needed: 257, available: 251 };
    let refused = host.submit(CUT, |p| p.u8(&[0; 255])?.u8(&[0; 255]).map(drop));
    assert_eq!(refused, Err(SessionError::Encode(error)), "no frame has room for it");
    assert!(host.is_idle());
    assert_eq!(host.submit(CUT, |p| p.u8(&[0; 255]).map(drop)), Ok(0));
    assert_eq!(host.submit(CUT, |p| p.u8(&[0; 255]).map(drop)), Err(SessionError::Full), "512 bytes");
    assert_eq!(host.take_back(), 1);
    assert!(host.is_idle());
    assert_eq!(host.submit(STOP, |p| p.i16(&[1]).map(drop)), Ok(1), "1 is not a command word");
}

/// A frame whose answer is given up must not be executed later: a driver discards its bytes.
#[test]
fn bytes_that_nobody_has_taken_are_discarded_when_the_answer_is_given_up() {
    let config = HostConfig { answer_timeout: MS * 700, ..HostConfig::default() };
    assert_eq!(Session::discards_after(&host(config)), Some(MS * 700));
}

/// On a slow line an answer takes longer; on a fast one nothing is quicker than the controller.
#[test]
fn the_defaults_follow_the_baud_rate() {
    let slow = HostConfig::at_baud(1200);
    let longer = timing::transmission_time(13, 1200) - timing::transmission_time(13, 9600);
    assert!(longer > MS * 94, "{longer:?}");
    assert_eq!((slow.settle, slow.reply_time), (MS * 100 + longer, MS * 40 + longer));
    assert_eq!(slow.answer_timeout, MS * 250 + longer);
    let fast = HostConfig { baud: 9600, ..HostConfig::at_baud(115_200) };
    assert_eq!(fast, HostConfig::default());
}

/// Without a controller, the line returns the sent bytes after noise, any number of times: no frame with parameters is done.
#[test]
fn a_frame_that_comes_back_is_not_an_answer() {
    for is_set in [false, true] {
        for (noise, copies) in [(0, 1), (1, 1), (4, 1), (40, 1), (0, 2), (4, 2), (0, 3)] {
            for size in [1, 7, 1000] {
                let mut host = host(HostConfig { echo: is_set, ..HostConfig::default() });
                let mut now = READY;
                for first in 0..3 {
                    submit(&mut host, 1).unwrap();
                    let sent = transmit(&mut host, now).unwrap();
                    let line = [vec![0xFF; noise], sent.repeat(copies)].concat();
                    line.chunks(size).for_each(|piece| host.handle_input(now + MS, piece));
                    now = host.poll_timeout().unwrap();
                    host.handle_timeout(now);
                    let seen = events(&mut host);
                    let unknown = |event: &&HostEvent| matches!(event, HostEvent::Unknown { first: found, .. } if *found == first);
                    assert_eq!(seen.iter().filter(unknown).count(), 1, "{noise}, {copies}, {size}: {seen:?}");
                    assert!(!seen.iter().any(|event| matches!(event, HostEvent::Done { .. })), "{seen:?}");
                    let is_told =
                        |event: &HostEvent| matches!(event, HostEvent::Echo(EchoError::NotSet { .. }));
                    assert_eq!(
                        seen.iter().any(is_told),
                        first == 0 && !is_set,
                        "{noise}, {copies}: {seen:?}"
                    );
                    host.resume();
                    now += MS * 1000;
                }
            }
        }
    }
}
