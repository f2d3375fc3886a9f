//! Sends a robot home and waits until it stands: `cargo run -p mmacell-proto --example home -- 192.168.0.1:2001`

#![allow(clippy::disallowed_methods, clippy::disallowed_types, reason = "the driver loop is where I/O is")]

use core::time::Duration;
use std::io::{ErrorKind, Read, Write};
use std::net::TcpStream;
use std::time::Instant;

use mmacell_proto::controller::{Config, Controller, Event};
use mmacell_proto::state::Motion;
use mmacell_proto::{Command, Mode, RobotPose};

fn main() -> Result<(), Box<dyn core::error::Error>> {
    let address = std::env::args().nth(1).ok_or("usage: home ADDRESS:PORT")?;
    let mut stream = TcpStream::connect(address)?;
    stream.set_nodelay(true)?;
    let mut robot = Controller::<RobotPose>::new(Config::default());
    let home = Command::Move { mode: Mode::Absolute, pose: RobotPose::ORIGIN };
    let mut commands = [Command::Servo { on: true }, home, Command::Status].into_iter();
    robot.send(commands.next().ok_or("nothing to do")?)?;
    let epoch = Instant::now();
    let mut buffer = [0; 64];
    loop {
        while let Some(n) = robot.poll_transmit(epoch.elapsed(), &mut buffer) {
            stream.write_all(buffer.get(..n).unwrap_or_default())?;
        }
        let due = robot.poll_timeout().unwrap_or_default();
        stream.set_read_timeout(Some(due.saturating_sub(epoch.elapsed()).max(Duration::from_millis(1))))?;
        match stream.read(&mut buffer) {
            Ok(0) => robot.handle_disconnect(),
            Ok(n) => robot.handle_input(epoch.elapsed(), buffer.get(..n).unwrap_or_default()),
            Err(e) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
            Err(e) => return Err(e.into()),
        }
        robot.handle_timeout(epoch.elapsed());
        while let Some(event) = robot.poll_event() {
            println!("{event:?}");
            match event {
                Event::Done { .. } => robot.send(commands.next().ok_or("told it all")?)?,
                Event::Status { motion: Motion::Still, .. } => return Ok(()),
                Event::Status { .. } => {
                    std::thread::sleep(Duration::from_millis(50));
                    robot.send(Command::Status)?;
                }
                other => return Err(format!("{other:?}").into()),
            }
        }
    }
}
