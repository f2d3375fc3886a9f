//! The effects of replies on the arm: increments, offsets, limits, exceptions.
use crate::val2_alter::common::{CYCLE, MS, connected, in_first_cycle, plain, running, x};
use robot_session::Session as _;
use robot_session::contract::Rng;
use val2_alter::{
    ControllerConfig, ControllerEvent, ControllerState, End, ErrorCode, Exception, ExceptionOutcome, Frame,
    Framing, Host, HostConfig, HostEvent, HostMessage, HostState, Limits, Message, Mode, MotionPhase, Policy,
    SessionError, StartCode, UnknownReason, Unselected,
};

#[test]
fn an_increment_moves_the_arm_by_its_value_in_each_cycle() {
    let (host, controller) = plain();
    let mut cell = running(host, controller);
    cell.applied.clear();
    cell.host.set_target(cell.now, x(80));
    cell.cycles(10);
    assert_eq!(cell.offset()[0], 10 * 80);
}

#[test]
fn letting_go_of_the_ball_never_exceeds_the_acceleration() {
    let limits = Limits { velocity: [60; 6], acceleration: [7; 6] };
    let (host, controller) = plain();
    let mut cell = running(HostConfig { limits, ..host }, controller);
    for target in [x(127), [-127, 127, 0, 50, -3, 9], [0; 6], [i16::MAX; 6], [i16::MIN; 6], [0; 6]] {
        cell.host.set_target(cell.now, target);
        cell.cycles(13);
    }
    assert!(cell.applied.len() > 70);
    let mut last = [0; 6];
    for values in &cell.applied {
        for (value, last) in values.iter().zip(last) {
            assert!((value - last).abs() <= 7 && value.abs() <= 60, "{last} then {value}");
        }
        last = *values;
    }
    assert!(cell.applied.iter().any(|values| values[0] == 60), "the velocity is reached");
}

#[test]
fn a_stop_ramps_to_zero_and_then_falls_silent() {
    let limits = Limits { velocity: [50; 6], acceleration: [20; 6] };
    let (host, controller) = plain();
    let mut cell = running(HostConfig { limits, ..host }, controller);
    cell.host.set_target(cell.now, x(50));
    cell.cycles(4);
    cell.applied.clear();
    cell.host.stop(cell.now);
    assert_eq!((cell.host.state(), cell.host.policy()), (HostState::Stopping, Policy::Ignore));
    cell.host.set_target(cell.now, x(50)); // has no effect any more
    cell.cycles(8);
    let values: Vec<_> = cell.applied.iter().map(|values| values[0]).collect();
    // The zero is sent once, and was read.
    assert_eq!(values, [30, 10, 0]);
    assert!(cell.host_events.contains(&HostEvent::Stopped));
    assert_eq!(cell.controller_events.last(), Some(&ControllerEvent::Ended(ErrorCode::Timeout)));
    assert_eq!((cell.host.state(), cell.host.statistics().missed), (HostState::Idle, 0));

    cell.start();
    cell.cycles(5);
    assert_eq!(cell.controller.state(), ControllerState::Off, "a stopped host does not answer");
    cell.host.set_policy(cell.now, Policy::Accept);
    cell.start();
    cell.cycles(2);
    assert_eq!(cell.host.state(), HostState::Running);
}

#[test]
fn a_non_cumulative_offset_is_gone_to_and_come_back_from() {
    let limits = Limits { velocity: [50; 6], acceleration: [20; 6] };
    let (host, controller) = plain();
    let controller = ControllerConfig { mode: Mode::NON_CUMULATIVE_22, ..controller };
    let mut cell = running(HostConfig { limits, ..host }, controller);
    cell.applied.clear();
    cell.host.set_target(cell.now, x(200));
    cell.cycles(9);
    let values: Vec<_> = cell.applied.iter().map(|values| values[0]).collect();
    assert_eq!(values, [20, 60, 110, 160, 190, 200, 200, 200, 200]);
    assert_eq!(cell.offset()[0], 200);
    cell.applied.clear();
    cell.host.stop(cell.now);
    cell.cycles(12);
    let values: Vec<_> = cell.applied.iter().map(|values| values[0]).collect();
    assert_eq!(values, [180, 140, 90, 40, 10, 0, 0]);
    assert_eq!(cell.offset()[0], 0);
    assert_eq!(cell.controller.state(), ControllerState::Off);
}

