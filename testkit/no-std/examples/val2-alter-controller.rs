//! The controller of VAL II ALTER.
#![no_std]
#![no_main]

use val2_alter::robot_session::Session as _;
use val2_alter::{Controller, ControllerConfig};

#[unsafe(no_mangle)]
extern "C" fn main() -> i32 {
    let Ok(mut session) = Controller::new(ControllerConfig::default()) else { return 1 };
    no_std::run(&mut session, &mut [0; Controller::MAX_TRANSMIT], |session, now| {
        let _ = session.start(now);
    })
}
