//! Our session, on a serial line.
#![no_std]
#![no_main]

use fanuc_hmi_modbus::ServerConfig;

#[cortex_m_rt::entry]
fn main() -> ! {
    modbus_peers::run(false, modbus_peers::ours::session(ServerConfig::rtu(modbus_peers::UNIT, 19_200)))
}
