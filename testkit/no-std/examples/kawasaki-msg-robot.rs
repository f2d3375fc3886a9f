//! A Kawasaki robot, with a queue of 64 lines.
#![no_std]
#![no_main]

use kawasaki_msg::{Job, Line, Robot, RobotConfig};
use robot_work_queue::WorkQueue;

#[unsafe(no_mangle)]
extern "C" fn main() -> i32 {
    let Ok(mut queue) = WorkQueue::<Job<Line>, 64>::new(9999) else { return 1 };
    let (writer, mut motion) = queue.split();
    let Ok(mut session) = Robot::new(RobotConfig::TCP, writer) else { return 1 };
    no_std::run(&mut session, &mut [0; 4096], |session, now| {
        if let Some(job) = motion.take() {
            let _ = session.job_done(now, job.number);
            job.complete();
        }
    })
}
