//! modbus-core, RTU.
#![no_std]
#![no_main]

#[cortex_m_rt::entry]
fn main() -> ! {
    modbus_peers::run(false, modbus_peers::modbus_core::serve_rtu())
}
