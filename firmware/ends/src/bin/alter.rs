//! ALTER's host with a trajectory of its own: the main loop computes the next target, the interrupt of the session sends it.
#![no_std]
#![no_main]

use core::ops::ControlFlow;
use core::time::Duration;

use board::{Driver, Link, Uart};
use robot_session::Session as _;
use robot_work_queue::{NoWake, Reader, WorkQueue};
use static_cell::{ConstStaticCell, StaticCell};
use val2_alter::{Host, HostConfig, HostEvent};

/// Speeds in each cycle, ahead of the robot.
type AxisSpeeds = [i16; 6];
const SPEEDS_AHEAD: usize = 8;
static AHEAD_OF_ROBOT: ConstStaticCell<WorkQueue<AxisSpeeds, SPEEDS_AHEAD>> =
    ConstStaticCell::new(WorkQueue::numbered::<9999>());
static LINK: StaticCell<Alter> = StaticCell::new();

/// The link of the session's interrupt.
struct Alter {
    driver: Driver<64, { Host::MAX_TRANSMIT }>,
    session: Host,
    words: Reader<'static, AxisSpeeds>,
}

impl Link for Alter {
    fn poll(&mut self) -> Option<Duration> {
        let words = &mut self.words;
        let Ok(turn) = self.driver.poll(&mut self.session, |host, event| {
            match event {
                HostEvent::Motion(_) => {
                    // Without one, the target before holds until it is stale.
                    if let Some(next) = words.take() {
                        host.set_target(board::now(), next.complete());
                    }
                    let statistics = host.statistics();
                    if statistics.cycles.is_multiple_of(100) {
                        defmt::info!(
                            "cycles {}, missed {}: {}",
                            statistics.cycles,
                            statistics.missed,
                            host.values()
                        );
                    }
                }
                event => defmt::info!("{}", event),
            }
            ControlFlow::<()>::Continue(())
        });
        turn.continue_value().flatten()
    }
}

/// Returns a motion to and fro along X, then along Y: 16 units per cycle are 18 mm/s.
fn trajectory(cycle: u32) -> AxisSpeeds {
    let speed = if (cycle / 50).is_multiple_of(2) { 16 } else { -16 };
    if (cycle / 100).is_multiple_of(2) { [speed, 0, 0, 0, 0, 0] } else { [0, speed, 0, 0, 0, 0] }
}

#[inline(never)] // its temporaries use its stack, which is free again for the motion
fn start(uart: Uart, words: Reader<'static, AxisSpeeds>) {
    let link = LINK.init_with(|| {
        // With an adapter, or in an emulator, bytes that came together may be read apart: no silence ends a frame.
        let config = HostConfig { gap: None, ..HostConfig::default() };
        let Ok(session) = Host::new(config) else { panic!("it works") };
        Alter { driver: Driver::new(uart, board::now), session, words }
    });
    link.session.handle_connected(board::now());
    board::start(link);
}

#[board::entry]
fn main() -> ! {
    let uart = board::init(val2_alter::timing::BAUD);
    let (mut ahead, words) = AHEAD_OF_ROBOT.take().split_with(NoWake, NoWake);
    start(uart, words);
    defmt::info!("alter");
    let mut cycle = 0;
    loop {
        while let Ok(place) = ahead.claim() {
            place.push(trajectory(cycle));
            cycle += 1;
        }
        // The session takes one in each cycle, in an interrupt.
        board::idle(|| !ahead.is_full());
    }
}
