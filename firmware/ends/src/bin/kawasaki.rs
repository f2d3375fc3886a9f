//! A Kawasaki robot behind the TCP bridge of a UART: lines go into a queue in the interrupt of the session, and the main loop draws them.
#![no_std]
#![no_main]

use core::ops::ControlFlow;
use core::time::Duration;

use board::{Driver, Link, Uart};
use kawasaki_msg::{Job, Line, Robot, RobotConfig, RobotEvent};
use robot_session::Session as _;
use robot_work_queue::{NoWake, Reader, WorkQueue, Writer};
use static_cell::{ConstStaticCell, StaticCell};

type Session = Robot<'static, Line>;
type Port = Driver<256, { Session::MAX_TRANSMIT }>;
const QUEUE_LEN: usize = 64;
static QUEUE: ConstStaticCell<WorkQueue<Job<Line>, QUEUE_LEN>> =
    ConstStaticCell::new(WorkQueue::numbered::<MAX_NUMBER>());
/// The numbers of executed jobs, before they are completed: never more than there are jobs.
static DONE: ConstStaticCell<WorkQueue<u16, QUEUE_LEN>> =
    ConstStaticCell::new(WorkQueue::numbered::<MAX_NUMBER>());
/// Made one by one where they stay: both together are more than the stack of a small board.
static DRIVER: StaticCell<Port> = StaticCell::new();
static SESSION: StaticCell<Session> = StaticCell::new();
static LINK: StaticCell<Kawasaki> = StaticCell::new();

const MAX_NUMBER: u16 = 9999;

/// What runs in the interrupt of the session.
struct Kawasaki {
    driver: &'static mut Port,
    session: &'static mut Session,
    done: Reader<'static, u16>,
}

impl Link for Kawasaki {
    fn poll(&mut self) -> Option<Duration> {
        while let Some(number) = self.done.take() {
            if let Err(error) = self.session.job_done(board::now(), number.complete()) {
                defmt::warn!("{}", error);
            }
        }
        let Ok(turn) = self.driver.poll(self.session, handle);
        turn.continue_value().flatten()
    }
}

fn handle(robot: &mut Session, event: RobotEvent) -> ControlFlow<()> {
    match event {
        // The bridge has the connection: the line is always there.
        RobotEvent::Connect => robot.handle_connected(board::now()),
        RobotEvent::Disconnect => robot.handle_disconnected(board::now()),
        RobotEvent::PeerStatus { .. } | RobotEvent::NoReply => defmt::debug!("{}", event),
        event => defmt::info!("{}", event),
    }
    ControlFlow::Continue(())
}

#[inline(never)] // what it makes passes through its stack, which the motion has again
fn start(uart: Uart, writer: Writer<'static, Job<Line>>, done: Reader<'static, u16>) {
    let driver = DRIVER.init_with(|| Driver::new(uart, board::now));
    let session = SESSION.init_with(|| {
        let Ok(session) = Robot::new(RobotConfig::TCP, writer) else { panic!("it works") };
        session
    });
    board::start(LINK.init(Kawasaki { driver, session, done }));
}

#[board::entry]
fn main() -> ! {
    let uart = board::init(115_200);
    let (writer, mut motion) = QUEUE.take().split_with(NoWake, board::wake);
    let (mut report, done) = DONE.take().split_with(NoWake, NoWake);
    start(uart, writer, done);
    board::enable_drives();
    defmt::info!("kawasaki");
    let mut executed = 0_u32;
    loop {
        let Some(job) = motion.take() else {
            board::idle(|| !motion.is_empty());
            continue;
        };
        board::pause(Duration::from_millis(10)); // the motion
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
        // Reported, then completed.
        if let Ok(place) = report.claim() {
            place.push(number);
        }
        job.complete(); // which wakes the session
    }
}
