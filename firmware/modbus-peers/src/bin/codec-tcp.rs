//! Our codec, of TCP.
#![no_std]
#![no_main]

#[cortex_m_rt::entry]
fn main() -> ! {
    modbus_peers::run(true, modbus_peers::ours::codec_tcp())
}
