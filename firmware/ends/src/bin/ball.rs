//! The ISRA control ball: the main loop measures, the interrupt of the session answers polls with the newest values.
#![no_std]
#![no_main]

use core::ops::ControlFlow;
use core::time::Duration;

use board::{Driver, Latest, Link, Uart};
use isra_ball::{Ball, BallConfig, BallEvent, Keys};
use robot_session::Session as _;
use static_cell::StaticCell;

static MEASURED: Latest<([i8; 3], [i8; 3])> = Latest::new();
static LINK: StaticCell<ControlBall> = StaticCell::new();

/// The interval between the sensor's measurements.
const PERIOD: Duration = Duration::from_millis(10);

/// The link of the session's interrupt.
struct ControlBall {
    driver: Driver<32, { Ball::MAX_TRANSMIT }>,
    session: Ball,
    replies: u32,
}

impl Link for ControlBall {
    fn poll(&mut self) -> Option<Duration> {
        if let Some((force, moment)) = MEASURED.take() {
            self.session.measure(force, moment, Keys::NONE);
        }
        let replies = &mut self.replies;
        let Ok(turn) = self.driver.poll(&mut self.session, |_, event| {
            match event {
                BallEvent::Reply(packet) => {
                    *replies += 1;
                    if replies.is_multiple_of(50) {
                        defmt::info!("replies {}: {}", *replies, packet.force);
                    }
                }
                event => defmt::warn!("{}", event),
            }
            ControlFlow::<()>::Continue(())
        });
        turn.continue_value().flatten()
    }
}

/// Returns the values of the sensor: a hand that rests for a second, then pushes for one.
fn measure(now: Duration) -> ([i8; 3], [i8; 3]) {
    let push = if now.as_secs().is_multiple_of(2) { 0 } else { 40 };
    ([push, 0, 0], [0; 3])
}

#[inline(never)] // its temporaries use its stack, which is free again for the motion
fn start(uart: Uart) {
    let link = LINK.init_with(|| {
        let Ok(session) = Ball::new(BallConfig::default()) else { panic!("it works") };
        ControlBall { driver: Driver::new(uart, board::now), session, replies: 0 }
    });
    link.session.handle_connected(board::now());
    board::start(link);
}

#[board::entry]
fn main() -> ! {
    let uart = board::init(isra_ball::timing::BAUD);
    start(uart);
    defmt::info!("ball");
    loop {
        MEASURED.set(measure(board::now()));
        board::pause(PERIOD);
    }
}
