//! A robot that draws what a PC sends: `cargo run --features std --example robot`, with `--example pc` in another terminal.
#![allow(clippy::disallowed_methods, clippy::disallowed_types, clippy::unwrap_used)]

use core::ops::ControlFlow;
use core::time::Duration;
use std::net::TcpStream;
use std::sync::mpsc;

use kawasaki_msg::robot_session::{Driver, Session as _, now};
use kawasaki_msg::{Job, Robot, RobotConfig, RobotEvent};

fn main() -> Result<(), Box<dyn core::error::Error>> {
    let (tick, (report, reports)) = (Duration::from_millis(2), mpsc::channel());
    let (writer, mut reader) = robot_work_queue::boxed::<Job>(64, 9999)?;
    std::thread::spawn(move || {
        loop {
            std::thread::sleep(tick); // as long as the robot moves along `job.line`
            let Some(job) = reader.take() else { continue };
            report.send(job.number).map(|()| job.complete()).unwrap(); // first report, and only then complete
        }
    });
    let mut robot = Robot::new(RobotConfig::TCP, writer)?;
    loop {
        // The session says when: at once, and some time after a connection was lost.
        while robot.poll_event() != Some(RobotEvent::Connect) {
            std::thread::sleep(tick);
            robot.handle_timeout(now());
        }
        let Ok(stream) = TcpStream::connect("127.0.0.1:9105") else {
            robot.handle_disconnected(now());
            continue;
        };
        robot.handle_connected(now());
        let mut driver = Driver::new(stream);
        let lost = loop {
            reports.try_iter().try_for_each(|number| robot.job_done(now(), number))?;
            // No longer than a tick: the queue is looked at, too.
            let turn = driver.turn(&mut robot, Some(tick), |_, event| {
                println!("{event:?}");
                if event == RobotEvent::Disconnect {
                    ControlFlow::Break(())
                } else {
                    ControlFlow::Continue(())
                }
            });
            match turn {
                Ok(ControlFlow::Continue(())) => {}
                lost => break lost,
            }
        };
        println!("connection lost: {lost:?}");
        robot.handle_disconnected(now());
    }
}
