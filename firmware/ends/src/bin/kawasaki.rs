//! A Kawasaki robot at the TCP bridge of a UART: lines go into a queue in the interrupt of the session, and the main
//! loop draws them.
#![no_std]
#![no_main]

use core::ops::ControlFlow;
use core::time::Duration;

use board::{Driver, Link, Uart};
use kawasaki_msg::motion::{JobQueue, Jobs};
use kawasaki_msg::{Job, Line, Robot, RobotConfig, RobotEvent};
use robot_session::Session as _;
use robot_work_queue::NoWake;
use static_cell::{ConstStaticCell, StaticCell};

type Session = Robot<'static, Line>;
type Port = Driver<256, { Session::MAX_TRANSMIT }>;
static QUEUE: ConstStaticCell<JobQueue<Line, 64>> = ConstStaticCell::new(JobQueue::numbered::<9999>());
/// Made one by one where they stay: both together are more than the stack of a small board.
static DRIVER: StaticCell<Port> = StaticCell::new();
static SESSION: StaticCell<Session> = StaticCell::new();
static LINK: StaticCell<Kawasaki> = StaticCell::new();

/// The link of the session's interrupt.
struct Kawasaki {
    driver: &'static mut Port,
    session: &'static mut Session,
}

impl Link for Kawasaki {
    fn poll(&mut self) -> Option<Duration> {
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

#[inline(never)] // its temporaries use its stack, which is free again for the motion
fn start(uart: Uart, jobs: Jobs<'static, Line>) {
    let driver = DRIVER.init_with(|| Driver::new(uart, board::now));
    let session = SESSION.init_with(|| {
        let Ok(session) = Robot::new(RobotConfig::tcp(), jobs) else { panic!("it works") };
        session
    });
    board::start(LINK.init(Kawasaki { driver, session }));
}

#[board::entry]
fn main() -> ! {
    let uart = board::init(115_200);
    let (jobs, mut motion) = QUEUE.take().split_with(NoWake, board::wake);
    start(uart, jobs);
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
        job.complete(); // which wakes the session
    }
}
