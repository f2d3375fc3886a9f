//! Sends a robot home and waits until it has arrived: `cargo run -p mmacell-proto --features std --example home --
//! 192.168.0.1:2001`

#![allow(clippy::disallowed_methods, clippy::disallowed_types, reason = "the driver loop is where I/O is")]

use core::ops::ControlFlow;
use core::time::Duration;
use std::net::TcpStream;

use mmacell_proto::robot_session::{EndReason, drive};
use mmacell_proto::{Central, CentralConfig, CentralEvent, Command, Mode, Progress, RobotPose};

fn main() -> Result<(), Box<dyn core::error::Error>> {
    let address = std::env::args().nth(1).ok_or("usage: home ADDRESS:PORT")?;
    let stream = TcpStream::connect(address)?;
    stream.set_nodelay(true)?;
    let mut robot = Central::<RobotPose>::new(CentralConfig::default())?;
    let home = Command::Move { mode: Mode::Absolute, pose: RobotPose::ORIGIN };
    let mut commands = [Command::Servo { on: true }, home].into_iter();
    let ended = drive(&mut robot, stream, |robot, event| {
        println!("{event:?}");
        match event {
            CentralEvent::Status { motion: Progress::Arrived, .. } => return ControlFlow::Break(Ok(())),
            CentralEvent::Status { motion: Progress::Missed(miss), .. } => {
                return ControlFlow::Break(Err(format!("{miss:?}")));
            }
            CentralEvent::Connected | CentralEvent::Done { .. } => {}
            CentralEvent::Status { .. } => std::thread::sleep(Duration::from_millis(50)),
            other => return ControlFlow::Break(Err(format!("{other:?}"))),
        }
        match robot.request(commands.next().unwrap_or(Command::Status)) {
            Ok(()) => ControlFlow::Continue(()),
            Err(error) => ControlFlow::Break(Err(error.to_string())),
        }
    })?;
    match ended {
        EndReason::ByHandler(result) => Ok(result?),
        EndReason::ByPeer => Err("the robot has closed the connection".into()),
        EndReason::Stalled => Err("the robot does not read".into()),
    }
}
