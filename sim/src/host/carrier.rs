//! The bytes of a client: as they are, or in TLS.

use std::io::{self, Read, Write};

use mio::net::TcpStream;
#[cfg(feature = "tls")]
use robot_session::tls::{advised, rustls::ServerConnection};

/// A connection that does not block.
pub(super) struct Carrier {
    pub(super) tcp: TcpStream,
    /// `None`: bytes as they are.
    #[cfg(feature = "tls")]
    pub(super) tls: Option<Box<ServerConnection>>,
}

impl Carrier {
    /// Whether bytes may be left after a read that was not filled.
    pub(super) const fn keeps_bytes(&self) -> bool {
        #[cfg(feature = "tls")]
        return self.tls.is_some();
        #[cfg(not(feature = "tls"))]
        false
    }

    /// Says that nothing follows.
    pub(super) fn end(&mut self) {
        #[cfg(feature = "tls")]
        if let Some(tls) = &mut self.tls {
            tls.send_close_notify();
        }
        let _ = self.flush(); // a client that reads nothing is not waited for
    }
}

impl Read for Carrier {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        #[cfg(feature = "tls")]
        if self.tls.is_some() {
            return self.read_secure(buffer);
        }
        self.tcp.read(buffer)
    }
}

impl Write for Carrier {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        #[cfg(feature = "tls")]
        if let Some(tls) = &mut self.tls {
            let taken = tls.writer().write(bytes)?;
            self.flush()?;
            return if taken == 0 { Err(io::ErrorKind::WouldBlock.into()) } else { Ok(taken) };
        }
        self.tcp.write(bytes)
    }

    /// Sends the bytes that TLS has for the client, as far as the system accepts them.
    fn flush(&mut self) -> io::Result<()> {
        #[cfg(feature = "tls")]
        if let Some(tls) = &mut self.tls {
            while tls.wants_write() {
                match tls.write_tls(&mut self.tcp) {
                    Err(error) if error.kind() == io::ErrorKind::WouldBlock => break,
                    written => written?,
                };
            }
        }
        Ok(())
    }
}

#[cfg(feature = "tls")]
impl Carrier {
    fn read_secure(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        loop {
            let Some(tls) = &mut self.tls else { return Ok(0) };
            match tls.reader().read(buffer) {
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
                read => return read.map_err(advised),
            }
            tls.read_tls(&mut self.tcp)?;
            let processed = tls.process_new_packets();
            // The client gets the reason why it is refused.
            self.flush()?;
            processed.map_err(|error| advised(io::Error::new(io::ErrorKind::InvalidData, error)))?;
        }
    }
}
