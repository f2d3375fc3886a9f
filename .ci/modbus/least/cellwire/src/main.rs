//! Reads 37 registers of the server that the first argument names.

use fanuc_hmi_modbus::ClientConfig;
use fanuc_hmi_modbus::robot_session::tokio::Tcp;
use fanuc_hmi_modbus::tokio::client;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let address = std::env::args().nth(1).ok_or("no address")?;
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    runtime.block_on(async {
        let (client, task) = client(ClientConfig::tcp(), Tcp::new(address))?;
        tokio::spawn(task.run());
        println!("{:?}", client.read_holding_registers(0..37).await?);
        Ok(())
    })
}
