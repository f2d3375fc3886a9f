//! What the replies do to the arm: increments, offsets, limits, exceptions.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

mod common;

use common::{CYCLE, MS, in_first_cycle, plain, running, x};
use val2_alter::{
    ControllerConfig, ControllerEvent, ControllerState, End, ErrorCode, Exception, Frame, Framing, Host,
    HostConfig, HostEvent, HostMessage, HostState, Limits, Message, Mode, MotionPhase, Policy, Select,
    SessionError, StartCode, Unselected,
};

#[test]
fn an_increment_moves_the_arm_by_its_value_in_each_cycle() {
    let (host, controller) = plain();
    let mut cell = running(host, controller);
    let x_before = cell.controller.pose().p[0];
    cell.host.set_target(x(80));
    cell.cycles(10);
    // Mode 23 is tool coordinates, and the tool's x axis is the world's: ten times 2.5 mm.
    assert_eq!(cell.controller.pose().p[0] - x_before, 25.0);
    // The message that was heard last left before the tenth reply.
    let transform = cell.last_motion().transform.unwrap();
    assert_eq!(f64::from(transform.0[9]), (x_before + 22.5) * 32.0);
}

#[test]
fn letting_go_of_the_ball_never_exceeds_the_acceleration() {
    let limits = Limits { velocity: [60; 6], acceleration: [7; 6] };
    let (host, controller) = plain();
    let mut cell = running(HostConfig { limits, ..host }, controller);
    for target in [x(127), [-127, 127, 0, 50, -3, 9], [0; 6], [i16::MAX; 6], [i16::MIN; 6], [0; 6]] {
        cell.host.set_target(target);
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
    cell.host.set_target(x(50));
    cell.cycles(4);
    cell.applied.clear();
    cell.host.stop();
    assert_eq!((cell.host.state(), cell.host.policy()), (HostState::Stopping, Policy::Ignore));
    cell.host.set_target(x(50)); // has no effect any more
    cell.cycles(8);
    let values: Vec<_> = cell.applied.iter().map(|values| values[0]).collect();
    assert_eq!(values, [30, 10, 0]);
    assert!(cell.host_events.contains(&HostEvent::Stopped));
    assert_eq!(cell.controller_events.last(), Some(&ControllerEvent::Ended(ErrorCode::Timeout)));
    assert_eq!((cell.host.state(), cell.host.stats().missed), (HostState::Idle, 0));

    cell.start();
    cell.cycles(5);
    assert_eq!(cell.controller.state(), ControllerState::Off, "a stopped host does not answer");
    cell.host.set_policy(Policy::Accept);
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
    cell.host.set_target(x(200));
    cell.cycles(9);
    let values: Vec<_> = cell.applied.iter().map(|values| values[0]).collect();
    assert_eq!(values, [20, 60, 110, 160, 190, 200, 200, 200, 200]);
    assert_eq!(cell.controller.pose().p[0], 400.0 + 200.0 / 32.0);
    cell.applied.clear();
    cell.host.stop();
    cell.cycles(12);
    let values: Vec<_> = cell.applied.iter().map(|values| values[0]).collect();
    assert_eq!(values, [180, 140, 90, 40, 10, 0, 0]);
    assert_eq!(cell.controller.pose().p[0], 400.0);
    assert_eq!(cell.controller.state(), ControllerState::Off);
}

#[test]
fn after_a_cycle_in_which_it_stood_the_arm_begins_again_from_rest() {
    let limits = Limits { velocity: [50; 6], acceleration: [20; 6] };
    let mut host = Host::new(HostConfig { limits, ..HostConfig::default() });
    let mut out = [0; Frame::MAX_LEN];
    host.handle_input(MS, b"\x10\x10\x02\xA0\x17\x10\x03\xB7");
    host.poll_transmit(MS, &mut out).unwrap();
    host.set_target(x(50));
    let mut values = Vec::new();
    let mut now = MS;
    for (error, late) in [(0, 0), (0, 0), (0, 0), (1, 0), (0, 0), (0, 12), (0, 0), (0, 0)] {
        let frame = [0x10, 0x10, 0x02, 0x80 | error, 2, 1, 0, 0, 32, 0x10, 0x03, 0xA3 + error];
        now += CYCLE;
        host.handle_input(now, &frame);
        values.push(host.poll_transmit(now + MS * late, &mut out).map_or(0, |_| host.values()[0]));
    }
    assert_eq!(values, [20, 40, 50, 20, 40, 0, 20, 40]);
}

#[test]
fn values_that_are_not_transmitted_are_what_both_ends_agree_on() {
    for mode in [22, 23] {
        for unselected in [Unselected::ByMode, Unselected::Hold, Unselected::Zero] {
            let mut poses = Vec::new();
            for select in [Select::All, Select::Needed] {
                let (host, controller) = plain();
                let host = HostConfig { select, unselected, baud: 19_200, ..host };
                let controller =
                    ControllerConfig { mode: Mode(mode & !4), baud: 19_200, unselected, ..controller };
                let mut cell = running(host, controller);
                for target in [x(5), x(5), [1, 2, 3, 4, 5, 6], [0, 0, 3, 0, 5, 0], [0; 6], x(-9)] {
                    cell.host.set_target(target);
                    cell.cycles(2);
                }
                assert_eq!(cell.host.stats().missed, 0);
                poses.push((cell.controller.pose(), cell.applied));
            }
            assert_eq!(poses[0], poses[1], "mode {mode}, {unselected:?}");
        }
    }
    // Word for word, an increment that is not transmitted repeats for ever.
    let mut controller =
        in_first_cycle(ControllerConfig { unselected: Unselected::Hold, ..Default::default() });
    controller.handle_input(CYCLE + MS, b"\x10\x10\x02\x00\x01\x50\x00\x10\x03\x51");
    let mut out = [0; Frame::MAX_LEN];
    for cycle in 2..5 {
        controller.poll_transmit(CYCLE * cycle, &mut out).unwrap();
        controller.handle_input(CYCLE * cycle + MS, b"\x10\x10\x02\x00\x00\x10\x03\x00");
    }
    assert_eq!(controller.pose().p[0], 400.0 + 4.0 * 2.5);
}

#[test]
fn after_a_rejected_reply_all_six_values_are_sent() {
    let config = HostConfig {
        select: Select::Needed,
        unselected: Unselected::Hold,
        limits: Limits::NONE,
        ..HostConfig::default()
    };
    let mut host = Host::new(config);
    let mut out = [0; Frame::MAX_LEN];
    host.handle_input(MS, b"\x10\x10\x02\xA0\x17\x10\x03\xB7");
    host.poll_transmit(MS, &mut out).unwrap();
    host.set_target(x(80));
    let mut lengths = Vec::new();
    for error in [0, 0, 1, 0] {
        let frame = [0x10, 0x10, 0x02, 0x80 | error, 2, 1, 0, 0, 32, 0x10, 0x03, 0xA3 + error];
        host.handle_input(MS, &frame);
        lengths.push(host.poll_transmit(MS, &mut out).unwrap());
    }
    assert_eq!(lengths, [10, 8, 20, 8]);
}

/// Nobody knows whether a controller keeps the words of a reply while its subroutine runs; the one here does not.
#[test]
fn after_an_interruption_all_six_values_are_sent() {
    for (mode, at_rest) in [(Mode(19), [0; 6]), (Mode(18), [7, 5, 0, 0, 0, 0])] {
        let (host, controller) = plain();
        let unselected = Unselected::Hold;
        let host = HostConfig { select: Select::Needed, unselected, subroutine: true, ..host };
        let mut cell = running(host, ControllerConfig { mode, unselected, subroutine: true, ..controller });
        cell.host.set_target([7, 5, 0, 0, 0, 0]);
        cell.cycles(3);
        cell.host.exception(Exception::CloseGripper).unwrap();
        cell.cycles(4);
        assert_eq!((cell.controller.state(), cell.host.values()), (ControllerState::Interrupted, at_rest));
        cell.host.set_target([9, 0, 0, 0, 0, 0]);
        cell.controller.resume();
        cell.cycles(3);
        assert_eq!(cell.host.values(), [9, 0, 0, 0, 0, 0], "{mode:?}");
        assert_eq!(cell.controller.values(), cell.host.values(), "{mode:?}: the second axis still moves");
    }
}

#[test]
fn words_are_zero_at_first_in_every_start() {
    let config = ControllerConfig { unselected: Unselected::Hold, ..Default::default() };
    let mut controller = in_first_cycle(config);
    let mut out = [0; Frame::MAX_LEN];
    controller.handle_input(CYCLE + MS, b"\x10\x10\x02\x00\x01\x50\x00\x10\x03\x51");
    assert_eq!(controller.values(), x(80));
    controller.finish();
    controller.poll_transmit(CYCLE * 2, &mut out).unwrap();
    controller.start(CYCLE * 3).unwrap();
    assert_eq!(controller.values(), [0; 6]);
    controller.poll_transmit(CYCLE * 3, &mut out).unwrap();
    controller.handle_input(CYCLE * 3 + MS, b"\x10\x10\x02\x00\x10\x03\x00");
    controller.poll_transmit(CYCLE * 4, &mut out).unwrap();
    controller.handle_input(CYCLE * 4 + MS, b"\x10\x10\x02\x00\x00\x10\x03\x00");
    assert_eq!((controller.values(), controller.stats().replies), ([0; 6], 2));
}

#[test]
fn a_new_start_begins_on_the_path_at_rest_and_without_a_target() {
    let limits = Limits { velocity: [50; 6], acceleration: [20; 6] };
    for mode in [Mode::NON_CUMULATIVE_22, Mode::CUMULATIVE_23] {
        let (host, controller) = plain();
        let mut cell = running(HostConfig { limits, ..host }, ControllerConfig { mode, ..controller });
        cell.host.set_target(x(50));
        cell.cycles(6);
        assert_eq!(cell.host.values(), x(50));
        cell.controller.finish();
        cell.cycles(2);
        let pose = cell.controller.pose();
        cell.start();
        cell.cycles(4);
        assert_eq!((cell.host.state(), cell.host.values()), (HostState::Running, [0; 6]), "{mode:?}");
        assert_eq!(cell.controller.pose(), pose, "{mode:?}");
        cell.host.set_target(x(50));
        cell.cycles(1);
        assert_eq!(cell.host.values(), x(20), "{mode:?}");
    }
}

#[test]
fn an_exception_starts_the_subroutine_once() {
    let (host, controller) = plain();
    let host = HostConfig { subroutine: true, ..host };
    let mut cell = running(host, ControllerConfig { subroutine: true, ..controller });
    cell.host.set_target(x(10));
    cell.host.exception(Exception::CloseGripper).unwrap();
    let pending = SessionError::ExceptionPending { pending: 253 };
    assert_eq!(cell.host.exception(Exception::OpenGripper), Err(pending));
    cell.cycles(4);
    let exceptions: Vec<_> =
        cell.controller_events.iter().filter(|e| matches!(e, ControllerEvent::Exception(_))).collect();
    assert_eq!(exceptions, [&ControllerEvent::Exception(Exception::CloseGripper)]);
    assert_eq!(cell.controller.state(), ControllerState::Interrupted);
    assert_eq!(
        (cell.host.state(), cell.last_motion().phase),
        (HostState::Interrupted, MotionPhase::Interrupted)
    );
    assert_eq!(cell.host.exception(Exception::OpenGripper), Err(SessionError::NotRunning));
    assert_eq!(cell.host.values(), [0; 6]);
    let pose = cell.controller.pose();
    cell.cycles(4);
    assert_eq!(cell.controller.pose(), pose, "the arm stands while the subroutine runs");
    cell.controller.resume();
    cell.cycles(3);
    assert_eq!((cell.host.state(), cell.host.values()), (HostState::Running, x(10)));
    assert_ne!(cell.controller.pose(), pose);
}

#[test]
fn without_a_subroutine_an_exception_is_refused_here_and_aborts_there() {
    let (host, controller) = plain();
    let mut cell = running(host, controller);
    assert_eq!(cell.host.exception(Exception::CloseGripper), Err(SessionError::NoSubroutine));
    // A host that is wrong about it.
    cell.host.set_subroutine(true);
    cell.host.exception(Exception::Other(5)).unwrap();
    cell.cycles(3);
    let end = [ControllerEvent::Aborted(Exception::Other(5)), ControllerEvent::Ended(ErrorCode::None)];
    assert_eq!(cell.controller_events[cell.controller_events.len() - 2..], end);
    assert!(cell.host_events.contains(&HostEvent::End(End { error: ErrorCode::None })));
}

#[test]
fn an_exception_that_was_not_read_is_sent_again() {
    let mut host = Host::new(HostConfig { subroutine: true, limits: Limits::NONE, ..HostConfig::default() });
    let mut out = [0; Frame::MAX_LEN];
    let mut turn = |host: &mut Host, bytes: &[u8]| {
        host.handle_input(MS, bytes);
        let len = host.poll_transmit(MS, &mut out).unwrap();
        let (frame, _) = Frame::decode(&out[..len], Framing::DEFAULT).unwrap().unwrap();
        HostMessage::decode(frame.data(), Framing::DEFAULT).unwrap()
    };
    let good = b"\x10\x10\x02\x80\x02\x01\x00\x00\x20\x10\x03\xA3";
    let rejected = b"\x10\x10\x02\x81\x02\x01\x00\x00\x20\x10\x03\xA4";
    assert_eq!(
        turn(&mut host, b"\x10\x10\x02\xA0\x17\x10\x03\xB7"),
        HostMessage::StartReply(StartCode::Accept)
    );
    host.exception(Exception::OpenGripper).unwrap();
    let mut exceptions = Vec::new();
    for bytes in [good, rejected, rejected, good, rejected] {
        let HostMessage::Reply(reply) = turn(&mut host, bytes) else { panic!() };
        exceptions.push(u8::from(reply.exception));
    }
    assert_eq!(exceptions, [254, 254, 254, 0, 0]);
    assert_eq!(host.stats().rejected, 3);
}

#[test]
fn an_offset_is_held_while_the_subroutine_runs() {
    let limits = Limits { velocity: [50; 6], acceleration: [20; 6] };
    let (host, controller) = plain();
    let controller = ControllerConfig { mode: Mode::NON_CUMULATIVE_22, subroutine: true, ..controller };
    let mut cell = running(HostConfig { limits, subroutine: true, ..host }, controller);
    cell.host.set_target(x(300));
    cell.cycles(8);
    cell.host.exception(Exception::CloseGripper).unwrap();
    cell.cycles(8);
    assert_eq!((cell.host.state(), cell.host.values()), (HostState::Interrupted, x(300)));
    assert_eq!(cell.controller.values(), x(300));
}

#[test]
fn without_mode_bit_4_only_the_exception_counts() {
    let (host, controller) = plain();
    let controller = ControllerConfig { mode: Mode(7), subroutine: true, ..controller };
    let mut cell = running(HostConfig { subroutine: true, ..host }, controller);
    let pose = cell.controller.pose();
    cell.host.set_target(x(80));
    cell.cycles(4);
    assert_eq!(cell.controller.pose(), pose);
    cell.host.exception(Exception::CloseGripper).unwrap();
    cell.cycles(2);
    assert_eq!(cell.controller.state(), ControllerState::Interrupted);
}
