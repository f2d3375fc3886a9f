//! A TCP connection, by TLS or without, that one thread reads and another one writes.

use std::io::{self, ErrorKind, Read};
use std::net::{Shutdown, TcpStream};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use anyhow::Result;
use cellwire_io::tcp::Dialing;
use cellwire_io::tls::{Carrier, Tls};
use robot_session::{ReceiveOutcome, SendOutcome, Transport as _, Wait, now};

/// A peer that takes nothing for this long is gone.
pub(super) const STUCK: Duration = Duration::from_secs(5);

/// A connection; a clone is the same one.
#[derive(Debug, Clone)]
pub(super) struct Wire {
    carrier: Arc<Mutex<Carrier<TcpStream>>>,
    /// The same socket, on which a thread waits without the lock.
    socket: Arc<TcpStream>,
}

impl Wire {
    pub(super) fn connect(address: &str, dialing: Dialing, tls: Option<&Tls>) -> Result<Self> {
        let carrier = Carrier::connect(address, dialing, tls, |stream| stream)?;
        let socket = Arc::new(carrier.stream().try_clone()?);
        Ok(Self { carrier: Arc::new(Mutex::new(carrier)), socket })
    }

    fn lock(&self) -> MutexGuard<'_, Carrier<TcpStream>> {
        self.carrier.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Makes the system discard bytes that the peer has not acknowledged after this time, and end the connection.
    pub(super) fn discard_after(&self, after: Duration) -> io::Result<()> {
        self.lock().discard_after(after)
    }

    /// Sends all of `bytes`; fails if the peer takes nothing for the time [`STUCK`].
    pub(super) fn send(&self, mut bytes: &[u8]) -> io::Result<()> {
        let mut end = now().saturating_add(STUCK);
        while !bytes.is_empty() {
            let sent = self.lock().send(bytes)?;
            let SendOutcome::Part(taken) = sent else { return Ok(()) };
            if taken > 0 {
                bytes = bytes.get(taken..).unwrap_or_default();
                end = now().saturating_add(STUCK);
            } else if now() >= end {
                return Err(io::Error::new(ErrorKind::TimedOut, "the peer does not read"));
            }
            Wait::limited(end.saturating_sub(now())).writable(&*self.socket)?;
        }
        Ok(())
    }

    /// Ends the connection, and the read of the other thread.
    pub(super) fn close(&self) {
        match &mut *self.lock() {
            Carrier::Plain(stream) => drop(stream.shutdown(Shutdown::Both)),
            Carrier::Secure(stream) => stream.close(),
        }
    }
}

/// Waits for bytes; 0 at the end.
impl Read for Wire {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        loop {
            let received = self.lock().receive(buffer, Wait::limited(Duration::ZERO))?;
            match received {
                ReceiveOutcome::Bytes(length) => return Ok(length),
                ReceiveOutcome::Closed => return Ok(0),
                ReceiveOutcome::Nothing => Wait::default().readable(&*self.socket)?,
            };
        }
    }
}
