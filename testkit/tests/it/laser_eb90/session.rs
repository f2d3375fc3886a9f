//! The rules of the source that both ends keep.

use core::time::Duration;

use laser_eb90::{HostConfig, HostEvent, Profile, Refusal, SessionError, UnknownReason, timing};
use robot_session::Session as _;
use testkit::link::End;

use crate::laser_eb90::cell::{Cell, KNOWN, MS, START, STOP, WHERE, controller, cut};

const fn done(first: u64, count: u8, resends: u8, unanswered: u8) -> HostEvent {
    HostEvent::Done { first, count, resends, unanswered }
}

/// §3(6): "在一个数据报里同时发送了多条指令,而下位机只需应答第一条指令": several instructions travel in one frame, and only the
/// first is answered. §2: an interpreted one is answered as soon as it is queued.
#[test]
fn seven_instructions_travel_together_and_the_first_is_answered() {
    let mut cell = Cell::clean();
    cell.halted = true;
    for index in 0..7 {
        assert_eq!(cell.submit(index), Ok(u64::from(index)));
    }
    assert_eq!(cell.submit(7), Err(SessionError::Full));
    cell.run_for(Duration::from_secs(1));
    assert_eq!(cell.events, [done(0, 7, 0, 0)]);
    assert_eq!(cell.frames_sent, 1);
    assert_eq!(cell.reader.len(), 7);
    cell.halted = false;
    cell.run_for(MS);
    assert_eq!(cell.executed, (0..7).map(cut).collect::<Vec<_>>());
}

/// §4.1: "在一个时钟周期内(16ms),所有任务执行一遍": an answer leaves at the end of a 16 ms cycle.
#[test]
fn an_answer_leaves_at_the_end_of_the_cycle() {
    let mut cell = Cell::clean();
    cell.submit(0).unwrap();
    cell.run_for(Duration::from_millis(30));
    assert!(cell.events.is_empty());
    // 23 bytes take 23.96 ms, the cycle ends at 32 ms, 11 bytes of answer take 11.46 ms.
    cell.run_until(START + Duration::from_micros(43_400));
    assert!(cell.events.is_empty());
    cell.run_until(START + Duration::from_micros(43_600));
    assert_eq!(cell.events.len(), 1);
}

/// §3(6): "控件只允许解释执行指令成组发送,对于立即指令,只能发送单指令数据报": immediate instructions travel alone.
#[test]
fn immediate_instructions_and_queries_travel_alone() {
    let mut cell = Cell::clean();
    cell.submit(0).unwrap();
    assert_eq!(cell.host.submit(STOP, |_| Ok(())), Err(SessionError::Full));
    cell.run_for(MS);
    cell.host.submit(STOP, |p| p.i16(&[1]).map(drop)).unwrap();
    assert_eq!(cell.submit(1), Err(SessionError::Full));
    assert_eq!(cell.host.submit(WHERE, |_| Ok(())), Err(SessionError::Full));
    cell.run_for(MS * 200);
    cell.host.submit(WHERE, |_| Ok(())).unwrap();
    cell.run_for(MS * 200);
    assert_eq!(cell.events, [done(0, 1, 0, 0), done(1, 1, 0, 0), HostEvent::Answer { ticket: 2 },]);
    assert_eq!(cell.answer, [1.5, -2.5]);
}

/// §3(4): a corrupt frame is dropped and answered with an error code; the host keeps a backup "直到确认接收正确了,才将其消除" and
/// sends it again.
#[test]
fn an_error_code_is_answered_from_the_backup() {
    let mut cell = Cell::clean();
    for index in 0..7 {
        cell.submit(index).unwrap();
    }
    let mut out = [0; laser_eb90::Host::MAX_TRANSMIT];
    let n = cell.host.poll_transmit(cell.now, &mut out).unwrap();
    let sent = out[..n].to_vec();
    let mut corrupt = sent.clone();
    corrupt[20] ^= 0x04;
    cell.link.send(End::A, cell.now, &corrupt);
    cell.run_for(Duration::from_secs(1));
    assert_eq!(cell.events, [done(0, 7, 1, 0)]);
    assert_eq!(cell.executed, (0..7).map(cut).collect::<Vec<_>>());
}

/// There is no sequence number: a lost answer looks like a lost frame, so silence must not be answered by a resend.
#[test]
fn silence_is_an_unknown_outcome_and_nothing_is_sent_again() {
    let mut cell = Cell::clean();
    cell.submit(0).unwrap();
    cell.run_until(START + MS * 30);
    cell.link.disconnect(cell.now);
    cell.run_for(Duration::from_secs(5));
    assert_eq!(cell.events, [HostEvent::Unknown { first: 0, count: 1, reason: UnknownReason::Silence }]);
    assert_eq!((cell.frames_sent, cell.executed.len()), (1, 1));
    assert_eq!(cell.host.poll_timeout(), None);
}

