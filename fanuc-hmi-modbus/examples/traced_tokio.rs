//! Polls ten registers, and prints the events of the connection that `RUST_LOG` selects, `info` at first:
//! `RUST_LOG=robot_session=debug cargo run -p fanuc-hmi-modbus --features tokio --example traced_tokio -- 192.168.0.10:502`
#![allow(clippy::disallowed_methods, clippy::disallowed_types, reason = "the program sets the pace")]

use core::time::Duration;

use fanuc_hmi_modbus::ClientConfig;
use fanuc_hmi_modbus::robot_session::tokio::Tcp;
use fanuc_hmi_modbus::tokio::{Error, client};
use tracing_subscriber::EnvFilter;

#[tokio::main(flavor = "current_thread")]
async fn main() -> Result<(), Box<dyn core::error::Error>> {
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| "info".into());
    tracing_subscriber::fmt().with_env_filter(filter).init();
    let address = std::env::args().nth(1).ok_or("usage: HOST:PORT")?;
    let (robot, task) = client(ClientConfig::tcp(), Tcp::new(address))?;
    tokio::spawn(task.run());
    loop {
        // The records have all other outcomes.
        if let Err(Error::Closed(closed)) = robot.read_holding_registers(0..10).await {
            return Err(closed.into());
        }
        tokio::time::sleep(Duration::from_secs(1)).await;
    }
}
