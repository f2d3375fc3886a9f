//! A simulated device: the protocol's session before simulated axes.

use std::time::Duration;

use mmacell_proto::device::Event;
use mmacell_proto::{Device, Dialect, ErrorCode};
use serde_json::{Value, json};

use super::axes::{Axes, Simulated};

/// A robot or a platform.
#[derive(Debug)]
pub struct Station<P> {
    device: Device<P>,
    axes: Axes<P>,
    home: P,
    motions: u64,
    /// The motion that is going on fails half-way.
    doomed: bool,
    /// Every how many motions one fails; 0: none.
    fail_every: u64,
}

/// What came of some bytes.
#[derive(Debug, Default)]
pub struct Heard {
    /// To be written to the connection.
    pub replies: Vec<u8>,
    /// What happened, as one object each.
    pub events: Vec<Value>,
    /// The controller has said good-bye.
    pub closed: bool,
}

impl<P: Simulated> Station<P> {
    /// A device that stands at home with its servo motors off.
    pub fn new(home: P, dialect: Dialect) -> Self {
        let (device, axes) = (Device::new(home, dialect), Axes::new(home));
        Self { device, axes, home, motions: 0, doomed: false, fail_every: 0 }
    }

    /// A new connection; the device stays as it is.
    pub fn connect(&mut self) {
        self.device.connect();
    }

    /// Hears bytes at this time of the cell.
    pub fn hear(&mut self, now: Duration, mut bytes: &[u8]) -> Heard {
        let mut heard = Heard::default();
        let mut buffer = [0; 64];
        self.advance(now);
        while !bytes.is_empty() {
            let taken = self.device.handle_input(now, bytes);
            bytes = bytes.get(taken..).unwrap_or_default();
            while let Some(len) = self.device.poll_transmit(now, &mut buffer) {
                heard.replies.extend_from_slice(buffer.get(..len).unwrap_or_default());
            }
            while let Some(event) = self.device.poll_event() {
                self.obey(now, event, &mut heard);
            }
            self.advance(now);
        }
        heard
    }

    /// Moves on to this time.
    pub fn advance(&mut self, now: Duration) {
        self.axes.advance(now);
        if self.doomed && self.axes.stop_half_way() {
            self.doomed = false;
            self.device.fail(ErrorCode::Servo1);
        }
        self.device.set_pose(self.axes.pose());
        if self.axes.stand() {
            self.device.arrived();
        }
    }

    /// Lets the motion that is going on fail half-way, with an error of servo motor 1.
    pub fn fail_motion(&mut self) {
        self.doomed = true;
    }

    /// Lets every `n`-th motion fail so; 0: none.
    pub fn fail_every(&mut self, n: u64) {
        self.fail_every = n;
    }

    /// Where it is.
    pub fn pose(&self) -> P {
        self.axes.pose()
    }

    /// Whether it moves.
    pub fn moves(&self) -> bool {
        !self.axes.stand()
    }

    /// How many motions it has begun because of `MOV`.
    pub fn motions(&self) -> u64 {
        self.motions
    }

    fn obey(&mut self, now: Duration, event: Event<P>, heard: &mut Heard) {
        match event {
            Event::Move { target } => {
                self.motions += 1;
                self.doomed = self.fail_every > 0 && self.motions.is_multiple_of(self.fail_every);
                self.axes.go(now, target);
                heard.events.push(json!({"event": "move", "to": target}));
            }
            Event::Stop => {
                self.doomed = false;
                self.axes.stop(now);
            }
            Event::Home => {
                self.doomed = false;
                self.axes.go(now, self.home);
                heard.events.push(json!({"event": "home"}));
            }
            Event::Servo { on } => {
                if !on {
                    self.axes.stop(now);
                }
                heard.events.push(json!({"event": "servo", "on": on}));
            }
            Event::Override { percent } => {
                self.axes.set_override(now, percent);
                heard.events.push(json!({"event": "override", "percent": percent}));
            }
            Event::Closed => {
                heard.closed = true;
                heard.events.push(json!({"event": "closed"}));
            }
            Event::Rejected { reason } => {
                heard.events.push(json!({"event": "rejected", "reason": reason.to_string()}));
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

    fn says(station: &mut Station<RobotPose>, now: Duration, line: &str) -> String {
        String::from_utf8(station.hear(now, line.as_bytes()).replies).unwrap()
    }

    #[test]
    fn a_motion_shows_from_its_start_to_its_end() {
        let mut robot = Station::new(RobotPose::ORIGIN, Dialect::STRICT);
        assert_eq!(says(&mut robot, S, "SRVON\r\nMOVA+250.000+000.000+000.000+00.0000\r\n"), "OK\r\nOK\r\n");
        assert_eq!(says(&mut robot, S, "STA\r\n"), "OKT+000.000+000.000+000.000+00.0000T+00100+00000\r\n");
        assert_eq!(
            says(&mut robot, S + S * 3 / 4, "STA\r\n"),
            "OKT+125.000+000.000+000.000+00.0000T+00100+00000\r\n"
        );
        assert_eq!(
            says(&mut robot, S + S * 3 / 2, "STA\r\n"),
            "OKF+250.000+000.000+000.000+00.0000T+00100+00000\r\n"
        );
        assert_eq!(robot.motions(), 1);
    }

    #[test]
    fn every_second_motion_stops_half_way_until_a_reset_brings_it_home() {
        let mut robot = Station::new(RobotPose::ORIGIN, Dialect::STRICT);
        robot.fail_every(2);
        says(&mut robot, S, "SRVON\r\nMOVA+000.000+000.000+000.000+00.0000\r\n");
        says(&mut robot, S, "MOVA+250.000+000.000+000.000+00.0000\r\n");
        assert_eq!(
            says(&mut robot, S * 2, "STA\r\n"),
            "OKF+125.000+000.000+000.000+00.0000F+00100+00002\r\n"
        );
        assert_eq!(says(&mut robot, S * 2, "RST\r\n"), "OK\r\n");
        assert_eq!(
            says(&mut robot, S * 9, "STA\r\n"),
            "OKF+000.000+000.000+000.000+00.0000T+00100+00000\r\n"
        );
    }
}
