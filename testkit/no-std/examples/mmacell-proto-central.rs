//! The central controller of the MM&A cell, for the robot.
#![no_std]
#![no_main]

use mmacell_proto::robot_session::Session as _;
use mmacell_proto::{Central, CentralConfig, Command, RobotPose};

#[unsafe(no_mangle)]
extern "C" fn main() -> i32 {
    let Ok(mut session) = Central::<RobotPose>::new(CentralConfig::DEFAULT) else { return 1 };
    no_std::run(&mut session, &mut [0; Central::<RobotPose>::MAX_TRANSMIT], |session, _| {
        let _ = session.request(Command::Status);
    })
}
