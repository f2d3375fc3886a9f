//! Short words for what one end says and hears.
#![allow(dead_code, unreachable_pub, missing_debug_implementations, reason = "a helper of several tests")]

use core::time::Duration;

use mmacell_proto::controller::{Closing, Config, Event};
use mmacell_proto::device::{Event as Order, Rejection};
use mmacell_proto::{Command, Controller, Device, Mode, Pose, RobotPose};

pub const ZERO: Duration = Duration::ZERO;
pub const MS: Duration = Duration::from_millis(1);
pub const HOME: RobotPose = RobotPose::ORIGIN;

pub fn pose(x: f64) -> RobotPose {
    RobotPose::from_mm_rad(x, 0.0, 0.0, 0.0)
}

pub fn go(pose: RobotPose) -> Command<RobotPose> {
    Command::Move { mode: Mode::Absolute, pose }
}

pub fn by(pose: RobotPose) -> Command<RobotPose> {
    Command::Move { mode: Mode::Relative, pose }
}

pub fn controller() -> Controller<RobotPose> {
    Controller::new(Config::DEFAULT)
}

/// Sends a command whole; the bytes that went out.
pub fn say<P: Pose>(controller: &mut Controller<P>, now: Duration, command: Command<P>) -> Vec<u8> {
    controller.send(command).unwrap();
    let mut buffer = [0; 64];
    let len = controller.poll_transmit(now, &mut buffer).unwrap();
    assert_eq!(controller.poll_transmit(now, &mut buffer), None);
    buffer[..len].to_vec()
}

/// Hears a reply; the one event that it makes.
pub fn hear<P: Pose>(controller: &mut Controller<P>, now: Duration, bytes: &[u8]) -> Event<P> {
    controller.handle_input(now, bytes);
    let event = controller.poll_event().expect("an event");
    assert_eq!(controller.poll_event(), None);
    event
}

pub fn closed<P>(reason: Closing, unknown: Option<Command<P>>) -> Event<P> {
    Event::Closed { reason, unknown }
}

/// What a device replies to a line, and what it orders.
pub fn tell<P: Pose>(device: &mut Device<P>, line: &str) -> (String, Option<Order<P>>) {
    assert_eq!(device.handle_input(ZERO, line.as_bytes()), line.len());
    let mut buffer = [0; 64];
    let len = device.poll_transmit(ZERO, &mut buffer).expect("a reply");
    assert_eq!(device.poll_transmit(ZERO, &mut buffer), None);
    let order = device.poll_event();
    assert_eq!(device.poll_event(), None);
    (String::from_utf8(buffer[..len].to_vec()).unwrap(), order)
}

pub fn refused<P>(reason: Rejection) -> (String, Option<Order<P>>) {
    ("ER+00001\r\n".into(), Some(Order::Rejected { reason }))
}

pub fn obeyed<P>(order: Order<P>) -> (String, Option<Order<P>>) {
    ("OK\r\n".into(), Some(order))
}
