//! The computer with the pose of the arm: the main loop has a new pose every 28 ms, the interrupt of the session
//! answers a workstation.
#![no_std]
#![no_main]

use core::ops::ControlFlow;
use core::time::Duration;

use board::{Driver, Latest, Link, Uart};
use robot_session::Session as _;
use static_cell::StaticCell;
use val2_viewer::{Host, HostConfig, HostEvent};

static POSE: Latest<[i16; 12]> = Latest::new();
static LINK: StaticCell<Viewer> = StaticCell::new();

/// A new pose comes this often, as from ALTER.
const POSES: Duration = Duration::from_millis(28);

/// The link of the session's interrupt.
struct Viewer {
    driver: Driver<32, { Host::MAX_TRANSMIT }>,
    session: Host,
}

impl Link for Viewer {
    fn poll(&mut self) -> Option<Duration> {
        if let Some(pose) = POSE.take() {
            self.session.set_pose(board::now(), pose);
        }
        let Ok(turn) = self.driver.poll(&mut self.session, |_, event| {
            match event {
                HostEvent::Sent(packet) if packet.count.is_multiple_of(10) => {
                    defmt::info!("sent {}", packet.count)
                }
                HostEvent::Sent(_) | HostEvent::Asked => {}
                event => defmt::warn!("{}", event),
            }
            ControlFlow::<()>::Continue(())
        });
        turn.continue_value().flatten()
    }
}

#[inline(never)] // its temporaries use its stack, which is free again for the motion
fn start(uart: Uart) {
    let link = LINK.init_with(|| {
        let Ok(session) = Host::new(HostConfig::default()) else { panic!("it works") };
        Viewer { driver: Driver::new(uart, board::now), session }
    });
    link.session.handle_connected(board::now());
    board::start(link);
}

#[board::entry]
fn main() -> ! {
    let uart = board::init(val2_viewer::timing::BAUD);
    start(uart);
    defmt::info!("viewer");
    let mut step: i16 = 0;
    loop {
        // The arm goes to and fro by 100 mm.
        step = (step + 1) % 200;
        let x = 32 * (step - 100).abs();
        POSE.set([16384, 0, 0, 0, 16384, 0, 0, 0, 16384, x, 0, 500 * 32]);
        board::pause(POSES);
    }
}
