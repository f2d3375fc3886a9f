//! The host of the graphics workstation.
#![no_std]
#![no_main]

use core::hint::black_box;

use val2_viewer::robot_session::Session as _;
use val2_viewer::{Host, HostConfig};

#[unsafe(no_mangle)]
extern "C" fn main() -> i32 {
    let Ok(mut session) = Host::new(HostConfig::default()) else { return 1 };
    no_std::run(&mut session, &mut [0; Host::MAX_TRANSMIT], |session, now| {
        let _ = session.set_pose(now, black_box([1; 12]));
    })
}
