//! Our session, over TCP.
#![no_std]
#![no_main]

use fanuc_hmi_modbus::ServerConfig;

#[cortex_m_rt::entry]
fn main() -> ! {
    let config = ServerConfig { unit: Some(modbus_peers::UNIT), ..ServerConfig::tcp() };
    modbus_peers::run(true, modbus_peers::ours::session(config))
}
