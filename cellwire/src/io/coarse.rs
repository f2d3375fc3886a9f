//! A connection whose waits need not end on time: the system's own limit, without the many short sleeps of an exact one.

use std::io::{self, Read as _};
use std::time::Duration;

use robot_session::{Received, Sent, Transport};

use crate::io::port::AnyPort;
use crate::io::tcp::is_silence;

/// The shortest limit that a system takes.
const SHORTEST: Duration = Duration::from_millis(1);

/// For many sessions in one process, none of which has to act within milliseconds unasked: a wait may end some milliseconds late.
#[allow(missing_debug_implementations, reason = "it holds a port")]
pub struct Coarse(pub AnyPort);

impl Transport for Coarse {
    fn receive(&mut self, buffer: &mut [u8], wait: Option<Duration>) -> io::Result<Received> {
        let AnyPort::Tcp(stream) = &mut self.0 else { return self.0.receive(buffer, wait) };
        stream.set_read_timeout(wait.map(|wait| wait.max(SHORTEST)))?;
        match stream.read(buffer) {
            Ok(0) => Ok(Received::Closed),
            Ok(length) => Ok(Received::Bytes(length)),
            Err(error) if is_silence(&error) => Ok(Received::Nothing),
            Err(error) => Err(error),
        }
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<Sent> {
        self.0.send(bytes)
    }
}
