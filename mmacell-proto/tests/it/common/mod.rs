//! Short words for what one end sends and receives.
#![allow(unreachable_pub, missing_debug_implementations, reason = "a helper of several tests")]

use core::time::Duration;

use mmacell_proto::robot_session::Session as _;
use mmacell_proto::{
    Central, CentralConfig, CentralEvent, Command, Device, DeviceConfig, DeviceEvent, ErrorCode, Mode, Order,
    Pose, Rejection, RobotPose,
};

pub const ZERO: Duration = Duration::ZERO;
pub const MS: Duration = Duration::from_millis(1);
pub const HOME: RobotPose = RobotPose::ORIGIN;

pub fn pose(x: f64) -> RobotPose {
    RobotPose::from_mm_rad(x, 0.0, 0.0, 0.0)
}

pub fn go(pose: RobotPose) -> Command<RobotPose> {
    Command::Move { mode: Mode::Absolute, pose }
}

/// Returns a central controller's end with a connection.
pub fn central() -> Central<RobotPose> {
    central_with(CentralConfig::DEFAULT)
}

pub fn central_with<P: Pose>(config: CentralConfig) -> Central<P> {
    let mut central = Central::new(config).unwrap();
    connect(&mut central);
    central
}

/// Makes a new connection; returns the outcome of the previous one.
pub fn connect<P: Pose>(central: &mut Central<P>) -> Option<CentralEvent<P>> {
    central.handle_connected(ZERO);
    let first = central.poll_event().unwrap();
    if first == CentralEvent::Connected {
        return None;
    }
    assert_eq!(central.poll_event(), Some(CentralEvent::Connected));
    Some(first)
}

/// Returns a device with a connection, and its axes at `pose`.
pub fn device_at<P: Pose>(pose: P) -> Device<P> {
    device_with(DeviceConfig::DEFAULT, pose)
}

pub fn device_with<P: Pose>(config: DeviceConfig, pose: P) -> Device<P> {
    let mut device = Device::new(config).unwrap();
    device.set_pose(pose);
    device.handle_connected(ZERO);
    device
}

/// Requests and sends a command; its bytes.
pub fn send<P: Pose>(central: &mut Central<P>, now: Duration, command: Command<P>) -> Vec<u8> {
    central.request(command).unwrap();
    let mut buffer = [0; 64];
    let len = central.poll_transmit(now, &mut buffer).unwrap();
    assert_eq!(central.poll_transmit(now, &mut buffer), None);
    buffer[..len].to_vec()
}

/// Receives a reply; the one event that it causes.
pub fn receive<P: Pose>(central: &mut Central<P>, now: Duration, bytes: &[u8]) -> CentralEvent<P> {
    central.handle_input(now, bytes);
    let event = central.poll_event().expect("an event");
    assert_eq!(central.poll_event(), None);
    event
}

/// Returns the device's reply to a line, and its event. Its owner accepts everything.
pub fn ask<P: Pose>(device: &mut Device<P>, line: &str) -> (String, Option<DeviceEvent<P>>) {
    answer(device, line, None)
}

/// Returns the device's answer to a line; its owner refuses with `error`, if given.
pub fn answer<P: Pose>(
    device: &mut Device<P>,
    line: &str,
    error: Option<ErrorCode>,
) -> (String, Option<DeviceEvent<P>>) {
    device.handle_input(ZERO, line.as_bytes());
    let event = device.poll_event();
    if let Some(DeviceEvent::Asked { order }) = event {
        assert_eq!(device.poll_transmit(ZERO, &mut [0; 64]), None, "the owner has not answered");
        match error {
            None => device.accept(order).unwrap(),
            Some(error) => device.refuse(order, error).unwrap(),
        }
    }
    let mut buffer = [0; 64];
    let len = device.poll_transmit(ZERO, &mut buffer).expect("a reply");
    assert_eq!(device.poll_transmit(ZERO, &mut buffer), None);
    (String::from_utf8(buffer[..len].to_vec()).unwrap(), event)
}

pub fn rejected<P>(reason: Rejection) -> (String, Option<DeviceEvent<P>>) {
    ("ER+00001\r\n".into(), Some(DeviceEvent::Rejected { reason }))
}

pub fn obeyed<P>(order: Order<P>) -> (String, Option<DeviceEvent<P>>) {
    ("OK\r\n".into(), Some(DeviceEvent::Asked { order }))
}
