//! A server's registers, and what a client tells, for the tests of the sessions.
#![allow(dead_code, unreachable_pub, missing_debug_implementations, reason = "a helper of several tests")]

use core::time::Duration;

use fanuc_hmi_modbus::client::{self, Event, Failure, Ticket};
use fanuc_hmi_modbus::{
    Bits, BitsMut, Client, DecodeError, Exception, Frame, Mismatch, Registers, Reply, Request, Words,
    WordsMut,
};

pub const MS: Duration = Duration::from_millis(1);

/// 100 of everything from address 0; coils and holding registers can be written.
pub struct Bank {
    pub coils: [bool; 100],
    pub holding: [u16; 100],
    pub writes: Vec<(u16, u16)>,
}

impl Bank {
    pub fn new() -> Self {
        Self {
            coils: core::array::from_fn(|i| i % 3 == 0),
            holding: core::array::from_fn(|i| i as u16 * 7),
            writes: Vec::new(),
        }
    }
}

fn slice<T>(all: &mut [T], address: u16, len: usize) -> Result<&mut [T], Exception> {
    all.get_mut(usize::from(address)..usize::from(address) + len).ok_or(Exception::IllegalDataAddress)
}

impl Registers for Bank {
    fn read_coils(&mut self, address: u16, out: &mut BitsMut<'_>) -> Result<(), Exception> {
        let bits = slice(&mut self.coils, address, out.len())?;
        out.fill_with(|i| bits[i]);
        Ok(())
    }
    fn read_discrete_inputs(&mut self, address: u16, out: &mut BitsMut<'_>) -> Result<(), Exception> {
        let bits = slice(&mut self.coils, address, out.len())?;
        out.fill_with(|i| !bits[i]);
        Ok(())
    }
    fn read_holding_registers(&mut self, address: u16, out: &mut WordsMut<'_>) -> Result<(), Exception> {
        out.copy_from(slice(&mut self.holding, address, out.len())?);
        Ok(())
    }
    fn read_input_registers(&mut self, address: u16, out: &mut WordsMut<'_>) -> Result<(), Exception> {
        let words = slice(&mut self.holding, address, out.len())?;
        out.fill_with(|i| !words[i]);
        Ok(())
    }
    fn write_coils(&mut self, address: u16, values: Bits<'_>) -> Result<(), Exception> {
        values.copy_to(slice(&mut self.coils, address, values.len())?);
        Ok(())
    }
    fn write_registers(&mut self, address: u16, values: Words<'_>) -> Result<(), Exception> {
        values.copy_to(slice(&mut self.holding, address, values.len())?);
        self.writes.extend((address..).zip(values.iter()));
        Ok(())
    }
    fn other(&mut self, function: u8, data: &[u8], out: &mut [u8]) -> Result<usize, Exception> {
        if function != 65 {
            return Err(Exception::IllegalFunction);
        }
        out[..data.len()].copy_from_slice(data);
        Ok(data.len())
    }
}

/// What a client's event says, without its borrow.
#[derive(Debug, Clone, PartialEq)]
pub enum Told {
    Registers(Ticket, Vec<u16>),
    Written(Ticket),
    Exception(Ticket, Exception),
    Announced(Ticket),
    Failed(Ticket, Failure),
    Stray { function: u8, late: Option<Ticket>, mismatch: Option<Mismatch> },
    Damaged(DecodeError),
}

pub fn told(event: Event<'_>) -> Told {
    match event {
        Event::Reply { ticket, reply: Reply::HoldingRegisters(words), .. } => {
            Told::Registers(ticket, words.iter().collect())
        }
        Event::Reply { ticket, reply: Reply::Exception { exception, .. }, .. } => {
            Told::Exception(ticket, exception)
        }
        Event::Reply { ticket, .. } => Told::Written(ticket),
        Event::Announced { ticket } => Told::Announced(ticket),
        Event::Failed { ticket, failure } => Told::Failed(ticket, failure),
        Event::Stray { function, late, mismatch, .. } => Told::Stray { function, late, mismatch },
        Event::Damaged(error) => Told::Damaged(error),
        event => panic!("{event:?}"),
    }
}

pub fn all<const N: usize>(client: &mut Client<N>) -> Vec<Told> {
    core::iter::from_fn(|| client.poll_event().map(told)).collect()
}

pub fn sent<const N: usize>(client: &mut Client<N>, now: Duration) -> Vec<Vec<u8>> {
    let mut out = [0; 260];
    core::iter::from_fn(|| client.poll_transmit(now, &mut out).map(|len| out[..len].to_vec())).collect()
}

pub fn read(address: u16, quantity: u16) -> Request<'static> {
    Request::ReadHoldingRegisters { address, quantity }
}

pub fn tcp(in_flight: usize) -> client::Config {
    let mut config = client::Config::tcp();
    config.in_flight = in_flight;
    config
}

pub fn bytes<P: fanuc_hmi_modbus::Pdu>(transaction: Option<u16>, unit: u8, pdu: P) -> Vec<u8> {
    let mut out = [0; 260];
    let len = Frame { transaction, unit, pdu }.encode(&mut out).unwrap();
    out[..len].to_vec()
}
