//! rmodbus: its frame processor and its storage.

use rmodbus::server::ModbusFrame;
use rmodbus::server::storage::ModbusStorage;
use rmodbus::{ErrorKind, ModbusProto, VectorTrait};

use crate::{BUFFER_LEN, REGISTERS, UNIT};

/// The output of its replies, a vector: the cheapest one possible.
struct ReplyBuffer<'a> {
    bytes: &'a mut [u8; BUFFER_LEN],
    length: usize,
}

impl VectorTrait<u8> for ReplyBuffer<'_> {
    fn push(&mut self, value: u8) -> Result<(), ErrorKind> {
        *self.bytes.get_mut(self.length).ok_or(ErrorKind::OOB)? = value;
        self.length += 1;
        Ok(())
    }

    fn extend(&mut self, other: &[u8]) -> Result<(), ErrorKind> {
        let end = self.length + other.len();
        self.bytes.get_mut(self.length..end).ok_or(ErrorKind::OOB)?.copy_from_slice(other);
        self.length = end;
        Ok(())
    }

    fn len(&self) -> usize {
        self.length
    }

    fn is_empty(&self) -> bool {
        self.length == 0
    }

    fn clear(&mut self) {
        self.length = 0;
    }

    fn cut_end(&mut self, len_to_cut: usize, _: u8) {
        self.length = self.length.saturating_sub(len_to_cut);
    }

    fn as_slice(&self) -> &[u8] {
        self.bytes.get(..self.length).unwrap_or_default()
    }

    fn as_mut_slice(&mut self) -> &mut [u8] {
        self.bytes.get_mut(..self.length).unwrap_or_default()
    }

    fn resize(&mut self, new_len: usize, value: u8) -> Result<(), ErrorKind> {
        if let Some(more) = self.bytes.get_mut(self.length..new_len) {
            more.fill(value);
        }
        self.length = new_len.min(BUFFER_LEN);
        Ok(())
    }

    fn replace(&mut self, index: usize, value: u8) {
        if let Some(byte) = self.bytes.get_mut(index) {
            *byte = value;
        }
    }
}

/// Returns a server as in the crate's documentation.
pub fn serve(is_tcp: bool) -> impl FnMut(&[u8], &mut [u8; BUFFER_LEN]) -> usize {
    let mut storage = ModbusStorage::<0, 0, 0, REGISTERS>::new();
    let framing = if is_tcp { ModbusProto::TcpUdp } else { ModbusProto::Rtu };
    move |request, reply| {
        let mut out = ReplyBuffer { bytes: reply, length: 0 };
        let mut frame = ModbusFrame::new(UNIT, request, framing, &mut out);
        if frame.parse().is_err() {
            return 0;
        }
        if frame.processing_required {
            let done = match frame.readonly {
                true => frame.process_read(&storage),
                false => frame.process_write(&mut storage),
            };
            if done.is_err() {
                return 0;
            }
        }
        if !frame.response_required || frame.finalize_response().is_err() {
            return 0;
        }
        out.length
    }
}
