//! The control ball.
#![no_std]
#![no_main]

use core::hint::black_box;

use isra_ball::robot_session::Session as _;
use isra_ball::{Ball, BallConfig, Keys};

#[unsafe(no_mangle)]
extern "C" fn main() -> i32 {
    let Ok(mut session) = Ball::new(BallConfig::default()) else { return 1 };
    no_std::run(&mut session, &mut [0; Ball::MAX_TRANSMIT], |session, _| {
        let _ = session.measure(black_box([1; 3]), black_box([1; 3]), Keys::NONE);
    })
}
