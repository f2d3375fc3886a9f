//! A Modbus server over TCP.
#![no_std]
#![no_main]

use core::hint::black_box;

use fanuc_hmi_modbus::robot_session::Session as _;
use fanuc_hmi_modbus::{Exception, Registers, Server, ServerConfig, Tcp, WordsMut};

struct Board;

impl Registers for Board {
    fn read_holding_registers(&mut self, _: u16, out: &mut WordsMut<'_>) -> Result<(), Exception> {
        out.copy_from(&black_box([1; 37]));
        Ok(())
    }
}

#[unsafe(no_mangle)]
extern "C" fn main() -> i32 {
    let Ok(mut session) = Server::<_, 1, Tcp>::new(ServerConfig::tcp(), Board) else { return 1 };
    no_std::run(&mut session, &mut [0; Server::<Board, 1, Tcp>::MAX_TRANSMIT], |_, _| {})
}
