//! Serial ports of the crate `serialport`.

use core::time::Duration;
use std::boxed::Box;
use std::io::{self, ErrorKind, Read as _, Write as _};

use serialport::SerialPort;

use crate::std_driver::is_silence;
use crate::{ReceiveOutcome, SendOutcome, Transport, Wait};

/// A serial port, as `serialport::new(path, baud).open()` gives it, as a [`Transport`].
///
/// A [`Waker`](crate::Waker) does not end the wait of this transport, which on some systems is not a wait for a descriptor: a
/// caller that needs wakes limits the turn. On Unix a write of more bytes than the driver's buffer takes waits for the line:
/// some 4000 bytes at most ports.
#[allow(missing_debug_implementations, reason = "a port is not")]
pub struct Serial(pub Box<dyn SerialPort>);

impl Serial {
    #[cfg(not(windows))]
    fn read_some(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.0.read(buffer)
    }

    /// Reads the bytes that have arrived, or waits for the first: drivers of virtual ports, and Wine, wait until the buffer
    /// is full.
    #[cfg(windows)]
    fn read_some(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let waiting = self.0.bytes_to_read()?;
        let length = usize::try_from(waiting).unwrap_or(usize::MAX).max(1).min(buffer.len());
        self.0.read(buffer.get_mut(..length).unwrap_or_default())
    }
}

/// The longest single wait; a wait without a limit is split, since no system waits for [`Duration::MAX`].
const MAX_WAIT: Duration = Duration::from_secs(1);
/// The interval at which a line that takes no more bytes is tried again.
const RETRY: Duration = Duration::from_millis(5);
/// The shortest timeout of the port: 0 is an error at once on some systems.
const MIN_TIMEOUT: Duration = Duration::from_micros(100);

impl Transport for Serial {
    fn receive(&mut self, buffer: &mut [u8], wait: Wait<'_>) -> io::Result<ReceiveOutcome> {
        let longest = if wait.room { RETRY } else { MAX_WAIT };
        self.0.set_timeout(wait.limit.unwrap_or(longest).clamp(MIN_TIMEOUT, longest))?;
        match self.read_some(buffer) {
            Ok(0) => Ok(ReceiveOutcome::Closed),
            Ok(length) => Ok(ReceiveOutcome::Bytes(length)),
            Err(error) if is_silence(&error) => Ok(ReceiveOutcome::Nothing),
            Err(error) => Err(error),
        }
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<SendOutcome> {
        self.0.set_timeout(MIN_TIMEOUT)?;
        match self.0.write(bytes) {
            Ok(length) if length == bytes.len() => Ok(SendOutcome::Buffered),
            Ok(0) => Err(ErrorKind::WriteZero.into()),
            Ok(length) => Ok(SendOutcome::Part(length)),
            Err(error) if is_silence(&error) => Ok(SendOutcome::Part(0)),
            Err(error) => Err(error),
        }
    }
}
