#[path = "../work/kawasaki.rs"]
mod work;

use std::net::TcpStream;
use std::ops::ControlFlow;
use std::time::Duration;

use benches::{Count, Link};
use kawasaki_msg::robot_session::Session as _;
use kawasaki_msg::{LargeRobot, Line, PcConfig, RobotConfig};
use robot_session::Driver;

use super::peer::with_peer;
use work::line;

/// The jobs of a packet when the numbers have four digits.
const JOBS: usize = 93;

pub(super) const LINK: Link = Link {
    name: "kawasaki-msg",
    counts: &[Count::op(
        "TCP: 93 jobs acknowledged, a packet of as many sent, through the PC's handle",
        handle,
    )
    .rounds(25)],
    peers: &[executing],
    ..Link::EMPTY
};

/// Runs an order of as many full packets.
fn handle(rounds: u64) {
    with_peer(LINK.name, 0, |tcp| async move {
        let (robot, task) = kawasaki_msg::tokio::pc(PcConfig::tcp(), (), tcp).expect("a PC");
        tokio::spawn(task.run());
        let jobs = rounds as usize * JOBS;
        let over = robot
            .run(50, (0..jobs).map(|index| line((index % 9999) as u16 + 1)).collect::<Vec<_>>())
            .await
            .expect("the order ends");
        assert_eq!(over.executed as usize, jobs);
    });
}

/// Serves as a robot that executes each job at once.
fn executing(stream: TcpStream) {
    let (jobs, mut motion) = kawasaki_msg::motion::boxed(256, 9999).expect("a queue");
    let mut robot =
        LargeRobot::<Line>::with_ranges(RobotConfig::tcp(), jobs, Default::default()).expect("a robot");
    robot.handle_timeout(Duration::ZERO);
    robot.handle_connected(Duration::ZERO);
    let mut driver = Driver::new(stream);
    loop {
        let turn =
            driver.turn(&mut robot, Some(Duration::from_millis(2)), |_, _| ControlFlow::<()>::Continue(()));
        if !matches!(turn, Ok(ControlFlow::Continue(()))) {
            return;
        }
        while let Some(job) = motion.take() {
            job.complete();
        }
    }
}
