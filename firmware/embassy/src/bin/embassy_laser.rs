//! The controller of a laser robot as two tasks of Embassy: one speaks, one moves, and the queue wakes it.
#![no_std]
#![no_main]

use core::future::pending;
use core::ops::ControlFlow;

use board::{EmbassyClock, Uart};
use embassy_executor::Spawner;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;
use embassy_time::Timer;
use laser_eb90::{Controller, ControllerConfig, ControllerEvent, Instruction, Item, Refusal};
use robot_session::embedded_io_async::Driver;
use robot_session::{Clock as _, Session as _};
use robot_work_queue::{NoWake, WorkQueue, Writer};
use static_cell::ConstStaticCell;

static QUEUE: ConstStaticCell<WorkQueue<Cut, 32>> = ConstStaticCell::new(WorkQueue::numbered::<9999>());
static QUEUED: Signal<CriticalSectionRawMutex, ()> = Signal::new();

/// An instruction of the motion: its command word, and where the tool goes: X, Y, Z, A, B and the length of the way.
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

/// The hook of the queue that wakes the motion.
type WakeHook = fn();
type Session = Controller<'static, Cut, WakeHook>;

#[embassy_executor::task]
async fn communicate(uart: Uart, writer: Writer<'static, Cut, WakeHook>) {
    let Ok(mut session) = Controller::new(ControllerConfig::default(), writer) else { panic!("it works") };
    let (receiver, sender) = uart.split();
    let mut driver = Driver::<_, _, _, 64, { Session::MAX_TRANSMIT }>::new(receiver, sender, EmbassyClock);
    session.handle_connected(EmbassyClock.now());
    loop {
        let Ok(turn) = driver.turn(&mut session, pending(), handle).await;
        if turn.is_break() {
            return;
        }
    }
}

fn handle(controller: &mut Session, event: ControllerEvent) -> ControlFlow<()> {
    defmt::debug!("{}", event);
    if let ControllerEvent::Execute { word, .. } = event
        && controller.refuse(EmbassyClock.now(), Refusal::UnknownCommand).is_err()
    {
        defmt::warn!("no answer to {=u16:04X}", word);
    }
    ControlFlow::Continue(())
}

#[embassy_executor::main]
async fn main(spawner: Spawner) {
    let uart = board::init(115_200);
    let (writer, mut motion) = QUEUE.take().split_with((|| QUEUED.signal(())) as WakeHook, NoWake);
    match communicate(uart, writer) {
        Ok(task) => spawner.spawn(task),
        Err(_) => panic!("it is spawned once"),
    }
    board::enable_drives();
    defmt::info!("laser");
    let mut executed = 0_u32;
    loop {
        board::is_alive();
        let Some(job) = motion.take() else {
            board::wait_or_second(QUEUED.wait()).await;
            continue;
        };
        Timer::after_millis(1).await; // the motion
        executed += 1;
        let [x, y, ..] = job.to;
        defmt::info!("executed {}: {=u16:04X} to {} {}", executed, job.word, x, y);
        job.complete();
    }
}
