//! Prints the telemetry block of a robot ten times a second, and goes on after every fault:
//! `cargo run -p fanuc-hmi-modbus --features tokio --example telemetry_tokio -- 192.168.0.10:502`
#![allow(clippy::disallowed_methods, clippy::disallowed_types, reason = "the program sets the pace")]

use core::time::Duration;

use fanuc_hmi_modbus::robot_session::tokio::Tcp;
use fanuc_hmi_modbus::tokio::{Error, client};
use fanuc_hmi_modbus::{ClientConfig, TelemetryBlock, WordOrder};

#[tokio::main(flavor = "current_thread")]
async fn main() -> Result<(), Box<dyn core::error::Error>> {
    let address = std::env::args().nth(1).ok_or("usage: HOST:PORT")?;
    let (robot, task) = client(ClientConfig::tcp(), Tcp::new(address))?;
    tokio::spawn(task.run());
    loop {
        match robot.read_telemetry(TelemetryBlock::ADDRESS, WordOrder::LowFirst).await {
            Ok(block) => println!("{block:?}"),
            Err(Error::Closed(closed)) => return Err(closed.into()),
            Err(error) => println!("{error}"),
        }
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
}
