//! A central controller that is not ours and keeps the source's rules: MM-3, MM-4 and MM-13.
//!
//! It sends a command of §4 when the one before is answered, when it likes, and begins a new connection when it likes. What the device answers
//! is what becomes of the command.

use core::time::Duration;

use mmacell_proto::robot_session::Encode as _;
use mmacell_proto::{Command, Dialect, Line as TextLine, Mode, Order, Reply, RobotPose};

use super::{Cell, Line, MS, S};
use crate::Carrier as _;
use crate::link::{Delivery, End};
use crate::soak::Reported;

#[derive(Default)]
pub(super) struct AnyCentral {
    held: Vec<u8>,
    /// The command that is not answered, and when it gives up.
    open: Option<(Duration, Command<RobotPose>)>,
    /// When it sends the next one.
    next: Duration,
}

impl AnyCentral {
    pub(super) fn next(&self) -> Option<Duration> {
        Some(self.open.map_or(self.next, |(at, _)| at))
    }
}

impl Cell {
    pub(super) fn turn_other_central(&mut self, other: &mut AnyCentral) {
        let now = self.now;
        let mut line = Line { wire: &mut self.wire, cut: self.cut };
        let mut is_lost = false;
        while let Some(delivery) = line.receive(End::A, now, usize::MAX) {
            match delivery {
                // It has closed the connection.
                Delivery::Bytes(_) if self.connects_at.is_some() => {}
                Delivery::Bytes(bytes) => other.held.extend(bytes),
                Delivery::Closed => is_lost = true,
            }
        }
        while let Ok(Some((text, length))) = TextLine::decode(&other.held, &Dialect::STRICT) {
            let reply = Reply::<RobotPose>::decode(text, &Dialect::STRICT);
            let outcome = match (other.open.take().map(|(_, command)| command), reply) {
                (Some(Command::Status), Ok(Reply::Status(_))) => None,
                (Some(Command::Status), Ok(Reply::Ok)) | (None, _) | (_, Err(_)) => {
                    self.log.line(now, format_args!("!!! not one answer for each command: {reply:?}"));
                    self.invented += 1;
                    None
                }
                (_, Ok(Reply::Ok)) => Some(Reported::Done),
                (_, Ok(_)) => Some(Reported::NotDone),
            };
            other.held.drain(..length);
            if let (Some(outcome), Some(job)) = (outcome, self.under_way.take()) {
                self.ledger.report(job, outcome, self.wire.mark());
            }
            other.next = now + self.rng.log_uniform(MS / 10, 200 * MS);
        }
        let gives_up = other.open.is_some_and(|(at, _)| at <= now) || self.rng.chance(0.002);
        if (is_lost || gives_up || !self.wire.is_connected()) && self.connects_at.is_none() {
            *other = AnyCentral::default();
            if let Some(job) = self.under_way.take() {
                self.ledger.report(job, Reported::Unknown, self.wire.mark());
            }
            // It may begin a new connection at once: the device need not have learned that the one before is gone.
            self.connects_at = Some(now + self.rng.log_uniform(MS / 10, S));
        }
        if self.connects_at.is_some() || other.open.is_some() || other.next > now {
            return;
        }
        let command = self.any_command();
        let order = match command {
            Command::Move { pose: target, .. } => Some(Order::Move { target }),
            Command::Override { percent } => Some(Order::Override { percent }),
            _ => None,
        };
        self.under_way = order.map(|order| {
            self.sent.push(order);
            self.ledger.send(self.wire.mark())
        });
        let mut out = [0; 64];
        let length = command.encode(&mut out).expect("a buffer of a line");
        other.held.clear();
        other.open = Some((now + self.rng.log_uniform(500 * MS, 10 * S), command));
        Line { wire: &mut self.wire, cut: self.cut }.send(End::A, now, &out[..length]);
    }

    fn any_command(&mut self) -> Command<RobotPose> {
        let number = self.sent.len() as i32 + 1;
        match self.rng.below(12) {
            0 | 1 => Command::Status,
            2 => Command::Override { percent: (number % 101) as u8 },
            3 => Command::Stop,
            4 | 5 => Command::Reset,
            6 => Command::Servo { on: self.rng.chance(0.7) },
            7 => Command::Acquire { camera: 1 },
            8 if self.rng.chance(0.2) => Command::Close,
            _ => {
                let pose = RobotPose::from_units([number, -number, 3 * number, 7]);
                Command::Move { mode: Mode::Absolute, pose }
            }
        }
    }
}
