//! Reads 37 registers of the server that the first argument names.

use std::time::Duration;

use tokio::net::TcpStream;
use tokio::time::timeout;
use tokio_modbus::Slave;
use tokio_modbus::client::{Reader as _, tcp};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let address = std::env::args().nth(1).ok_or("no address")?;
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    runtime.block_on(async {
        let mut client = tcp::attach_slave(TcpStream::connect(address).await?, Slave(1));
        println!("{:?}", timeout(Duration::from_secs(1), client.read_holding_registers(0, 37)).await???);
        Ok(())
    })
}
