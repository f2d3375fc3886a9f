//! The client in a task of its own, which reconnects automatically: requests by `.await`, from any task or thread.
//!
//! ```no_run
//! use fanuc_hmi_modbus::robot_session::tokio::Tcp;
//! use fanuc_hmi_modbus::{ClientConfig, TelemetryBlock, WordOrder};
//!
//! # async fn run() -> Result<(), Box<dyn core::error::Error>> {
//! let (robot, task) = fanuc_hmi_modbus::tokio::client(ClientConfig::tcp(), Tcp::new("192.168.0.10:502"))?;
//! tokio::spawn(task.run());
//! let block = robot.read_telemetry(TelemetryBlock::ADDRESS, WordOrder::LowFirst).await?;
//! robot.write_registers(100, &[1, 2, 3]).await?;
//! # Ok(()) }
//! ```

mod device;
mod service;

use core::ops::{Bound, RangeBounds};
use std::boxed::Box;
use std::io;
use std::string::String;
use std::sync::Arc;
use std::vec;
use std::vec::Vec;

use robot_session::now;
use robot_session::tokio::{self as session, Closed, Connector, Handle, Task};

use crate::block::TelemetryBlock;
use crate::client::{ClientConfig, ClientEvent, Failure, Ticket};
use crate::error::{ConfigError, EncodeError, Mismatch, SessionError, TextError};
pub use crate::many::Block;
use crate::many::join;
use crate::message::function::Row;
use crate::message::{Bits, Exception, PduBuf, Reply, Request, Words};
use crate::position::PositionRegister;
use crate::text;
use crate::typed::{Number, NumberError, WordOrder};

/// Sends requests to a server. Cloning it is cheap, and all clones may make requests at the same time. At most
/// [`ClientConfig::in_flight`] requests are in flight, the others wait, the oldest first.
///
/// Addresses are ranges: `0..37`, and `65530..=65535` at the end of a table.
///
/// Every method returns the reply, or an [`Error`]. A request that is refused because of its form is not made. If the future
/// of a request is [dropped](Handle#dropped-futures) while the request is in flight, its outcome is an [`Event::Abandoned`].
#[derive(Debug, Clone)]
pub struct Client {
    handle: Handle<Requests>,
    unit: u8,
}

/// Returns a client for unit 1, and its task. Addresses are PDU addresses: 0 is the first coil or register of a table.
///
/// On TCP another connection is made when the server is [out of step](ClientEvent::OutOfStep), or has truncated a reply.
///
/// # Errors
/// As [`Client::new`](crate::Client::new).
pub fn client<C: Connector>(
    config: ClientConfig,
    connector: C,
) -> Result<(Client, Task<Requests, C>), ConfigError> {
    let session = crate::Client::new(config)?;
    let (handle, task) = session::spawn(session, Requests { made: Vec::new() }, connector);
    Ok((Client { handle, unit: 1 }, task))
}

/// The service of the task: it passes on requests, and gives replies to their callers.
#[derive(Debug)]
pub struct Requests {
    made: Vec<(Ticket, PendingRequest)>,
}

/// A submitted request, and the channel of its reply.
#[derive(Debug)]
pub struct PendingRequest {
    unit: u8,
    /// The request, which its reply replaces. Boxed, because it moves through two channels.
    pdu: Box<PduBuf>,
    reply: session::Reply<Result<Box<PduBuf>, Error>>,
}

/// Events that are not the outcome of an awaited request.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub enum Event {
    /// The outcome of a request whose future was dropped while it was in flight.
    Abandoned(Box<AbandonedRequest>),
    /// A notice of the session, for a log.
    Notice(ClientEvent),
}

/// A request that is no longer awaited.
#[derive(Debug, Clone)]
pub struct AbandonedRequest {
    /// The unit that the request was sent to.
    pub unit: u8,
    /// The PDU of the request.
    pub request: PduBuf,
    /// The reply, or the reason that there is no reply.
    pub outcome: Result<PduBuf, Error>,
}

