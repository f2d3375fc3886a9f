//! A serial port, or the TCP connection of a serial device server.

use std::io;
use std::time::Duration;

use anyhow::Result;
use robot_session::{ReceiveOutcome, SendOutcome, Serial, Transport, Wait};

use crate::serial::{self, Mode};
use crate::stream::Stream;
use crate::tcp::{self, Dialing};

/// The connection to a device on a serial line.
#[allow(missing_debug_implementations, reason = "it holds a port")]
pub enum AnyPort {
    /// A port of this computer.
    Serial(Serial),
    /// A serial device server.
    Tcp(Stream),
}

impl AnyPort {
    /// Opens `HOST:PORT`, or the path of a serial port.
    ///
    /// # Errors
    /// If it cannot be opened, or the connection takes longer than the timeout.
    pub fn open(name: &str, baud: u32, dialing: Dialing) -> Result<Self> {
        Self::open_with(name, baud, Mode::EIGHT_N_ONE, dialing)
    }

    /// Opens `HOST:PORT`, or the path of a serial port in this mode. Returns after the pause.
    ///
    /// # Errors
    /// As [`open`](Self::open).
    pub fn open_with(name: &str, baud: u32, mode: Mode, dialing: Dialing) -> Result<Self> {
        if !Self::is_serial(name) {
            return Ok(Self::Tcp(Stream::new(tcp::connect(name, dialing)?)));
        }
        let port = Serial(serial::open_with(name, baud, mode)?);
        dialing.pause();
        Ok(Self::Serial(port))
    }

    /// Returns whether a name is the path of a serial port.
    pub fn is_serial(name: &str) -> bool {
        name.contains('/') || !name.contains(':')
    }

    /// Returns whether there are bytes to read at once.
    pub fn is_waiting(&self) -> bool {
        match self {
            Self::Serial(port) => port.0.bytes_to_read().is_ok_and(|waiting| waiting > 0),
            Self::Tcp(stream) => stream.is_waiting(),
        }
    }

    /// Sends all of `bytes`; of those that a peer does not take some wait in memory.
    ///
    /// # Errors
    /// If the port is gone, or takes nothing for the time of the last wait.
    pub fn send_all(&mut self, bytes: &[u8]) -> io::Result<()> {
        match self {
            Self::Serial(port) => port.0.write_all(bytes),
            Self::Tcp(stream) => stream.send(bytes).map(drop),
        }
    }

    /// Ends a connection, before another takes its place.
    pub fn close(&mut self) {
        if let Self::Tcp(stream) = self {
            stream.close();
        }
    }
}

impl Transport for AnyPort {
    fn receive(&mut self, buffer: &mut [u8], wait: Wait<'_>) -> io::Result<ReceiveOutcome> {
        match self {
            Self::Serial(port) => port.receive(buffer, wait),
            Self::Tcp(stream) => stream.receive(buffer, wait),
        }
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<SendOutcome> {
        match self {
            Self::Serial(port) => port.send(bytes),
            Self::Tcp(stream) => stream.send(bytes),
        }
    }

    fn discard_after(&mut self, after: Duration) -> io::Result<()> {
        match self {
            Self::Serial(port) => port.discard_after(after),
            Self::Tcp(stream) => stream.discard_after(after),
        }
    }

    fn wait_for_room(&mut self, wait: Wait<'_>) -> io::Result<()> {
        match self {
            Self::Serial(port) => port.wait_for_room(wait),
            Self::Tcp(stream) => stream.wait_for_room(wait),
        }
    }
}
