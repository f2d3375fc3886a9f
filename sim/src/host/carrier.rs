//! A client that has arrived, and its bytes: as they are, or in TLS.

use core::net::SocketAddr;
use std::io::{self, Read, Write};
use std::net::Shutdown;

use mio::net::TcpStream;
#[cfg(feature = "tls")]
use robot_session::tls::Layer;

/// A connection that does not block.
#[derive(Debug)]
pub struct Carrier {
    /// The TCP connection.
    pub tcp: TcpStream,
    /// The TLS of the connection; `None`: bytes as they are.
    #[cfg(feature = "tls")]
    pub tls: Option<Box<Layer>>,
}

impl From<TcpStream> for Carrier {
    fn from(tcp: TcpStream) -> Self {
        Self {
            tcp,
            #[cfg(feature = "tls")]
            tls: None,
        }
    }
}

/// A client that has arrived, or none.
#[derive(Debug)]
pub enum Arrival {
    /// A client; its stream does not block. In TLS its handshake is over.
    Client(Carrier, SocketAddr),
    /// The connection of this client was closed, for this reason: no descriptor was free, or the handshake has failed.
    Refused(SocketAddr, String),
    /// No client has arrived since the last call.
    Nobody,
}

impl Carrier {
    /// Returns whether bytes may remain after a read that did not fill its buffer.
    pub(super) const fn keeps_bytes(&self) -> bool {
        #[cfg(feature = "tls")]
        return self.tls.is_some();
        #[cfg(not(feature = "tls"))]
        false
    }

    /// Returns the certificate that the client has shown.
    pub(super) fn certificate(&self) -> Option<&[u8]> {
        #[cfg(feature = "tls")]
        return self.tls.as_ref()?.peer_certificate();
        #[cfg(not(feature = "tls"))]
        None
    }

    /// Says that nothing follows.
    pub(super) fn end(&mut self) {
        #[cfg(feature = "tls")]
        if let Some(tls) = &mut self.tls {
            tls.end(&mut self.tcp);
        }
    }
}

impl Read for Carrier {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        #[cfg(feature = "tls")]
        if let Some(tls) = &mut self.tls {
            return tls.read(&mut self.tcp, buffer);
        }
        self.tcp.read(buffer)
    }
}

impl Write for Carrier {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        #[cfg(feature = "tls")]
        if let Some(tls) = &mut self.tls {
            return tls.write(&mut self.tcp, bytes);
        }
        self.tcp.write(bytes)
    }

    /// Sends the bytes that TLS has for the client, as far as the system accepts them.
    fn flush(&mut self) -> io::Result<()> {
        #[cfg(feature = "tls")]
        if let Some(tls) = &mut self.tls {
            return tls.flush(&mut self.tcp);
        }
        Ok(())
    }
}

/// Closes the connection of a client that is not served.
pub fn refuse(stream: &TcpStream) {
    // Without the shutdown, bytes that the client has sent would make the close a reset, which some clients do not
    // report as an end.
    let _ = stream.shutdown(Shutdown::Both);
}
