//! A ball that is not ours and keeps the source's rules: IB-3, IB-33, IB-34 and IB-35.
//!
//! It answers a poll when it likes, or not, all polls of before with one packet, and marks new values as old now and then.

use core::time::Duration;

use isra_ball::robot_session::Encode as _;
use isra_ball::{ENQ, Keys, Packet, Status};

use super::{Hand, MS, Made, Wire};
use crate::link::{Delivery, End};
use robot_session::contract::Rng;

pub(super) struct AnyBall {
    /// When it answers.
    answer_at: Option<Duration>,
    /// What it has sent last.
    sent: Option<Duration>,
    sensor: u8,
}

impl AnyBall {
    pub(super) fn new(rng: &mut Rng) -> Self {
        Self { answer_at: None, sent: None, sensor: rng.below(8) as u8 }
    }

    pub(super) fn next(&self) -> Option<Duration> {
        self.answer_at
    }

    /// The packet that it sends. It is no later than `longest`.
    pub(super) fn turn(
        &mut self,
        wire: &mut Wire,
        now: Duration,
        hand: &Hand,
        longest: Duration,
        is_calm: bool,
        rng: &mut Rng,
    ) -> Option<Made> {
        while let Some(delivery) = wire.receive(End::B, now) {
            let Delivery::Bytes(bytes) = delivery else { continue };
            if bytes.contains(&ENQ) && (is_calm || rng.chance(0.95)) {
                let late = if is_calm { Duration::ZERO } else { rng.log_uniform(MS / 10, longest) };
                self.answer_at = self.answer_at.or(Some(now + late));
            }
        }
        self.answer_at.take_if(|at| *at <= now)?;
        let is_new = hand.measured.is_some() && hand.measured != self.sent && (is_calm || rng.chance(0.9));
        self.sent = hand.measured;
        let (force, moment, keys) = hand.values();
        let status = if is_new { Status::Fresh } else { Status::Old };
        let packet = Packet { sensor_type: 5, sensor: self.sensor, status, force, moment, keys: Keys(keys) };
        let mut buffer = [0; 64];
        let n = packet.encode(&mut buffer).unwrap();
        wire.send(End::B, now, &buffer[..n]);
        Some(Made { packet, measured: hand.measured, at: now, received: false })
    }
}