#[test]
fn after_a_cycle_in_which_it_stood_the_arm_begins_again_from_rest() {
    let limits = Limits { velocity: [50; 6], acceleration: [20; 6] };
    let mut host = connected(HostConfig { limits, ..plain().0 });
    let mut out = [0; Frame::MAX_LEN];
    host.handle_input(MS, b"\x10\x10\x02\xA0\x17\x10\x03\xB7");
    host.poll_transmit(MS, &mut out).unwrap();
    host.set_target(MS, x(50));
    let mut values = Vec::new();
    let mut now = MS;
    for (error, late) in [(0, 0), (0, 0), (0, 0), (1, 0), (0, 0), (0, 13), (0, 0), (0, 0)] {
        let frame = [0x10, 0x10, 0x02, 0x80 | error, 2, 1, 0, 0, 32, 0x10, 0x03, 0xA3 + error];
        now += CYCLE;
        host.handle_input(now, &frame);
        values.push(host.poll_transmit(now + MS * late, &mut out).map_or(0, |_| host.values()[0]));
    }
    assert_eq!(values, [20, 40, 50, 20, 40, 0, 20, 40]);
}

/// "Im kumulativen Betrieb wird jedes nicht übertragene Datenwort von VAL-II intern unverändert gelassen" (§3.3.2), or is
/// zero: the omitted words of a reply are right under both readings.
#[test]
fn values_that_are_not_transmitted_mean_the_same_to_every_controller() {
    for mode in [22, 23] {
        let mut all = Vec::new();
        for (baud, unselected) in [38_400, 19_200]
            .into_iter()
            .flat_map(|baud| [Unselected::ByMode, Unselected::Hold, Unselected::Zero].map(|way| (baud, way)))
        {
            let (host, controller) = plain();
            let host = HostConfig { baud, mode: Mode(mode), ..host };
            let controller = ControllerConfig { mode: Mode(mode), baud, unselected, ..controller };
            let mut cell = running(host, controller);
            for target in [
                x(5),
                x(5),
                [1, 2, 0, 0, 5, 0],
                [0, 0, 0, 0, 5, 0],
                [0, 0, 3, 0, 5, 0],
                [0; 6],
                x(-9),
                [0, 0, 7, 0, 0, 0],
            ] {
                cell.host.set_target(cell.now, target);
                cell.cycles(2);
            }
            assert_eq!((cell.host.statistics().missed, cell.host.statistics().held), (0, 0));
            all.push(cell.applied);
        }
        assert!(all.iter().all(|applied| *applied == all[0]), "mode {mode}: {all:?}");
    }
    // Word for word, an increment that is not transmitted repeats without end.
    let mut controller =
        in_first_cycle(ControllerConfig { unselected: Unselected::Hold, ..Default::default() });
    controller.handle_input(CYCLE + 12 * MS, b"\x10\x10\x02\x00\x01\x50\x00\x10\x03\x51");
    let mut out = [0; Frame::MAX_LEN];
    for cycle in 2..5 {
        controller.poll_transmit(CYCLE * cycle, &mut out).unwrap();
        controller.handle_input(CYCLE * cycle + 12 * MS, b"\x10\x10\x02\x00\x00\x10\x03\x00");
        assert_eq!(controller.values(), x(80));
    }
}

