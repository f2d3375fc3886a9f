//! The host of the control ball.
#![no_std]
#![no_main]

use isra_ball::robot_session::Session as _;
use isra_ball::{Host, HostConfig};

#[unsafe(no_mangle)]
extern "C" fn main() -> i32 {
    let Ok(mut session) = Host::new(HostConfig::default()) else { return 1 };
    no_std::run(&mut session, &mut [0; Host::MAX_TRANSMIT], |session, _| {
        let _ = session.live_until();
    })
}
