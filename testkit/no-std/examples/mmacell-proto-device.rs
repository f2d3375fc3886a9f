//! A robot of the MM&A cell.
#![no_std]
#![no_main]

use core::hint::black_box;

use mmacell_proto::robot_session::Session as _;
use mmacell_proto::{Device, DeviceConfig, RobotPose};

#[unsafe(no_mangle)]
extern "C" fn main() -> i32 {
    let Ok(mut session) = Device::<RobotPose>::new(DeviceConfig::DEFAULT) else { return 1 };
    no_std::run(&mut session, &mut [0; Device::<RobotPose>::MAX_TRANSMIT], |session, _| {
        let _ = session.set_pose(RobotPose::from_units(black_box([1; 4])));
    })
}