/// 36 bytes leave 9.25 ms of a cycle at 19200 baud: 17 bytes.
#[test]
fn at_19200_baud_in_mode_23_an_axis_waits_until_its_word_fits() {
    let (host, controller) = plain();
    let mut cell =
        running(HostConfig { baud: 19_200, ..host }, ControllerConfig { baud: 19_200, ..controller });
    cell.host.set_target(cell.now, [5, 0, 6, 7, 8, 9]);
    cell.cycles(100);
    assert_eq!(cell.host.values(), [5, 0, 6, 7, 0, 0], "three words, and a millisecond is left");
    assert_eq!(cell.controller.values(), cell.host.values());
    cell.host.set_target(cell.now, [5, 0, 0, 7, 8, 9]);
    cell.cycles(1);
    assert_eq!(
        cell.host.values(),
        [5, 0, 0, 7, 0, 0],
        "the word of an axis that came to rest is sent once more"
    );
    cell.cycles(1);
    assert_eq!(cell.host.values(), [5, 0, 0, 7, 8, 0]);
    cell.cycles(100);
    let statistics = cell.host.statistics();
    assert_eq!(
        (statistics.missed, statistics.rejected, cell.controller.state()),
        (0, 0, ControllerState::Running)
    );
    assert!(statistics.held > 190, "{statistics:?}");
}

#[test]
fn when_an_input_is_old_speeds_go_to_zero_and_an_offset_stays() {
    for (mode, rest) in [(Mode::CUMULATIVE_23, 0), (Mode::NON_CUMULATIVE_22, 80)] {
        let (host, controller) = plain();
        let host = HostConfig { mode, target_timeout: 5 * CYCLE, ..host };
        let mut cell = running(host, ControllerConfig { mode, ..controller });
        cell.host.set_target(cell.now, x(80));
        cell.cycles(4);
        assert_eq!(cell.controller.values(), x(80));
        cell.cycles(3);
        assert_eq!(cell.controller.values(), x(rest));
        assert!(cell.host_events.contains(&HostEvent::TargetStale));
        cell.host.set_target(cell.now, x(60));
        cell.cycles(2);
        assert_eq!(cell.controller.values(), x(60));
        cell.host.clear_target(cell.now);
        cell.cycles(2);
        assert_eq!(cell.controller.values(), x(if rest == 0 { 0 } else { 60 }));
    }
}

#[test]
fn a_short_subroutine_is_in_one_message_too() {
    let (host, controller) = plain();
    let mut cell =
        running(HostConfig { subroutine: true, ..host }, ControllerConfig { subroutine: true, ..controller });
    cell.host.exception(cell.now, Exception::CloseGripper).unwrap();
    while cell.controller.state() != ControllerState::Interrupted {
        cell.run(cell.now + MS);
    }
    cell.controller.resume(cell.now).unwrap();
    assert_eq!(cell.controller.resume(cell.now), Err(SessionError::NotRunning), "it has returned");
    cell.host_events.clear();
    cell.cycles(3);
    let phases: Vec<_> = cell
        .host_events
        .iter()
        .filter_map(|event| match event {
            HostEvent::Motion(motion) => Some(motion.phase),
            _ => None,
        })
        .collect();
    assert_eq!(phases, [MotionPhase::Interrupted, MotionPhase::Running, MotionPhase::Running]);
    assert!(cell.host_events.contains(&HostEvent::Exception {
        exception: Exception::CloseGripper,
        outcome: ExceptionOutcome::Done
    }));
}

#[test]
fn words_are_zero_at_first_in_every_start() {
    let config = ControllerConfig { unselected: Unselected::Hold, ..Default::default() };
    let mut controller = in_first_cycle(config);
    let mut out = [0; Frame::MAX_LEN];
    controller.handle_input(CYCLE + 12 * MS, b"\x10\x10\x02\x00\x01\x50\x00\x10\x03\x51");
    assert_eq!(controller.values(), x(80));
    controller.finish(CYCLE * 2).unwrap();
    controller.poll_transmit(CYCLE * 2, &mut out).unwrap();
    controller.start(CYCLE * 3).unwrap();
    assert_eq!(controller.values(), [0; 6]);
    controller.poll_transmit(CYCLE * 3, &mut out).unwrap();
    controller.handle_input(CYCLE * 3 + 5 * MS, b"\x10\x10\x02\x00\x10\x03\x00");
    controller.poll_transmit(CYCLE * 4, &mut out).unwrap();
    controller.handle_input(CYCLE * 4 + 12 * MS, b"\x10\x10\x02\x00\x00\x10\x03\x00");
    assert_eq!((controller.values(), controller.statistics().replies), ([0; 6], 2));
}

