//! A Modbus client over TCP.
#![no_std]
#![no_main]

use fanuc_hmi_modbus::robot_session::Session as _;
use fanuc_hmi_modbus::{Client, ClientConfig, Tcp, TelemetryBlock};

#[unsafe(no_mangle)]
extern "C" fn main() -> i32 {
    let Ok(mut session) = Client::<1, Tcp>::new(ClientConfig::tcp()) else { return 1 };
    no_std::run(&mut session, &mut [0; Client::<1, Tcp>::MAX_TRANSMIT], |session, _| {
        let _ = session.request(1, &TelemetryBlock::request());
    })
}
