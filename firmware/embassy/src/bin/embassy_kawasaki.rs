//! A Kawasaki robot at the TCP bridge of a UART as two tasks of Embassy: one communicates, one draws, and the queue
//! wakes both.
#![no_std]
#![no_main]

use core::ops::ControlFlow;

use board::{EmbassyClock, Receiver, Sender, Uart};
use embassy_executor::Spawner;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;
use embassy_time::Timer;
use kawasaki_msg::motion::{JobQueue, Jobs};
use kawasaki_msg::{Job, Line, Robot, RobotConfig, RobotEvent};
use robot_session::embedded_io_async::Driver;
use robot_session::{Clock as _, Session as _};
use static_cell::{ConstStaticCell, StaticCell};

static QUEUE: ConstStaticCell<JobQueue<Line, 64>> = ConstStaticCell::new(JobQueue::numbered::<9999>());
static QUEUED: Signal<CriticalSectionRawMutex, ()> = Signal::new();
static COMPLETED: Signal<CriticalSectionRawMutex, ()> = Signal::new();

/// The hook that wakes an end of the queue.
type Hook = fn();
type Session = Robot<'static, Line, 256, Hook>;
/// Made one by one where they stay: a task would be made on the stack, with both in it.
static DRIVER: StaticCell<Driver<Receiver, Sender, EmbassyClock, 256, { Session::MAX_TRANSMIT }>> =
    StaticCell::new();
static SESSION: StaticCell<Session> = StaticCell::new();

#[embassy_executor::task]
async fn communicate(uart: Uart, jobs: Jobs<'static, Line, Hook>) {
    let (receiver, sender) = uart.split();
    let driver = DRIVER.init_with(|| Driver::new(receiver, sender, EmbassyClock));
    let session = SESSION.init_with(|| {
        let Ok(session) = Session::new(RobotConfig::tcp(), jobs) else { panic!("it works") };
        session
    });
    loop {
        let Ok(turn) = driver.turn(session, COMPLETED.wait(), handle).await;
        if turn.is_break() {
            return;
        }
    }
}

fn handle(robot: &mut Session, event: RobotEvent) -> ControlFlow<()> {
    match event {
        // The bridge has the connection: the line is always there.
        RobotEvent::Connect => robot.handle_connected(EmbassyClock.now()),
        RobotEvent::Disconnect => robot.handle_disconnected(EmbassyClock.now()),
        RobotEvent::PeerStatus { .. } | RobotEvent::NoReply => defmt::debug!("{}", event),
        event => defmt::info!("{}", event),
    }
    ControlFlow::Continue(())
}

#[embassy_executor::main]
async fn main(spawner: Spawner) {
    let uart = board::init(115_200);
    let hooks = ((|| QUEUED.signal(())) as Hook, (|| COMPLETED.signal(())) as Hook);
    let (jobs, mut motion) = QUEUE.take().split_with(hooks.0, hooks.1);
    match communicate(uart, jobs) {
        Ok(task) => spawner.spawn(task),
        Err(_) => panic!("it is spawned once"),
    }
    board::enable_drives();
    defmt::info!("kawasaki");
    let mut executed = 0_u32;
    loop {
        board::is_alive();
        let Some(job) = motion.take() else {
            board::wait_or_second(QUEUED.wait()).await;
            continue;
        };
        Timer::after_millis(10).await; // the motion
        executed += 1;
        let Job { order, number, work } = *job;
        defmt::info!(
            "executed {}: order {}, job {} to {} {}",
            executed,
            order,
            number,
            work.end.x,
            work.end.y
        );
        job.complete();
    }
}
