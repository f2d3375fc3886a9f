//! The graphics workstation.
#![no_std]
#![no_main]

use val2_viewer::robot_session::Session as _;
use val2_viewer::{Workstation, WorkstationConfig};

#[unsafe(no_mangle)]
extern "C" fn main() -> i32 {
    let Ok(mut session) = Workstation::new(WorkstationConfig::default()) else { return 1 };
    no_std::run(&mut session, &mut [0; Workstation::MAX_TRANSMIT], |session, now| {
        let _ = session.draw(now);
    })
}
