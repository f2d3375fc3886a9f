//! A client of a FANUC controller, RTU on a serial line: requests the telemetry block ten times a second.
#![no_std]
#![no_main]

use core::ops::ControlFlow;
use core::time::Duration;

use board::{Driver, Link, Uart};
use fanuc_hmi_modbus::{Client, ClientConfig, ClientEvent, Reply, TelemetryBlock, WordOrder};
use robot_session::Session as _;
use robot_work_queue::{NoWake, WorkQueue, Writer};
use static_cell::{ConstStaticCell, StaticCell};

type Session = Client<1>;
static BLOCKS: ConstStaticCell<WorkQueue<TelemetryBlock, 4>> =
    ConstStaticCell::new(WorkQueue::numbered::<9999>());
static LINK: StaticCell<Telemetry> = StaticCell::new();

const BAUD: u32 = 9_600;
const UNIT: u8 = 1;
const PERIOD: Duration = Duration::from_millis(100);

/// The link of the session's interrupt.
struct Telemetry {
    driver: Driver<128, { Session::MAX_TRANSMIT }>,
    session: Session,
    blocks: Writer<'static, TelemetryBlock>,
    /// The time of the next request.
    next: Duration,
}

impl Link for Telemetry {
    fn poll(&mut self) -> Option<Duration> {
        let now = board::now();
        if now >= self.next {
            self.next = now + PERIOD;
            // Refused while the previous request has no outcome.
            let _ = self.session.request(UNIT, &TelemetryBlock::request());
        }
        let blocks = &mut self.blocks;
        let Ok(turn) = self.driver.poll(&mut self.session, |client, event| {
            handle(client, event, blocks);
            ControlFlow::<()>::Continue(())
        });
        turn.continue_value().flatten().into_iter().chain([self.next]).min()
    }
}

fn handle(client: &mut Session, event: ClientEvent, blocks: &mut Writer<'static, TelemetryBlock>) {
    let ClientEvent::Replied { ticket, .. } = event else { return defmt::warn!("{}", event) };
    if let Some(Reply::HoldingRegisters(words)) = client.reply(ticket)
        && let Some(block) = TelemetryBlock::from_words(&words, WordOrder::LowFirst)
        && let Ok(place) = blocks.claim()
    {
        place.push(block);
    }
}

#[inline(never)] // its temporaries use its stack, which is free again for the motion
fn start(uart: Uart, blocks: Writer<'static, TelemetryBlock>) {
    let link = LINK.init_with(|| {
        let Ok(session) = Client::new(ClientConfig::rtu(BAUD)) else { panic!("it works") };
        Telemetry { driver: Driver::new(uart, board::now), session, blocks, next: board::now() }
    });
    link.session.handle_connected(board::now());
    board::start(link);
}

#[board::entry]
fn main() -> ! {
    let uart = board::init(BAUD);
    let (writer, mut blocks) = BLOCKS.take().split_with(NoWake, NoWake);
    start(uart, writer);
    defmt::info!("telemetry");
    loop {
        while let Some(block) = blocks.take() {
            defmt::info!("life {}, at {} mm", block.life_counter, block.position);
            block.complete();
        }
        board::idle(|| !blocks.is_empty());
    }
}
