//! A robot that is not ours and keeps the source's rules: MM-3, MM-18 and MM-20.
//!
//! It answers each command once, when it likes, with what is true of its axes. It refuses what it likes, and anything may stop its axes, anywhere.

use core::time::Duration;

use mmacell_proto::robot_session::Encode as _;
use mmacell_proto::{Command, Dialect, ErrorCode, Line as TextLine, Reply, RobotPose, Status};

use super::{Cell, HOME, LAST, Line, MS};
use crate::Carrier as _;
use crate::link::{Delivery, End};
use mmacell_proto::Order;

#[derive(Default)]
pub(super) struct AnyDevice {
    held: Vec<u8>,
    /// The command that it has not answered, and when it does.
    asked: Option<(Duration, Command<RobotPose>)>,
    /// Where its axes go, and until when.
    motion: Option<(Duration, RobotPose)>,
    pose: Option<RobotPose>,
    pub(super) servo: bool,
    percent: u8,
}

impl AnyDevice {
    pub(super) fn next(&self) -> Option<Duration> {
        [self.asked.map(|(at, _)| at), self.motion.map(|(at, _)| at)].into_iter().flatten().min()
    }

    pub(super) fn is_moving(&self) -> bool {
        self.motion.is_some()
    }

    /// What was asked on the connection before is not answered on the next.
    pub(super) fn reconnect(&mut self) {
        self.held.clear();
        self.asked = None;
    }

    fn pose(&self) -> RobotPose {
        self.pose.unwrap_or(HOME)
    }
}

impl Cell {
    pub(super) fn turn_other_robot(&mut self, other: &mut AnyDevice) {
        let (now, is_calm) = (self.now, self.bad == 0.0);
        if let Some((_, pose)) = other.motion.take_if(|(at, _)| *at <= now) {
            other.pose = Some(pose);
        }
        if !is_calm && other.is_moving() && self.rng.chance(0.02) {
            // Something stops it on its way.
            other.motion = None;
            other.pose = Some(RobotPose::from_units([5_000, 0, 0, 0]));
        }
        if !is_calm && self.rng.chance(0.01) {
            (other.motion, other.servo) = (None, false);
        }
        let mut line = Line { wire: &mut self.wire, cut: self.cut };
        while let Some(delivery) = line.receive(End::B, now, usize::MAX) {
            match delivery {
                Delivery::Bytes(bytes) => other.held.extend(bytes),
                Delivery::Closed => other.reconnect(),
            }
        }
        loop {
            let dialect = Dialect::STRICT;
            let Some((at, command)) = other.asked else {
                let Ok(Some((text, length))) = TextLine::decode(&other.held, &dialect) else { break };
                let command = Command::decode(text, &dialect).expect("TCP corrupts nothing");
                other.held.drain(..length);
                let longest = if is_calm { 2 * MS } else { 2500 * MS };
                other.asked = Some((now + self.rng.log_uniform(MS, longest), command));
                continue;
            };
            if at > now {
                break;
            }
            other.asked = None;
            let reply = self.obey(other, command, is_calm);
            let mut out = [0; 64];
            let length = reply.encode(&mut out).expect("a buffer of a line");
            Line { wire: &mut self.wire, cut: self.cut }.send(End::B, now, &out[..length]);
        }
        self.robot.pose = other.pose();
    }

    fn obey(
        &mut self,
        other: &mut AnyDevice,
        command: Command<RobotPose>,
        is_calm: bool,
    ) -> Reply<RobotPose> {
        let error = ErrorCode::from([1, 2, 77, -1, 32_767][self.rng.below(5)]);
        let can_move = other.servo && other.motion.is_none();
        let is_refused = match command {
            Command::Move { .. } => !can_move,
            Command::Acquire { .. } => true,
            _ => false,
        };
        if is_refused || !is_calm && self.rng.chance(0.1) {
            return Reply::Error { error };
        }
        match command {
            Command::Status => {
                let (moving, pose) = (other.is_moving(), other.pose());
                let (servo, percent, error) = (other.servo, other.percent, ErrorCode::None);
                return Reply::Status(Status { moving, pose, servo, percent, error });
            }
            Command::Move { pose, .. } => {
                other.motion = Some((self.now + MS * self.rng.below(300) as u32, pose));
                if pose != LAST {
                    self.execute(Order::Move { target: pose });
                }
            }
            Command::Override { percent } => {
                other.percent = percent;
                self.execute(Order::Override { percent });
            }
            Command::Stop => other.motion = None,
            Command::Reset => (other.servo, other.motion) = (true, Some((self.now + 50 * MS, HOME))),
            Command::Servo { on } => {
                (other.servo, other.motion) = (on, other.motion.filter(|_| on));
            }
            _ => {}
        }
        Reply::Ok
    }
}
