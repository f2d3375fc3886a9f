//! A simulated device: the protocol's session before simulated axes.

use std::ops::ControlFlow;
use std::time::Duration;

use anyhow::Result;
use mmacell_proto::robot_session::Session as _;
use mmacell_proto::{Device, DeviceConfig, DeviceEvent, ErrorCode, Order};
use robot_session::{Output, settle};
use serde_json::{Value, json};

use super::axes::{Axes, Simulated};

/// A robot or a platform.
#[derive(Debug)]
pub struct Station<P: Simulated> {
    device: Device<P>,
    body: Body<P>,
}

/// What the device moves.
#[derive(Debug)]
struct Body<P> {
    axes: Axes<P>,
    home: P,
    faults: MotionFaults,
    /// Motions that were commanded, refused ones included.
    asked: u64,
    motions: u64,
    fate: Fate,
}

/// Every how many motions something goes wrong with one; 0: never.
#[derive(Debug, Clone, Copy, Default)]
pub struct MotionFaults {
    /// It stops half-way with an error of servo motor 1.
    pub fail_every: u64,
    /// It stops half-way, and the device does not notice.
    pub stall_every: u64,
    /// It is refused with `refuse_code`.
    pub refuse_every: u64,
    /// Any number but 0 that fits its field.
    pub refuse_code: i32,
}

/// How the motion that is under way ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fate {
    /// At its target.
    Arrives,
    /// Half-way, with an error.
    Fails,
    /// Half-way, without an error.
    Stalls,
}

/// What some bytes led to.
#[derive(Debug, Default)]
pub struct Answer {
    /// To be written to the connection.
    pub replies: Vec<u8>,
    /// What happened, as one object each.
    pub events: Vec<Value>,
    /// The connection has ended.
    pub closed: bool,
}

impl<P: Simulated> Station<P> {
    /// A device at home, at rest, with its servo motors off.
    ///
    /// # Errors
    /// The configuration cannot work, or a motion is to be refused with a number that has no form.
    pub fn new(home: P, config: DeviceConfig, faults: MotionFaults) -> Result<Self> {
        let refuses = faults.refuse_every > 0;
        anyhow::ensure!(
            !refuses || ErrorCode::from(faults.refuse_code).has_form(&config.writes),
            "refuse_code={} is no error number: any but 0 that fits its field",
            faults.refuse_code
        );
        let mut device = Device::new(config)?;
        device.set_pose(home);
        let axes = Axes::new(home);
        Ok(Self { device, body: Body { axes, home, faults, asked: 0, motions: 0, fate: Fate::Arrives } })
    }

    /// A new connection takes the place of the one before; the device stays as it is.
    pub fn connect(&mut self, now: Duration) {
        self.device.handle_connected(now);
    }

    /// Bytes arrive at this time of the cell.
    pub fn receive(&mut self, now: Duration, bytes: &[u8]) -> Answer {
        let (mut answer, mut buffer) = (Answer::default(), [0; 64]);
        self.advance(now);
        let Self { device, body } = self;
        // Every order is decided at once, so that more is wanted after each piece.
        for piece in bytes.chunks(Device::<P>::MAX_INPUT) {
            device.handle_input(now, piece);
            let _ = settle(device, now, &mut buffer, |device, output| {
                match output {
                    Output::Event(event) => body.take(now, device, event, &mut answer),
                    Output::Transmit(bytes) => answer.replies.extend_from_slice(bytes),
                }
                ControlFlow::<()>::Continue(())
            });
        }
        answer
    }

    /// Moves on to this time.
    pub fn advance(&mut self, now: Duration) {
        self.body.advance(now, &mut self.device);
    }

    /// Decides how the motion that is under way ends.
    pub fn end_motion(&mut self, fate: Fate) {
        self.body.fate = fate;
    }

    /// Where it is.
    pub fn pose(&self) -> P {
        self.body.axes.pose()
    }

    /// Whether it moves.
    pub fn moves(&self) -> bool {
        !self.body.axes.stand()
    }

    /// How many motions it has begun because of `MOV`.
    pub fn motions(&self) -> u64 {
        self.body.motions
    }
}

impl<P: Simulated> Body<P> {
    fn take(&mut self, now: Duration, device: &mut Device<P>, event: DeviceEvent<P>, answer: &mut Answer) {
        match event {
            DeviceEvent::Asked { order } => self.decide(now, device, order, answer),
            DeviceEvent::Closed { reason } => {
                answer.closed = true;
                let reason = format!("{reason:?}").to_lowercase();
                answer.events.push(json!({"event": "closed", "reason": reason}));
            }
            DeviceEvent::Rejected { reason } => {
                answer.events.push(json!({"event": "rejected", "reason": reason.to_string()}));
            }
            _ => {}
        }
        self.advance(now, device);
    }

    fn advance(&mut self, now: Duration, device: &mut Device<P>) {
        self.axes.advance(now);
        if self.fate != Fate::Arrives && self.axes.stop_half_way() {
            if self.fate == Fate::Fails {
                device.fail(ErrorCode::Servo1);
            }
            self.fate = Fate::Arrives;
        }
        device.set_pose(self.axes.pose());
        if self.axes.stand() {
            device.arrived();
        }
    }

