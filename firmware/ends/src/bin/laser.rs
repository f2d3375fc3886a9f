//! The controller of a laser robot: instructions go into a queue in the interrupt of the session, and are executed by the
//! main loop.
#![no_std]
#![no_main]

use core::ops::ControlFlow;
use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;

use board::{Driver, Link, Uart};
use laser_eb90::{Controller, ControllerConfig, ControllerEvent, Instruction, Item, Refusal};
use robot_session::Session as _;
use robot_work_queue::{NoWake, WorkQueue, Writer};
use static_cell::{ConstStaticCell, StaticCell};

/// Immediate instructions of this robot, and its queries.
const HALT: u16 = 0x0201;
const GO_ON: u16 = 0x0202;
const CLEAR: u16 = 0x0203;
const STATUS: u16 = 0x0301;

/// The capacity of the queue in instructions.
const QUEUE_LEN: usize = 32;
static QUEUE: ConstStaticCell<WorkQueue<Cut, QUEUE_LEN>> =
    ConstStaticCell::new(WorkQueue::numbered::<9999>());
static LINK: StaticCell<Laser> = StaticCell::new();
static HALTED: AtomicBool = AtomicBool::new(false);

/// An instruction of the motion: its command word, and where the tool goes: X, Y, Z, A, B and the length of the way.
#[derive(Clone, Copy)]
struct Cut {
    word: u16,
    to: [f32; 6],
}

impl TryFrom<Instruction<'_>> for Cut {
    type Error = ();

    fn try_from(mut instruction: Instruction<'_>) -> Result<Self, ()> {
        let to = match instruction.parameters.next() {
            Some(Ok(Item::F32(values))) => values.array().ok_or(())?,
            _ => return Err(()),
        };
        Ok(Self { word: instruction.word, to })
    }
}

type Session = Controller<'static, Cut>;

/// The link of the session's interrupt.
struct Laser {
    driver: Driver<64, { Session::MAX_TRANSMIT }>,
    session: Session,
}

impl Link for Laser {
    fn poll(&mut self) -> Option<Duration> {
        let Ok(turn) = self.driver.poll(&mut self.session, handle);
        turn.continue_value().flatten()
    }
}

fn handle(controller: &mut Session, event: ControllerEvent) -> ControlFlow<()> {
    defmt::debug!("{}", event);
    if let ControllerEvent::Execute { word, .. } = event {
        let queue = controller.queue_mut();
        let held = queue.len();
        let answered = match word {
            HALT | GO_ON => {
                HALTED.store(word == HALT, Ordering::Relaxed);
                controller.answer(board::now(), |_| Ok(()))
            }
            CLEAR => {
                queue.clear();
                controller.answer(board::now(), |_| Ok(()))
            }
            STATUS => controller
                .answer(board::now(), |values| values.i16(&[1, QUEUE_LEN as i16, held as i16]).map(drop)),
            _ => controller.refuse(board::now(), Refusal::UnknownCommand),
        };
        if answered.is_err() {
            defmt::warn!("no answer to {=u16:04X}", word);
        }
    }
    ControlFlow::Continue(())
}

#[inline(never)] // its temporaries use its stack, which is free again for the motion
fn start(uart: Uart, writer: Writer<'static, Cut>) {
    let link = LINK.init_with(|| {
        let Ok(session) = Controller::new(ControllerConfig::default(), writer) else { panic!("it works") };
        Laser { driver: Driver::new(uart, board::now), session }
    });
    link.session.handle_connected(board::now());
    board::start(link);
}

#[board::entry]
fn main() -> ! {
    let uart = board::init(115_200);
    let (writer, mut motion) = QUEUE.take().split_with(NoWake, NoWake);
    start(uart, writer);
    board::enable_drives();
    defmt::info!("laser");
    let mut executed = 0_u32;
    loop {
        let is_halted = HALTED.load(Ordering::Relaxed);
        // Halted, it takes nothing, but sees that the queue was emptied.
        match if is_halted { motion.take_where(|_, _| false) } else { motion.take() } {
            Some(job) => {
                board::pause(Duration::from_millis(1)); // the motion
                executed += 1;
                let [x, y, ..] = job.to;
                defmt::info!("executed {}: {=u16:04X} to {} {}", executed, job.word, x, y);
                job.complete();
            }
            None => board::idle(|| !motion.is_empty() && !HALTED.load(Ordering::Relaxed)),
        }
    }
}