#[test]
fn a_new_start_begins_on_the_path_at_rest_and_without_a_target() {
    let limits = Limits { velocity: [50; 6], acceleration: [20; 6] };
    for mode in [Mode::NON_CUMULATIVE_22, Mode::CUMULATIVE_23] {
        let (host, controller) = plain();
        let mut cell = running(HostConfig { limits, ..host }, ControllerConfig { mode, ..controller });
        cell.host.set_target(cell.now, x(50));
        cell.cycles(6);
        assert_eq!(cell.host.values(), x(50));
        cell.controller.finish(cell.now).unwrap();
        cell.cycles(2);
        let offset = cell.offset();
        cell.start();
        cell.cycles(4);
        assert_eq!((cell.host.state(), cell.host.values()), (HostState::Running, [0; 6]), "{mode:?}");
        let stays = if mode == Mode::CUMULATIVE_23 { offset } else { [0; 6] };
        assert_eq!(cell.offset(), stays, "{mode:?}");
        cell.host.set_target(cell.now, x(50));
        cell.cycles(1);
        assert_eq!(cell.host.values(), x(20), "{mode:?}");
    }
}

#[test]
fn an_exception_starts_the_subroutine_once() {
    let (host, controller) = plain();
    let host = HostConfig { subroutine: true, ..host };
    let mut cell = running(host, ControllerConfig { subroutine: true, ..controller });
    cell.host.set_target(cell.now, x(10));
    cell.host.exception(cell.now, Exception::CloseGripper).unwrap();
    let pending = SessionError::ExceptionPending { pending: 253 };
    assert_eq!(cell.host.exception(cell.now, Exception::OpenGripper), Err(pending));
    cell.cycles(4);
    let exceptions: Vec<_> =
        cell.controller_events.iter().filter(|e| matches!(e, ControllerEvent::Exception(_))).collect();
    assert_eq!(exceptions, [&ControllerEvent::Exception(Exception::CloseGripper)]);
    assert_eq!(cell.controller.state(), ControllerState::Interrupted);
    assert_eq!(
        (cell.host.state(), cell.last_motion().phase),
        (HostState::Interrupted, MotionPhase::Interrupted)
    );
    assert_eq!(cell.host.exception(cell.now, Exception::OpenGripper), Err(SessionError::NotRunning));
    assert_eq!(cell.host.values(), [0; 6]);
    let offset = cell.offset();
    cell.cycles(4);
    assert_eq!(cell.offset(), offset, "the arm is at rest while the subroutine runs");
    cell.controller.resume(cell.now).unwrap();
    cell.cycles(3);
    assert_eq!((cell.host.state(), cell.host.values()), (HostState::Running, x(10)));
    assert_ne!(cell.offset(), offset);
}

#[test]
fn without_a_subroutine_an_exception_is_refused_here_and_aborts_there() {
    let (host, controller) = plain();
    let mut cell = running(host, controller);
    assert_eq!(cell.host.exception(cell.now, Exception::CloseGripper), Err(SessionError::NoSubroutine));
    // A host that is wrong about it.
    cell.host.set_subroutine(cell.now, true);
    cell.host.exception(cell.now, Exception::Other(5)).unwrap();
    cell.cycles(3);
    let end = [ControllerEvent::Aborted(Exception::Other(5)), ControllerEvent::Ended(ErrorCode::None)];
    assert_eq!(cell.controller_events[cell.controller_events.len() - 2..], end);
    assert!(cell.host_events.contains(&HostEvent::End(End { error: ErrorCode::None })));
}

const GOOD: &[u8] = b"\x10\x10\x02\x80\x02\x01\x00\x00\x20\x10\x03\xA3";
const REJECTED: &[u8] = b"\x10\x10\x02\x81\x02\x01\x00\x00\x20\x10\x03\xA4";
const TIMEOUT: &[u8] = b"\x10\x10\x02\x86\x02\x01\x00\x00\x20\x10\x03\xA9";
const INTERRUPTED: &[u8] = b"\x10\x10\x02\xC0\x02\x01\x00\x00\x20\x10\x03\xE3";

