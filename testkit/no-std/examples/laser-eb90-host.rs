//! The PC of the laser robot.
#![no_std]
#![no_main]

use core::hint::black_box;

use laser_eb90::robot_session::Session as _;
use laser_eb90::{Host, HostConfig};

#[unsafe(no_mangle)]
extern "C" fn main() -> i32 {
    let Ok(mut session) = Host::new(HostConfig::default()) else { return 1 };
    no_std::run(&mut session, &mut [0; Host::MAX_TRANSMIT], |session, _| {
        let _ = session.submit(0x0101, |parameters| parameters.f32(&black_box([1.0, 2.0])).map(drop));
    })
}
