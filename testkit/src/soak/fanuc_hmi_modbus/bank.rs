//! The registers of the server, and the reads and writes of the client.

use fanuc_hmi_modbus::{Bits, BitsMut, Exception, Registers, Reply, Words, WordsMut};

/// A write request: the address and the values. Coils are 0 and 1.
pub(super) type Write = (u16, Vec<u16>);

/// Every register has the value that [`held`] gives; writes are kept as a list.
#[derive(Debug, Default)]
pub(super) struct Bank {
    pub(super) writes: Vec<Write>,
}

/// From here on registers look like the refusal of function 23.
pub(super) const REFUSALS: u16 = 60_000;

pub(super) fn held(address: u16, index: usize) -> u16 {
    if address >= REFUSALS {
        return [0x0197, 0x02CF, 0xF107][index % 3];
    }
    ((address as usize + index) as u16).wrapping_mul(7).wrapping_add(3)
}

impl Registers for Bank {
    fn read_coils(&mut self, address: u16, out: &mut BitsMut<'_>) -> Result<(), Exception> {
        out.fill_with(|i| held(address, i) & 4 != 0);
        Ok(())
    }
    fn read_holding_registers(&mut self, address: u16, out: &mut WordsMut<'_>) -> Result<(), Exception> {
        out.fill_with(|i| held(address, i));
        Ok(())
    }
    fn write_coils(&mut self, address: u16, values: Bits<'_>) -> Result<(), Exception> {
        self.writes.push((address, values.iter().map(u16::from).collect()));
        Ok(())
    }
    fn write_registers(&mut self, address: u16, values: Words<'_>) -> Result<(), Exception> {
        self.writes.push((address, values.iter().collect()));
        Ok(())
    }
}

/// The contents of a request.
#[derive(Debug, Clone)]
pub(super) enum Asked {
    Write(Write),
    Coils(u16, usize),
    Registers(u16, usize),
    /// An address that this server does not have.
    Refusal,
}

pub(super) fn is_held(asked: &Asked, reply: &Reply<'_>) -> bool {
    match (asked, reply) {
        (Asked::Coils(address, count), Reply::Coils(bits)) => {
            bits.len() == *count
                && bits.iter().enumerate().all(|(i, bit)| bit == (held(*address, i) & 4 != 0))
        }
        (Asked::Registers(address, count), Reply::HoldingRegisters(words)) => {
            words.len() == *count && words.iter().enumerate().all(|(i, word)| word == held(*address, i))
        }
        _ => false,
    }
}