#[test]
fn a_resend_on_silence_is_asked_for_and_says_what_it_may_have_done() {
    let mut cell = Cell::configured(HostConfig { resend_on_silence: true, ..KNOWN() });
    cell.submit(0).unwrap();
    cell.run_until(START + MS * 35);
    cell.link.disconnect(cell.now);
    cell.link.reconnect(); // the answer, which left at 32 ms, is lost
    cell.run_for(Duration::from_secs(5));
    assert_eq!(cell.events, [done(0, 1, 1, 1)]);
    assert_eq!(cell.executed, [cut(0), cut(0)], "executed twice: this is why it must be asked for");
}

#[test]
fn a_full_queue_takes_the_whole_frame_or_nothing() {
    let mut cell = Cell::clean();
    cell.halted = true;
    for batch in 0..4 {
        for index in 0..6 {
            cell.submit(batch * 6 + index).unwrap();
        }
        cell.run_for(MS * 400);
    }
    assert_eq!(cell.reader.len(), 18, "three are free, six do not fit");
    assert_eq!(cell.events.len(), 3);
    assert!(cell.frames_sent > 4, "asks again and again: {}", cell.frames_sent);
    cell.halted = false;
    cell.run_for(MS * 400);
    assert_eq!(cell.events.len(), 4);
    assert_eq!(cell.events[3], done(18, 6, 0, 0));
    assert_eq!(cell.executed, (0..24).map(cut).collect::<Vec<_>>());
}

#[test]
fn a_queue_that_stays_full_is_a_refusal() {
    let mut cell = Cell::clean();
    cell.halted = true;
    for batch in 0..4 {
        for index in 0..7 {
            cell.submit(batch * 7 + index).unwrap();
        }
        cell.run_for(MS * 500);
    }
    cell.run_for(Duration::from_secs(61));
    assert_eq!(cell.events[3], HostEvent::Refused { first: 21, count: 7, refusal: Refusal::QueueFull });
    cell.halted = false;
    cell.run_for(Duration::from_secs(1));
    assert_eq!(cell.executed, (0..21).map(cut).collect::<Vec<_>>());
}

/// A PC that pauses within a frame gets an error code for each half. The second must not be taken for the answer to the
/// resend, which would then be sent, and executed, twice.
#[test]
fn a_second_error_code_for_the_same_corruption_is_not_the_resends() {
    let mut cell = Cell::clean();
    for index in 0..7 {
        cell.submit(index).unwrap();
    }
    let mut out = [0; laser_eb90::Host::MAX_TRANSMIT];
    let n = cell.host.poll_transmit(cell.now, &mut out).unwrap();
    let (head, tail) = out[..n].split_at(n / 2);
    cell.link.send(End::A, cell.now, head);
    cell.run_until(START + MS * 140); // an error code has come at 124 ms
    cell.link.send(End::A, cell.now, tail);
    cell.run_for(Duration::from_secs(3));
    assert_eq!(cell.events.len(), 1);
    assert_eq!(cell.executed, (0..7).map(cut).collect::<Vec<_>>());
}

#[test]
fn a_controller_that_restarts_within_a_batch_leaves_it_unknown() {
    let mut cell = Cell::clean();
    for index in 0..7 {
        cell.submit(index).unwrap();
    }
    cell.run_until(START + MS * 126); // the frame takes 124 ms, the cycle ends at 128 ms
    assert_eq!(cell.executed.len(), 7, "queued and executed, but not answered");
    (cell.controller, cell.reader) = controller(Profile::default());
    cell.run_for(Duration::from_secs(5));
    assert_eq!(cell.events, [HostEvent::Unknown { first: 0, count: 7, reason: UnknownReason::Silence }]);
    assert_eq!((cell.frames_sent, cell.executed.len()), (1, 7), "not sent again");
}

#[test]
fn a_cycle_ends_at_its_multiples() {
    let end = |micros| timing::end_of_tick(Duration::from_micros(micros), timing::TICK).as_micros();
    assert_eq!([0, 1, 15_999, 16_000, 16_001].map(end), [0, 16_000, 16_000, 16_000, 32_000]);
    assert_eq!(timing::end_of_tick(MS, Duration::ZERO), MS);
    assert_eq!(timing::transmission_time(217, 9600).as_micros(), 226_041);
    assert_eq!(timing::exchange_time(217, 11, 9600, timing::TICK).as_micros(), 253_500);
    assert_eq!(timing::transmission_time(1, 0), Duration::MAX);
    // An instruction of 30 bytes at 9600 baud: 64 ms alone, 240 ms for seven.
    assert_eq!(timing::period(37, 11, 9600, timing::TICK), MS * 64);
    assert_eq!(timing::period(217, 11, 9600, timing::TICK), MS * 240);
}
