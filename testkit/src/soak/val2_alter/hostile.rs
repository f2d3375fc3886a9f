//! Ends that keep no rule.

use core::time::Duration;
use robot_session::Session as _;
use val2_alter::{
    Controller, ControllerConfig, ControllerEvent, End as EndMessage, ErrorCode, Exception, Frame, Framing,
    Host, HostConfig, HostEvent, HostMessage, List, Message, Mode, Motion, MotionPhase, Policy, Reply,
    RobotMessage, SegmentStatus, Start, StartCode, Transform, timing,
};

use super::MS;
use crate::soak::{Log, Tally};
use robot_session::contract::Rng;

/// A random walk over the protocol's messages, and over any bytes, instead of the other end: everything that was asked for has one
/// outcome, and whatever the controller says, no value is above the limits, nor farther from the one before.
pub(super) fn session(seed: u64, log: Log) -> Tally {
    let rng = &mut Rng::new(!seed);
    let (mut now, mut tally) = (Duration::ZERO, Tally::default());
    let limits = HostConfig::default().limits;
    let mut host = Host::new(HostConfig { subroutine: true, ..HostConfig::default() }).expect("it can work");
    let mut before = [0; 6];
    let config = ControllerConfig { subroutine: true, ..ControllerConfig::default() };
    let mut controller = Controller::new(config).expect("it can work");
    let (mut asked, mut answered, mut started, mut ended) = (0, 0, 0, 0);
    let mut out = [0; Frame::MAX_LEN];
    host.handle_connected(now);
    controller.handle_connected(now);
    for _ in 0..200 {
        now += match rng.below(8) {
            0 => rng.log_uniform(MS, Duration::from_secs(5)),
            1..4 => Duration::ZERO,
            _ => timing::CYCLE,
        };
        let error = ErrorCode::from(rng.below(8) as u8);
        let message = match rng.below(8) {
            0 => RobotMessage::Start(Start { error, ..Start::new(Mode::CUMULATIVE_23, List::EMPTY) }),
            1 => RobotMessage::End(EndMessage { error }),
            other => RobotMessage::Motion(Motion {
                phase: if other == 2 { MotionPhase::Interrupted } else { MotionPhase::Running },
                error: if other < 5 { error } else { ErrorCode::None },
                segment_status: SegmentStatus::from(rng.below(256) as u8),
                segment: rng.below(65_536) as u16,
                percent: rng.below(65_536) as u16,
                transform: rng.chance(0.8).then_some(Transform([0; 12])),
            }),
        };
        let len = message.encode(Framing::DEFAULT, &mut out).unwrap_or_default();
        let len = mangle(rng, &mut out, len);
        host.handle_input(now, &out[..len]);
        host.set_target(now, [[50; 6], [-2000; 6], [i16::MAX; 6]][rng.below(3)]);
        asked += u64::from(rng.chance(0.3) && host.exception(now, Exception::CloseGripper).is_ok());
        if rng.chance(0.02) {
            host.stop(now);
        }
        if rng.chance(0.05) {
            host.set_policy(now, Policy::Accept);
        }
        host.handle_timeout(now);
        while host.poll_transmit(now, &mut out).is_some() {
            let values = host.values();
            for ((value, before), (v, a)) in
                values.iter().zip(before).zip(limits.velocity.iter().zip(limits.acceleration))
            {
                let steps = (i32::from(*value).abs() - i32::from(before).abs()).max(0);
                if value.unsigned_abs() > *v || steps > a.into() {
                    log.line(now, format_args!("!!! {before} then {value}"));
                    tally.invented += 1;
                }
            }
            before = values;
        }
        while let Some(event) = host.poll_event() {
            answered += u64::from(matches!(event, HostEvent::Exception { .. }));
        }

        let message = match rng.below(6) {
            0 => HostMessage::StartReply(StartCode::Accept),
            1 => HostMessage::StartReply([StartCode::Repeat, StartCode::Refuse][rng.below(2)]),
            2 => HostMessage::Reply(Reply { exception: Exception::OpenGripper, ..Reply::NOTHING }),
            _ => HostMessage::Reply(Reply::all([7; 6])),
        };
        started += u64::from(controller.start(now).is_ok());
        controller.handle_timeout(now);
        while controller.poll_transmit(now, &mut out).is_some() {}
        let len = message.encode(Framing::DEFAULT, &mut out).unwrap_or_default();
        let len = mangle(rng, &mut out, len);
        controller.handle_input(now, &out[..len]);
        if rng.chance(0.1) {
            let _ = controller.resume(now);
        }
        while let Some(event) = controller.poll_event() {
            use ControllerEvent::{Ended, GaveUp, Refused};
            ended += u64::from(matches!(event, Ended(_) | GaveUp | Refused));
        }
    }
    host.handle_disconnected(now);
    controller.handle_disconnected(now);
    while let Some(event) = host.poll_event() {
        answered += u64::from(matches!(event, HostEvent::Exception { .. }));
    }
    while let Some(event) = controller.poll_event() {
        ended += u64::from(matches!(event, ControllerEvent::Ended(_)));
    }
    // One outcome for each request.
    log.line(now, format_args!("{asked} exceptions, {answered} outcomes; {started} starts, {ended} ends"));
    for (requests, outcomes) in [(asked, answered), (started, ended)] {
        tally.jobs += requests;
        tally.lost += requests.saturating_sub(outcomes);
        tally.repeated += outcomes.saturating_sub(requests);
        tally.unknown += requests.min(outcomes);
    }
    tally.invented += host.statistics().unexpected + controller.statistics().unexpected;
    tally
}

/// Cuts a message, or makes other bytes of it, now and then; its new length.
fn mangle(rng: &mut Rng, out: &mut [u8], len: usize) -> usize {
    match rng.below(16) {
        0 => rng.below(len + 1),
        1 => {
            let len = rng.below(out.len());
            out[..len].fill_with(|| [0x10, 0x02, 0x03, rng.below(256) as u8][rng.below(4)]);
            len
        }
        _ => len,
    }
}
