//! A server's registers, and a client's events, for the tests of the sessions.
#![allow(unreachable_pub, missing_debug_implementations, reason = "a helper of several tests")]

use core::time::Duration;

use fanuc_hmi_modbus::robot_session::end::End as _;
use fanuc_hmi_modbus::robot_session::{Encode as _, Session};
use fanuc_hmi_modbus::timing::transmission_time;
use fanuc_hmi_modbus::{
    Bits, BitsMut, Client, ClientConfig, ClientEvent, DecodeError, Exception, Failure, Frame, Mismatch,
    Registers, Reply, Request, Server, ServerConfig, Ticket, Words, WordsMut,
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
            holding: core::array::from_fn(|i| u16::try_from(i).unwrap() * 7),
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

/// An event of a client, with the reply.
#[derive(Debug, Clone, PartialEq)]
pub enum Seen {
    Registers(Ticket, Vec<u16>),
    Written(Ticket),
    Exception(Ticket, Exception),
    Announced(Ticket),
    Failed(Ticket, Failure),
    Stray { function: u8, late: Option<Ticket>, mismatch: Option<Mismatch> },
    Corrupt(DecodeError),
    OutOfStep(DecodeError),
    Unexpected(&'static str, &'static str),
}

pub fn seen<const N: usize>(client: &Client<N>, event: ClientEvent) -> Seen {
    match event {
        ClientEvent::Replied { ticket, .. } => match client.reply(ticket).expect("a reply") {
            Reply::HoldingRegisters(words) => Seen::Registers(ticket, words.iter().collect()),
            Reply::Exception { exception, .. } => Seen::Exception(ticket, exception),
            _ => Seen::Written(ticket),
        },
        ClientEvent::Announced { ticket } => Seen::Announced(ticket),
        ClientEvent::Failed { ticket, failure } => Seen::Failed(ticket, failure),
        ClientEvent::Stray { function, late, mismatch, .. } => Seen::Stray { function, late, mismatch },
        ClientEvent::Corrupt(error) => Seen::Corrupt(error),
        ClientEvent::OutOfStep(error) => Seen::OutOfStep(error),
        ClientEvent::Unexpected(it) => Seen::Unexpected(it.state, it.input),
        event => panic!("{event:?}"),
    }
}

pub fn all<const N: usize>(client: &mut Client<N>) -> Vec<Seen> {
    core::iter::from_fn(|| client.poll_event().map(|event| seen(client, event))).collect()
}

pub fn sent<const N: usize>(client: &mut Client<N>, now: Duration) -> Vec<Vec<u8>> {
    transmitted(client, now)
}

pub fn transmitted<S: Session>(session: &mut S, now: Duration) -> Vec<Vec<u8>> {
    let mut out = [0; 260];
    core::iter::from_fn(|| session.poll_transmit(now, &mut out).map(|len| out[..len].to_vec())).collect()
}

/// Creates a client with a connection, and without unsent bytes on its line.
pub fn connected<const N: usize>(config: ClientConfig) -> Client<N> {
    let mut client = Client::new(config).unwrap();
    client.handle_connected(Duration::ZERO);
    client.handle_timeout(config.timeout + config.settle);
    client
}

pub fn read(address: u16, quantity: u16) -> Request<'static> {
    Request::ReadHoldingRegisters { address, quantity }
}

pub fn tcp(in_flight: usize) -> ClientConfig {
    ClientConfig { in_flight, ..ClientConfig::tcp() }
}

/// Returns the configuration of RTU at 19200 baud, with times that are easy to add.
pub fn rtu() -> ClientConfig {
    ClientConfig { timeout: 1000 * MS, turnaround: 100 * MS, settle: 100 * MS, ..ClientConfig::rtu(19_200) }
}

pub fn bytes<P: fanuc_hmi_modbus::Pdu>(transaction: Option<u16>, unit: u8, pdu: P) -> Vec<u8> {
    let mut out = [0; 260];
    let len = Frame { transaction, unit, pdu }.encode(&mut out).unwrap();
    out[..len].to_vec()
}

/// Returns a write of 0BADh to register 10 of a unit.
pub fn write(unit: u8) -> Vec<u8> {
    bytes(None, unit, Request::WriteRegister { address: 10, value: 0x0BAD })
}

/// A server on a line with other units.
pub struct Line {
    pub server: Server<Bank>,
    pub now: Duration,
    pub character: Duration,
}

impl Line {
    pub fn new(baud: u32) -> Self {
        Self::with(ServerConfig::rtu(1, baud), baud)
    }

    pub fn with(config: ServerConfig, baud: u32) -> Self {
        let mut server = Server::new(config, Bank::new()).unwrap();
        server.handle_connected(Duration::ZERO);
        Self { server, now: MS, character: transmission_time(1, baud) }
    }

    /// Sends byte by byte at the rate of the line, with a driver that checks after each byte.
    pub fn send(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.now += self.character;
            self.server.handle_timeout(self.now);
            self.server.handle_input(self.now, &[*byte]);
        }
    }

    /// Sends all bytes in one read.
    pub fn lump(&mut self, bytes: &[u8]) {
        self.server.handle_input(self.now, bytes);
    }

    /// Sends nothing for this time, which the driver observes.
    pub fn pause(&mut self, time: Duration) {
        self.now += time;
        self.server.handle_timeout(self.now);
    }

    /// Waits for the silence that ends a frame; returns the server's answers.
    pub fn silence(&mut self) -> Vec<Vec<u8>> {
        self.pause(self.server.config().framing.silence().unwrap());
        transmitted(&mut self.server, self.now)
    }

    pub fn written(&mut self) -> Vec<(u16, u16)> {
        core::mem::take(&mut self.server.registers_mut().writes)
    }

    /// Lets the rest of an incomplete frame time out.
    pub fn give_up(&mut self) {
        self.pause(self.server.config().frame_timeout);
    }

    /// Checks that a request is served after a silence, and after the rest of an incomplete frame was given up.
    pub fn is_served(&mut self) {
        assert_eq!(self.silence(), [] as [Vec<u8>; 0]);
        self.give_up();
        self.send(&write(1));
        assert_eq!(self.silence(), [write(1)]);
        assert_eq!(self.written(), [(10, 0x0BAD)]);
    }
}
