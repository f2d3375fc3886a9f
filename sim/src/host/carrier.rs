//! The bytes of a client: as they are, or in TLS.

use std::io::{self, Read, Write};

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