    fn decide(&mut self, now: Duration, device: &mut Device<P>, order: Order<P>, answer: &mut Answer) {
        let every = |count: u64, n: u64| n > 0 && count.is_multiple_of(n);
        if let Order::Move { .. } = order {
            self.asked += 1;
            if every(self.asked, self.faults.refuse_every) {
                let error = ErrorCode::from(self.faults.refuse_code);
                // It was checked that the number has a form.
                let _ = device.refuse(order, error);
                answer.events.push(json!({"event": "refused", "error": error}));
                return;
            }
        }
        if device.accept(order).is_err() {
            return;
        }
        match order {
            Order::Move { target } => {
                self.motions += 1;
                self.fate = match self.motions {
                    n if every(n, self.faults.fail_every) => Fate::Fails,
                    n if every(n, self.faults.stall_every) => Fate::Stalls,
                    _ => Fate::Arrives,
                };
                self.axes.go(now, target);
                answer.events.push(json!({"event": "move", "to": target}));
            }
            Order::Stop => {
                self.fate = Fate::Arrives;
                self.axes.stop(now);
            }
            Order::Home => {
                self.fate = Fate::Arrives;
                self.axes.go(now, self.home);
                answer.events.push(json!({"event": "home"}));
            }
            Order::Servo { on } => {
                if !on {
                    self.axes.stop(now);
                }
                answer.events.push(json!({"event": "servo", "on": on}));
            }
            Order::Override { percent } => {
                self.axes.set_override(now, percent);
                answer.events.push(json!({"event": "override", "percent": percent}));
            }
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use mmacell_proto::RobotPose;

    use super::*;

    const S: Duration = Duration::from_secs(1);

    fn robot(faults: MotionFaults) -> Station<RobotPose> {
        let mut robot = Station::new(RobotPose::ORIGIN, DeviceConfig::DEFAULT, faults).unwrap();
        robot.connect(Duration::ZERO);
        robot
    }

    fn reply(station: &mut Station<RobotPose>, now: Duration, line: &str) -> String {
        String::from_utf8(station.receive(now, line.as_bytes()).replies).unwrap()
    }

    #[test]
    fn a_motion_shows_from_its_start_to_its_end() {
        let mut robot = robot(MotionFaults::default());
        assert_eq!(reply(&mut robot, S, "SRVON\r\nMOVA+250.000+000.000+000.000+00.0000\r\n"), "OK\r\nOK\r\n");
        assert_eq!(reply(&mut robot, S, "STA\r\n"), "OKT+000.000+000.000+000.000+00.0000T+00100+00000\r\n");
        assert_eq!(
            reply(&mut robot, S + S * 3 / 4, "STA\r\n"),
            "OKT+125.000+000.000+000.000+00.0000T+00100+00000\r\n"
        );
        assert_eq!(
            reply(&mut robot, S + S * 3 / 2, "STA\r\n"),
            "OKF+250.000+000.000+000.000+00.0000T+00100+00000\r\n"
        );
        assert_eq!(robot.motions(), 1);
    }

    #[test]
    fn every_second_motion_stops_half_way_until_a_reset_brings_it_home() {
        let mut robot = robot(MotionFaults { fail_every: 2, ..MotionFaults::default() });
        reply(&mut robot, S, "SRVON\r\nMOVA+000.000+000.000+000.000+00.0000\r\n");
        reply(&mut robot, S, "MOVA+250.000+000.000+000.000+00.0000\r\n");
        assert_eq!(
            reply(&mut robot, S * 2, "STA\r\n"),
            "OKF+125.000+000.000+000.000+00.0000F+00100+00002\r\n"
        );
        assert_eq!(reply(&mut robot, S * 2, "RST\r\n"), "OK\r\n");
        assert_eq!(
            reply(&mut robot, S * 9, "STA\r\n"),
            "OKF+000.000+000.000+000.000+00.0000T+00100+00000\r\n"
        );
    }
    #[test]
    fn a_motion_stalls_or_is_refused_with_any_number() {
        let faults =
            MotionFaults { stall_every: 1, refuse_every: 2, refuse_code: -7, ..MotionFaults::default() };
        let mut robot = robot(faults);
        let go = "MOVA+250.000+000.000+000.000+00.0000\r\n";
        assert_eq!(reply(&mut robot, S, &format!("SRVON\r\n{go}")), "OK\r\nOK\r\n");
        let half = "OKF+125.000+000.000+000.000+00.0000T+00100+00000\r\n";
        assert_eq!(reply(&mut robot, S * 9, "STA\r\n"), half, "at rest, and no error");
        assert_eq!(reply(&mut robot, S * 9, go), "ER-00007\r\n");
        assert_eq!(robot.motions(), 1);
        let zero = MotionFaults { refuse_every: 1, ..MotionFaults::default() };
        let error = Station::new(RobotPose::ORIGIN, DeviceConfig::DEFAULT, zero).unwrap_err();
        assert_eq!(error.to_string(), "refuse_code=0 is no error number: any but 0 that fits its field");
    }
}