#[test]
fn whatever_the_controller_says_no_value_is_above_the_limits() {
    const START: &[u8] = b"\x10\x10\x02\xA0\x17\x10\x03\xB7";
    const END: &[u8] = b"\x10\x10\x02\xE0\x10\x03\xE0";
    let messages = [START, END, GOOD, GOOD, GOOD, REJECTED, TIMEOUT, INTERRUPTED];
    let (limits, mut rng, mut out) = (HostConfig::default().limits, Rng::new(7), [0; Frame::MAX_LEN]);
    let mut host = connected(HostConfig::default());
    let (mut now, mut target, mut before, mut fastest) = (MS, [0; 6], [0_i16; 6], 0);
    for _ in 0..20_000 {
        now += if rng.chance(0.01) { [MS, 5 * CYCLE][rng.below(2)] } else { CYCLE };
        if rng.chance(0.05) {
            target = [[50; 6], [-2000; 6], [i16::MAX; 6]][rng.below(3)];
        }
        host.set_target(now, target);
        if rng.chance(0.01) {
            host.set_policy(now, Policy::Accept);
        } else if rng.chance(0.005) {
            host.stop(now);
        }
        let message = messages[if rng.chance(0.95) { 2 } else { rng.below(messages.len()) }];
        host.handle_input(now, if rng.chance(0.99) { message } else { &message[1..] });
        if host.poll_transmit(now, &mut out).is_none() {
            continue;
        }
        let values = host.values();
        for (axis, (value, before)) in values.iter().zip(before).enumerate() {
            let (speed, change) = (value.abs(), value.abs() - before.abs());
            assert!(speed.unsigned_abs() <= limits.velocity[axis], "{values:?}");
            assert!(i32::from(change) <= i32::from(limits.acceleration[axis]), "{before} then {values:?}");
        }
        (before, fastest) = (values, fastest.max(values[0]));
    }
    assert_eq!(fastest.unsigned_abs(), limits.velocity[0], "the velocity is reached");
}

/// Returns the host's answer.
fn answer(host: &mut Host, message: &[u8]) -> HostMessage {
    let mut out = [0; Frame::MAX_LEN];
    host.handle_input(MS, message);
    let len = host.poll_transmit(MS, &mut out).unwrap();
    let (frame, _) = Frame::decode(&out[..len], Framing::DEFAULT).unwrap().unwrap();
    HostMessage::decode(frame.data(), Framing::DEFAULT).unwrap()
}

/// Returns a host in an ALTER with an exception to be sent.
fn with_exception() -> Host {
    let mut host = connected(HostConfig { subroutine: true, limits: Limits::NONE, ..HostConfig::default() });
    let accepted = answer(&mut host, b"\x10\x10\x02\xA0\x17\x10\x03\xB7");
    assert_eq!(accepted, HostMessage::StartReply(StartCode::Accept));
    assert_eq!(host.exception(MS, Exception::OpenGripper), Err(SessionError::NotRunning));
    answer(&mut host, GOOD);
    host.exception(MS, Exception::OpenGripper).unwrap();
    host
}

/// Returns the codes in the answers to these messages.
fn codes<const N: usize>(host: &mut Host, messages: [&[u8]; N]) -> [u8; N] {
    messages.map(|message| match answer(host, message) {
        HostMessage::Reply(reply) => reply.exception.into(),
        HostMessage::StartReply(code) => panic!("{code:?}"),
    })
}

fn outcomes(host: &mut Host) -> Vec<ExceptionOutcome> {
    let outcome = |event| match event {
        HostEvent::Exception { exception: Exception::OpenGripper, outcome } => Some(outcome),
        _ => None,
    };
    core::iter::from_fn(|| host.poll_event()).filter_map(outcome).collect()
}

#[test]
fn an_exception_that_was_not_read_is_sent_again() {
    for unread in [REJECTED, TIMEOUT] {
        let mut host = with_exception();
        let messages = [GOOD, unread, unread, REJECTED, GOOD, GOOD, REJECTED];
        assert_eq!(codes(&mut host, messages), [254, 0, 254, 0, 254, 0, 0]);
        assert_eq!(host.statistics().rejected, 4);
        assert_eq!(outcomes(&mut host), [ExceptionOutcome::Done]);
    }
}

