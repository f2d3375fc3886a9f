//! fanuc-hmi-modbus: its session, and its codec alone.

use core::time::Duration;

use fanuc_hmi_modbus::robot_session::{Session as _, Step, Steps};
use fanuc_hmi_modbus::{Exception, Frame, Registers, Server, ServerConfig, Words, WordsMut};

use crate::{BUFFER_LEN, REGISTERS, UNIT, fail};

struct Bank([u16; REGISTERS]);

impl Registers for Bank {
    fn read_holding_registers(&mut self, address: u16, out: &mut WordsMut<'_>) -> Result<(), Exception> {
        let first = usize::from(address);
        out.copy_from(self.0.get(first..first + out.len()).ok_or(Exception::IllegalDataAddress)?);
        Ok(())
    }

    fn write_registers(&mut self, address: u16, values: Words<'_>) -> Result<(), Exception> {
        let first = usize::from(address);
        let to = self.0.get_mut(first..first + values.len()).ok_or(Exception::IllegalDataAddress)?;
        values.copy_to(to);
        Ok(())
    }
}

/// Serves a request as a board does: the bytes, on a serial line the silence after them, and all outputs.
pub fn session(config: ServerConfig) -> impl FnMut(&[u8], &mut [u8; BUFFER_LEN]) -> usize {
    let Ok(mut server) = Server::<_, 1>::new(config, Bank([0; REGISTERS])) else { fail() };
    let mut now = Duration::ZERO;
    server.handle_connected(now);
    move |request, reply| {
        server.handle_input(now, request);
        if let Some(silent_at) = server.poll_timeout() {
            now = silent_at;
            server.handle_timeout(now);
        }
        let mut length = 0;
        let mut steps = Steps::NEW;
        loop {
            match steps.next(&mut server, now, reply) {
                Step::Event(_) => {}
                Step::Write(bytes) => length = bytes.len(),
                Step::Wait { .. } => return length,
            }
        }
    }
}

/// Returns a server of frames that are known to be whole.
pub fn codec_rtu() -> impl FnMut(&[u8], &mut [u8; BUFFER_LEN]) -> usize {
    let mut bank = Bank([0; REGISTERS]);
    move |request, reply| match Frame::decode_rtu_whole(request) {
        Ok(frame) if frame.unit == UNIT => frame.serve(&mut bank, reply).unwrap_or(0),
        _ => 0,
    }
}

/// Returns a server of the frame at the beginning of a stream.
pub fn codec_tcp() -> impl FnMut(&[u8], &mut [u8; BUFFER_LEN]) -> usize {
    let mut bank = Bank([0; REGISTERS]);
    move |request, reply| match Frame::decode_tcp(request) {
        Ok(Some((frame, _))) if frame.unit == UNIT => frame.serve(&mut bank, reply).unwrap_or(0),
        _ => 0,
    }
}
