//! A robot that draws what a PC sends: `cargo run --example robot`, with `cargo run --example pc` in another terminal.
#![allow(clippy::disallowed_methods, clippy::disallowed_types, clippy::indexing_slicing, clippy::unwrap_used)]

use core::time::Duration;
use std::io::{ErrorKind, Read, Write};
use std::net::TcpStream;
use std::sync::mpsc;
use std::time::Instant;

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
    let (mut robot, epoch) = (Robot::new(RobotConfig::TCP, writer)?, Instant::now());
    let (mut stream, mut buffer) = (None, [0; 4096]);
    loop {
        reports.try_iter().try_for_each(|number| robot.job_done(epoch.elapsed(), number))?;
        robot.handle_timeout(epoch.elapsed());
        let mut lost = false;
        while let Some(event) = robot.poll_event() {
            match event {
                RobotEvent::Connect => match TcpStream::connect("127.0.0.1:9105") {
                    Ok(connection) => {
                        connection.set_read_timeout(Some(tick))?; // the queue wants to be looked at, too
                        robot.handle_connected(epoch.elapsed());
                        stream = Some(connection);
                    }
                    Err(_) => lost = true,
                },
                RobotEvent::Disconnect => lost = true,
                event => println!("{event:?}"),
            }
        }
        std::thread::sleep(if stream.is_none() { tick } else { Duration::ZERO });
        if let Some(stream) = &mut stream {
            if let Some(length) = robot.poll_transmit(epoch.elapsed(), &mut buffer) {
                lost |= stream.write_all(&buffer[..length]).is_err();
            }
            match stream.read(&mut buffer) {
                Ok(length @ 1..) => robot.handle_input(epoch.elapsed(), &buffer[..length]),
                Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
                _ => lost = true,
            }
        }
        if lost {
            stream = None;
            robot.handle_closed(epoch.elapsed());
        }
    }
}
