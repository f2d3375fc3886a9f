//! A question and its answer through both ends.
#![no_std]
#![no_main]

use core::time::Duration;

use mmacell_proto::controller::{Config, Controller, Event};
use mmacell_proto::{Command, Device, Dialect, RobotPose};
use no_std as _;

#[unsafe(no_mangle)]
extern "C" fn main() -> i32 {
    i32::from(run() != Some([10_000, -2_000, 5_999, -12_322]))
}

fn run() -> Option<[i32; 4]> {
    let mut robot = Device::new(RobotPose::from_units([10_000, -2_000, 5_999, -12_322]), Dialect::STRICT);
    let mut controller = Controller::<RobotPose>::new(Config::DEFAULT);
    let (now, mut buf) = (Duration::ZERO, [0; 64]);
    controller.send(Command::Status).ok()?;
    let n = controller.poll_transmit(now, &mut buf)?;
    (robot.handle_input(now, buf.get(..n)?) == n).then_some(())?;
    let n = robot.poll_transmit(now, &mut buf)?;
    controller.handle_input(now, buf.get(..n)?);
    match controller.poll_event()? {
        Event::Status { status, .. } => Some(status.pose.units()),
        _ => None,
    }
}
