//! Reads 37 registers of the server that the first argument names.

use std::time::Duration;

use voltage_modbus::{ModbusClient as _, ModbusTcpClient};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let address = std::env::args().nth(1).ok_or("no address")?;
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    runtime.block_on(async {
        let mut client = ModbusTcpClient::from_address(&address, Duration::from_secs(1)).await?;
        println!("{:?}", client.read_03(1, 0, 37).await?);
        Ok(())
    })
}
