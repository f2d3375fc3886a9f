//! Moves a robot home, and prints its status: `cargo run -p mmacell-proto --features tokio --example home_tokio --
//! 192.168.0.1:2001`

use mmacell_proto::robot_session::tokio::Tcp;
use mmacell_proto::tokio::central;
use mmacell_proto::{CentralConfig, Command, RobotPose};

#[tokio::main(flavor = "current_thread")]
async fn main() -> Result<(), Box<dyn core::error::Error>> {
    let address = std::env::args().nth(1).ok_or("usage: HOST:PORT")?;
    let (robot, task) = central(CentralConfig::DEFAULT, Tcp::new(address))?;
    tokio::spawn(task.run());
    robot.command(Command::Servo { on: true }).await?;
    robot.command(Command::Override { percent: 20 }).await?;
    println!("{:?}", robot.move_to(RobotPose::ORIGIN).await?);
    robot.command(Command::Close).await?;
    Ok(())
}
