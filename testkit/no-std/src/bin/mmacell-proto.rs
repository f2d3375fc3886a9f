//! A question and its answer through both ends.
#![no_std]
#![no_main]

use core::time::Duration;

use mmacell_proto::robot_session::Session as _;
use mmacell_proto::{Central, CentralConfig, CentralEvent, Command, Device, DeviceConfig, RobotPose};
use no_std as _;

#[unsafe(no_mangle)]
extern "C" fn main() -> i32 {
    i32::from(run() != Some([10_000, -2_000, 5_999, -12_322]))
}

fn run() -> Option<[i32; 4]> {
    let mut robot = Device::new(DeviceConfig::DEFAULT).ok()?;
    robot.set_pose(RobotPose::from_units([10_000, -2_000, 5_999, -12_322]));
    let mut central = Central::<RobotPose>::new(CentralConfig::DEFAULT).ok()?;
    let (now, mut buf) = (Duration::ZERO, [0; 64]);
    robot.handle_connected(now);
    central.handle_connected(now);
    central.poll_event()?;
    central.request(Command::Status).ok()?;
    let n = central.poll_transmit(now, &mut buf)?;
    robot.handle_input(now, buf.get(..n)?);
    let n = robot.poll_transmit(now, &mut buf)?;
    central.handle_input(now, buf.get(..n)?);
    match central.poll_event()? {
        CentralEvent::Status { status, .. } => Some(status.pose.units()),
        _ => None,
    }
}