/// After two messages of the controller, late bytes are no longer on the line.
#[test]
fn an_exception_that_was_not_read_may_be_late() {
    for unread in [REJECTED, TIMEOUT] {
        let mut host = with_exception();
        assert_eq!(codes(&mut host, [GOOD, unread]), [254, 0]);
        let pending = SessionError::ExceptionPending { pending: 254 };
        assert_eq!(host.exception(MS, Exception::CloseGripper), Err(pending));
        assert_eq!(codes(&mut host, [INTERRUPTED, GOOD]), [0, 0]);
        assert_eq!(outcomes(&mut host), [ExceptionOutcome::Unknown(UnknownReason::Unclear)]);
    }
}

#[test]
fn a_stop_reports_an_exception_as_not_done_when_it_can_no_longer_come() {
    let mut host = with_exception();
    assert_eq!(codes(&mut host, [GOOD]), [254]);
    host.stop(MS);
    assert_eq!(codes(&mut host, [REJECTED]), [0]);
    assert_eq!(outcomes(&mut host), []);
    host.handle_input(MS, GOOD);
    assert_eq!(outcomes(&mut host), [ExceptionOutcome::NotDone]);
}

#[test]
fn between_an_exception_and_its_outcome_no_message_is_missing() {
    for corrupt in [b"\x10\x10\x02\x80\x10\x03\xFF".as_slice(), b"\x10\x04"] {
        let mut host = with_exception();
        assert_eq!(codes(&mut host, [GOOD, REJECTED]), [254, 0]);
        host.handle_input(MS, corrupt);
        assert_eq!(codes(&mut host, [GOOD]), [0]);
        assert_eq!(outcomes(&mut host), [ExceptionOutcome::Unknown(UnknownReason::OutOfSequence)]);
    }
}

#[test]
fn an_offset_is_held_while_the_subroutine_runs() {
    let limits = Limits { velocity: [50; 6], acceleration: [20; 6] };
    let (host, controller) = plain();
    let controller = ControllerConfig { mode: Mode::NON_CUMULATIVE_22, subroutine: true, ..controller };
    let mut cell = running(HostConfig { limits, subroutine: true, ..host }, controller);
    cell.host.set_target(cell.now, x(300));
    cell.cycles(8);
    cell.host.exception(cell.now, Exception::CloseGripper).unwrap();
    cell.cycles(8);
    assert_eq!((cell.host.state(), cell.host.values()), (HostState::Interrupted, x(300)));
    assert_eq!(cell.controller.values(), x(300));
}

/// The controller stops the arm for the subroutine, so the host's last values are not a speed from which it may go
/// on.
#[test]
fn after_the_subroutine_the_arm_begins_from_rest() {
    let limits = Limits { velocity: [50; 6], acceleration: [20; 6] };
    let (host, controller) = plain();
    let controller = ControllerConfig { subroutine: true, ..controller };
    let mut cell = running(HostConfig { limits, subroutine: true, ..host }, controller);
    cell.host.set_target(cell.now, x(50));
    cell.cycles(6);
    cell.host.exception(cell.now, Exception::CloseGripper).unwrap();
    while cell.controller.state() != ControllerState::Interrupted {
        cell.run(cell.now + MS);
    }
    assert_eq!(cell.host.values(), x(50));
    cell.cycles(1);
    cell.applied.clear();
    cell.controller.resume(cell.now).unwrap();
    cell.cycles(6);
    let values: Vec<_> = cell.applied.iter().map(|values| values[0]).skip_while(|x| *x == 0).collect();
    assert!(values.starts_with(&[20, 40, 50]), "{values:?}");
}

#[test]
fn without_mode_bit_4_only_the_exception_counts() {
    let (host, controller) = plain();
    let controller = ControllerConfig { mode: Mode(7), subroutine: true, ..controller };
    let mut cell = running(HostConfig { subroutine: true, ..host }, controller);
    let offset = cell.offset();
    cell.host.set_target(cell.now, x(80));
    cell.cycles(4);
    assert_eq!(cell.offset(), offset);
    cell.host.exception(cell.now, Exception::CloseGripper).unwrap();
    cell.cycles(2);
    assert_eq!(cell.controller.state(), ControllerState::Interrupted);
}