/// The reason that a request has no usable reply.
#[derive(Debug, Clone, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The caller's fault; nothing was sent.
    #[error(transparent)]
    Request(#[from] SessionError),
    /// The registers cannot hold the number; nothing was sent.
    #[error(transparent)]
    Number(#[from] NumberError),
    /// The registers cannot hold the string; nothing was sent.
    #[error(transparent)]
    Text(#[from] TextError),
    /// There is no connection, and the attempt to make one has failed; nothing was sent.
    #[error("not connected: {0}")]
    NotConnected(Arc<io::Error>),
    /// The server refuses the request.
    #[error("the server refuses the request: {0}")]
    Exception(Exception),
    /// There is no usable reply.
    #[error(transparent)]
    Failed(#[from] Failure),
    /// The client was shut down. Whether the request was executed is unknown.
    #[error(transparent)]
    Closed(#[from] Closed),
}

impl Error {
    /// Returns whether the server may have executed the request, or may still execute it.
    pub const fn is_unknown(&self) -> bool {
        match self {
            Self::Failed(failure) => failure.is_unknown(),
            Self::Closed(_) => true,
            Self::Request(_)
            | Self::Number(_)
            | Self::Text(_)
            | Self::NotConnected(_)
            | Self::Exception(_) => false,
        }
    }
}

impl From<EncodeError> for Error {
    fn from(error: EncodeError) -> Self {
        Self::Request(error.into())
    }
}

impl Client {
    /// Returns the same client, for another unit.
    #[must_use]
    pub fn unit(&self, unit: u8) -> Self {
        Self { unit, ..self.clone() }
    }

    /// Returns the generic handle: events, the state of the connection, shutdown.
    pub const fn handle(&self) -> &Handle<Requests> {
        &self.handle
    }

    /// Reads up to 2000 coils (function 1).
    pub async fn read_coils(&self, addresses: impl RangeBounds<u16>) -> Result<Vec<bool>, Error> {
        let (address, quantity) = run(&addresses);
        self.bits(&Request::ReadCoils { address, quantity }).await
    }

    /// Reads up to 2000 discrete inputs (function 2).
    pub async fn read_discrete_inputs(&self, addresses: impl RangeBounds<u16>) -> Result<Vec<bool>, Error> {
        let (address, quantity) = run(&addresses);
        self.bits(&Request::ReadDiscreteInputs { address, quantity }).await
    }

    /// Reads up to 125 holding registers (function 3).
    pub async fn read_holding_registers(&self, addresses: impl RangeBounds<u16>) -> Result<Vec<u16>, Error> {
        let (address, quantity) = run(&addresses);
        self.words(&Request::ReadHoldingRegisters { address, quantity }).await
    }

    /// Reads several ranges of holding registers by function 3, in as few requests as the limit of 125 registers allows, one
    /// after the other. A range of up to 125 registers is read by one request; others that are at most `gap` registers away
    /// are read with it. With a gap, the server must have the registers between them too.
    ///
    /// ```no_run
    /// # async fn run(robot: fanuc_hmi_modbus::tokio::Client) -> Result<(), fanuc_hmi_modbus::tokio::Error> {
    /// let blocks = robot.read_many(&[0..37, 40..42, 500..510], 8).await?; // two requests
    /// let [telemetry, parts, recipe] = &blocks[..] else { unreachable!("one for each range") };
    /// assert_eq!(telemetry.at, parts.at); // of one request
    /// # Ok(()) }
    /// ```
    ///
    /// # Errors
    /// The [`Error`] of the first request that fails: the others are not made.
    pub async fn read_many(&self, ranges: &[impl RangeBounds<u16>], gap: u16) -> Result<Vec<Block>, Error> {
        let ranges: Vec<_> = ranges
            .iter()
            .map(|range| run(range))
            .map(|(address, quantity)| u32::from(address)..u32::from(address) + u32::from(quantity))
            .collect();
        let mut blocks = vec![Block { registers: Vec::new(), at: now() }; ranges.len()];
        for joined in join(&ranges, gap) {
            let [first, end] = [joined.addresses.start, joined.addresses.end];
            let address = u16::try_from(first).unwrap_or(u16::MAX);
            let quantity = u16::try_from(end - first).unwrap_or(u16::MAX);
            let words = self.words(&Request::ReadHoldingRegisters { address, quantity }).await?;
            let at = now();
            for place in &joined.ranges {
                if let (Some(block), Some(range)) = (blocks.get_mut(*place), ranges.get(*place)) {
                    block.registers.extend_from_slice(joined.part_of(range, &words));
                    block.at = at;
                }
            }
        }
        Ok(blocks)
    }

    /// Reads up to 125 input registers (function 4).
    pub async fn read_input_registers(&self, addresses: impl RangeBounds<u16>) -> Result<Vec<u16>, Error> {
        let (address, quantity) = run(&addresses);
        self.words(&Request::ReadInputRegisters { address, quantity }).await
    }

    /// Reads the telemetry block whose first holding register has this address: 37 registers.
    /// [`Assignment::TELEMETRY`](crate::Assignment::TELEMETRY) has it at [`TelemetryBlock::ADDRESS`].
    pub async fn read_telemetry(&self, address: u16, order: WordOrder) -> Result<TelemetryBlock, Error> {
        let request = Request::ReadHoldingRegisters { address, quantity: TelemetryBlock::QUANTITY };
        let words = self.words(&request).await?;
        TelemetryBlock::from_words(&Words::from(words.as_slice()), order).ok_or(misfit(&request, &words))
    }

    /// Reads the position register whose first holding register has this address: 50 registers.
    pub async fn read_position(&self, address: u16, order: WordOrder) -> Result<PositionRegister, Error> {
        let request = PositionRegister::request(address);
        let words = self.words(&request).await?;
        PositionRegister::from_words(&Words::from(words.as_slice()), order).ok_or(misfit(&request, &words))
    }

    /// Reads the numeric variable whose first holding register has this address. `number` is its assignment:
    /// [`Kind`](crate::typed::Kind) lists the `$VAR_NAME` and the `$MULTIPLY` of each kind.
    pub async fn read_number(&self, address: u16, number: Number) -> Result<f64, Error> {
        let quantity = number.kind.registers();
        let request = Request::ReadHoldingRegisters { address, quantity };
        match *self.words(&request).await?.as_slice() {
            [word] => Ok(number.read([word, 0])),
            [first, second] => Ok(number.read([first, second])),
            ref words => Err(misfit(&request, words)),
        }
    }

    /// Reads the string, alarm or program name in these holding registers, two characters each, up to the first NUL: that of
    /// an assignment with `$MULTIPLY` −1. A string register takes [`text::QUANTITY`] registers. Bytes that are not UTF-8 are
    /// read as Latin-1.
    pub async fn read_text(&self, addresses: impl RangeBounds<u16>) -> Result<String, Error> {
        let words = self.read_holding_registers(addresses).await?;
        let mut bytes = vec![0; 2 * words.len()];
        let length = text::read(&words, &mut bytes);
        bytes.truncate(length);
        Ok(String::from_utf8(bytes)
            .unwrap_or_else(|error| error.as_bytes().iter().copied().map(char::from).collect()))
    }

    /// Writes a numeric variable in one request; the other arguments are those of [`read_number`](Self::read_number). If it
    /// is assigned as an integer, the value is rounded to it.
    ///
    /// # Errors
    /// [`Error::Number`] if the registers cannot hold the value: nothing is sent.
    pub async fn write_number(&self, address: u16, number: Number, value: f64) -> Result<(), Error> {
        let words = number.write(value)?;
        let quantity = usize::from(number.kind.registers());
        self.write_registers(address, words.get(..quantity).unwrap_or(&words)).await
    }

    /// Writes a string in one request: its bytes, then NULs up to the end of these registers. [`read_text`](Self::read_text)
    /// reads it.
    ///
    /// # Errors
    /// [`Error::Text`] if the string is longer than two bytes per register, or has a NUL in it: nothing is sent.
    pub async fn write_text(&self, addresses: impl RangeBounds<u16>, text: &str) -> Result<(), Error> {
        let (address, quantity) = run(&addresses);
        let mut words = vec![0; quantity.into()];
        text::write(text.as_bytes(), &mut words)?;
        self.write_registers(address, &words).await
    }

    /// Writes a position register in one request.
    pub async fn write_position(
        &self,
        address: u16,
        position: &PositionRegister,
        order: WordOrder,
    ) -> Result<(), Error> {
        self.write_registers(address, &position.to_registers(order)).await
    }

    /// Writes one coil (function 5).
    pub async fn write_coil(&self, address: u16, value: bool) -> Result<(), Error> {
        self.request(&Request::WriteCoil { address, value }).await.map(drop)
    }

    /// Writes 1 to 1968 coils (function 15).
    pub async fn write_coils(&self, address: u16, values: &[bool]) -> Result<(), Error> {
        self.request(&Request::WriteCoils { address, values: Bits::from(values) }).await.map(drop)
    }

    /// Writes one holding register (function 6).
    pub async fn write_register(&self, address: u16, value: u16) -> Result<(), Error> {
        self.request(&Request::WriteRegister { address, value }).await.map(drop)
    }

    /// Writes 1 to 123 holding registers (function 16).
    pub async fn write_registers(&self, address: u16, values: &[u16]) -> Result<(), Error> {
        self.request(&Request::WriteRegisters { address, values: Words::from(values) }).await.map(drop)
    }

    /// Sets a register to (register AND `and`) OR (`or` AND NOT `and`) (function 22).
    pub async fn mask_write_register(&self, address: u16, and: u16, or: u16) -> Result<(), Error> {
        self.request(&Request::MaskWriteRegister { address, and, or }).await.map(drop)
    }

    /// Writes 1 to 121 registers from an address on, then reads up to 125 (function 23).
    pub async fn read_write_registers(
        &self,
        addresses: impl RangeBounds<u16>,
        write_address: u16,
        values: &[u16],
    ) -> Result<Vec<u16>, Error> {
        let ((address, quantity), values) = (run(&addresses), Words::from(values));
        self.words(&Request::ReadWriteRegisters { address, quantity, write_address, values }).await
    }

    /// Sends any request, and returns the reply as a PDU, which is not an exception. For a broadcast, which has no reply,
    /// returns the request.
    pub async fn request(&self, request: &Request<'_>) -> Result<PduBuf, Error> {
        self.ask(request).await.map(|pdu| *pdu)
    }

    async fn ask(&self, request: &Request<'_>) -> Result<Box<PduBuf>, Error> {
        let (unit, pdu) = (self.unit, Box::new(PduBuf::new(request)?));
        self.handle.call(|reply| PendingRequest { unit, pdu, reply }).await?
    }

    /// Makes a request, and reads its reply.
    async fn read<T>(
        &self,
        request: &Request<'_>,
        read: impl FnOnce(Reply<'_>) -> Option<T>,
    ) -> Result<T, Error> {
        let pdu = self.ask(request).await?;
        pdu.reply().ok().and_then(read).ok_or_else(|| misfit(request, &[]))
    }

    async fn words(&self, request: &Request<'_>) -> Result<Vec<u16>, Error> {
        let words = |reply: Reply<'_>| match reply {
            Reply::HoldingRegisters(words)
            | Reply::InputRegisters(words)
            | Reply::ReadWriteRegisters(words)
            | Reply::FifoQueue(words)
            | Reply::Diagnostics { data: words, .. } => Some(words.to_vec()),
            _ => None,
        };
        self.read(request, words).await
    }

    async fn bits(&self, request: &Request<'_>) -> Result<Vec<bool>, Error> {
        let bits = |reply: Reply<'_>| match reply {
            Reply::Coils(bits) | Reply::DiscreteInputs(bits) => {
                Some(bits.iter().take(request.quantity_read().into()).collect())
            }
            _ => None,
        };
        self.read(request, bits).await
    }
}

/// Returns the first address and the number of addresses. A range that ends before it begins is empty.
fn run(addresses: &impl RangeBounds<u16>) -> (u16, u16) {
    let first = match addresses.start_bound() {
        Bound::Included(first) => *first,
        Bound::Excluded(before) => before.saturating_add(1),
        Bound::Unbounded => 0,
    };
    let end = match addresses.end_bound() {
        Bound::Included(last) => u32::from(*last) + 1,
        Bound::Excluded(end) => u32::from(*end),
        Bound::Unbounded => 0x1_0000,
    };
    (first, u16::try_from(end.saturating_sub(first.into())).unwrap_or(u16::MAX))
}

/// Returns the error of a reply that does not fit, although the client has checked that it does.
fn misfit(request: &Request<'_>, found: &[u16]) -> Error {
    let expected = Row::of(request.function()).bytes(request.quantity_read()).into();
    Failure::Refused(Mismatch::Quantity { expected, found: size_of_val(found) }).into()
}
