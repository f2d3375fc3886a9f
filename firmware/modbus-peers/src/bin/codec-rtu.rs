//! Our codec, of RTU.
#![no_std]
#![no_main]

#[cortex_m_rt::entry]
fn main() -> ! {
    modbus_peers::run(false, modbus_peers::ours::codec_rtu())
}
