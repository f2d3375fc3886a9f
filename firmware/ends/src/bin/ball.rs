//! The ISRA control ball: the main loop measures, the interrupt of the session answers polls with the newest values.
#![no_std]
#![no_main]

use core::ops::ControlFlow;
use core::time::Duration;

use board::{Driver, Latest, Link};
use isra_ball::{Ball, BallConfig, BallEvent, Keys};
use robot_session::Session as _;
use static_cell::StaticCell;

static MEASURED: Latest<([i8; 3], [i8; 3])> = Latest::new();
static LINK: StaticCell<ControlBall> = StaticCell::new();

/// How often the sensor measures.
const PERIOD: Duration = Duration::from_millis(10);

/// What runs in the interrupt of the session.
struct ControlBall {
    driver: Driver<{ Ball::MAX_INPUT }, { Ball::MAX_TRANSMIT }>,
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
                    if *replies % 50 == 0 {
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

/// The sensor: a hand that pushes to and fro.
fn measure(now: Duration) -> ([i8; 3], [i8; 3]) {
    let phase = now.subsec_millis() / 4; // 0 to 249
    let push = (phase as i16 - 125).abs() - 62;
    ([push.clamp(-60, 60) as i8, 0, 0], [0; 3])
}

#[cortex_m_rt::entry]
fn main() -> ! {
    let uart = board::init(isra_ball::timing::BAUD);
    let Ok(mut session) = Ball::new(BallConfig::default()) else { panic!("it works") };
    session.handle_connected(board::now());
    board::start(LINK.init(ControlBall { driver: Driver::new(uart, board::now), session, replies: 0 }));
    defmt::info!("ball");
    loop {
        MEASURED.set(measure(board::now()));
        board::pause(PERIOD);
    }
}
