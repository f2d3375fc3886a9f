//! Our robot's owner, and a line that may be cut.

use core::time::Duration;

use mmacell_proto::{Device, DeviceConfig, Order, RobotPose};

use super::{HOME, MS, Wire};
use crate::Carrier;
use crate::link::{Delivery, End};
use robot_session::contract::Rng;

/// The robot's owner.
pub(super) struct Robot {
    pub(super) device: Device<RobotPose>,
    pub(super) pose: RobotPose,
    /// When the axes come to rest, and where.
    pub(super) arrival: Option<(Duration, RobotPose)>,
    /// An order, and when it is accepted.
    pub(super) asked: Option<(Duration, Order<RobotPose>)>,
}

impl Robot {
    pub(super) fn new(pose: RobotPose) -> Self {
        let mut device = Device::new(DeviceConfig::DEFAULT).unwrap();
        device.set_pose(pose);
        Self { device, pose, arrival: None, asked: None }
    }

    pub(super) fn carry_out(&mut self, now: Duration, order: Order<RobotPose>, rng: &mut Rng, bad: f64) {
        match order {
            Order::Move { target } => {
                let time = Duration::from_millis(rng.below(300) as u64);
                // Something is in its way, and it does not notice.
                let end =
                    if rng.chance(0.1 * bad) { RobotPose::from_units([5_000, 0, 0, 0]) } else { target };
                self.arrival = Some((now + time, end));
            }
            Order::Home => self.arrival = Some((now + 50 * MS, HOME)),
            Order::Stop => {
                self.arrival = None;
                self.device.arrived();
            }
            _ => {}
        }
    }
}

/// The wire, as long as it is not cut.
pub(super) struct Line<'a> {
    pub(super) wire: &'a mut Wire,
    pub(super) cut: bool,
}

impl Carrier for Line<'_> {
    fn send(&mut self, from: End, now: Duration, bytes: &[u8]) {
        if !self.cut {
            self.wire.send(from, now, bytes);
        }
    }

    fn receive(&mut self, at: End, now: Duration, most: usize) -> Option<Delivery> {
        let delivery = self.wire.receive_part(at, now, most)?;
        // What was on its way is lost; that the connection is gone is not.
        if self.cut && delivery != Delivery::Closed { self.receive(at, now, most) } else { Some(delivery) }
    }
}
