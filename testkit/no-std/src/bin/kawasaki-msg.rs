//! An order of three jobs through both ends and the queue.
#![no_std]
#![no_main]

use core::time::Duration;

use kawasaki_msg::robot_session::Session as _;
use kawasaki_msg::{Job, JobKind, Line, Pc, PcConfig, Point, Robot, RobotConfig};
use no_std as _;
use robot_work_queue::WorkQueue;

#[unsafe(no_mangle)]
extern "C" fn main() -> i32 {
    i32::from(run() != Some((300, 3)))
}

/// Where the pen is in the end, and how many jobs the PC knows to be executed.
fn run() -> Option<(i32, u32)> {
    let mut queue: WorkQueue<Job<Line>, 2> = WorkQueue::new(9).ok()?;
    let (writer, mut motion) = queue.split();
    let mut robot = Robot::new(RobotConfig { max_number: 9, ..RobotConfig::TCP }, writer).ok()?;
    let mut pc = Pc::new(PcConfig { max_number: 9, ..PcConfig::TCP }).ok()?;
    let line = |x| Line { kind: JobKind::Draw, start: Point::new(x, 0), end: Point::new(x + 100, 0) };
    let picture = [line(0), line(100), line(200)];
    pc.start(50, &picture[..]).ok()?;
    let (mut pen, mut buffer) = (0, [0; 4096]);
    robot.handle_timeout(Duration::ZERO);
    robot.handle_connected(Duration::ZERO);
    pc.handle_connected(Duration::ZERO);
    for i in 1..1000 {
        let now = Duration::from_millis(16 * i);
        while let Some(job) = motion.take() {
            pen = job.work.end.x;
            robot.job_done(now, job.number).ok()?;
            job.complete();
        }
        robot.handle_timeout(now);
        if let Some(length) = robot.poll_transmit(now, &mut buffer) {
            pc.handle_input(now, buffer.get(..length)?);
        }
        if let Some(length) = pc.poll_transmit(now + Duration::from_millis(2), &mut buffer) {
            robot.handle_input(now, buffer.get(..length)?);
        }
        if pc.order().is_none() {
            return Some((pen, pc.executed()));
        }
    }
    None
}
