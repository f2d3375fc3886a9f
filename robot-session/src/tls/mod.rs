//! TLS over TCP for every link, by rustls: versions 1.2 and 1.3. Certificates are in files of PEM.
//!
//! ```no_run
//! use robot_session::tls::{Identity, Secure, client};
//! use std::net::{Shutdown, TcpStream};
//!
//! # fn run() -> Result<(), Box<dyn core::error::Error>> {
//! let own = Identity { certificate: "cell7.pem".as_ref(), key: "cell7.key".as_ref() };
//! let config = client("authority.pem".as_ref(), Some(own))?;
//! let transport = Secure::dial(TcpStream::connect("robot.local:802")?, config, "robot.local")?;
//! // robot_session::drive(&mut session, transport, handler)
//! # Ok(()) }
//! ```

mod advice;
mod files;

use core::time::Duration;
use std::io::{self, ErrorKind, Read as _, Write as _};
use std::net::{Shutdown, TcpStream};
use std::string::ToString;
use std::sync::Arc;
use std::time::Instant;

pub use ::rustls;
use ::rustls::pki_types::ServerName;
use ::rustls::{ClientConfig, ClientConnection, Connection, ServerConfig, ServerConnection};

pub(crate) use self::advice::advised;
pub use self::files::{FileError, Identity, client, server};
use crate::{ReceiveOutcome, SendOutcome, Transport, Wait, discard_unacknowledged, is_silence};

/// The time that a handshake may take.
pub const HANDSHAKE: Duration = Duration::from_secs(10);

/// Parses the name of a server: a host name or an IP address.
pub(crate) fn server_name(name: &str) -> io::Result<ServerName<'static>> {
    let neither = |_| io::Error::new(ErrorKind::InvalidInput, "neither a host name nor an IP address");
    ServerName::try_from(name.to_string()).map_err(neither)
}

pub(crate) fn late() -> io::Error {
    io::Error::new(ErrorKind::TimedOut, "the peer has not answered the TLS handshake: it may not speak TLS")
}

/// A secure connection over TCP, for the drivers of std. A handshake takes 10 s at most. The errors state the fault of a
/// certificate, and the remedy.
#[derive(Debug)]
pub struct Secure {
    stream: TcpStream,
    tls: Layer,
}

impl Secure {
    /// Connects the client's end; the server's certificate must be for `name`, a host name or an IP address.
    ///
    /// # Errors
    /// `name` is neither; the handshake has failed.
    pub fn dial(stream: TcpStream, config: Arc<ClientConfig>, name: &str) -> io::Result<Self> {
        let tls = ClientConnection::new(config, server_name(name)?).map_err(io::Error::other)?;
        Self::shake_hands(stream, Layer::new(tls.into()))
    }

    /// Accepts the server's end, after its handshake.
    ///
    /// # Errors
    /// The handshake has failed.
    pub fn accept(stream: TcpStream, config: Arc<ServerConfig>) -> io::Result<Self> {
        Self::shake_hands(stream, Layer::accept(config)?)
    }

    /// Creates an end whose handshake is over: of a client that a loop of many connections has accepted.
    pub const fn new(stream: TcpStream, tls: Layer) -> Self {
        Self { stream, tls }
    }

    fn shake_hands(mut stream: TcpStream, mut tls: Layer) -> io::Result<Self> {
        while tls.connection.is_handshaking() {
            let left = HANDSHAKE.saturating_sub(tls.begun.elapsed());
            if left.is_zero() {
                return Err(late());
            }
            stream.set_read_timeout(Some(left))?;
            stream.set_write_timeout(Some(left))?;
            match tls.connection.complete_io(&mut stream) {
                Ok(_) => {}
                Err(error) if is_silence(&error) => return Err(late()),
                Err(error) => return Err(advised(error)),
            }
        }
        stream.set_read_timeout(None)?;
        stream.set_write_timeout(None)?;
        Ok(Self { stream, tls })
    }

    /// Returns the TCP connection below.
    pub const fn stream(&self) -> &TcpStream {
        &self.stream
    }

    /// Returns the state of TLS, with the certificates of the peer.
    pub const fn connection(&self) -> &Connection {
        &self.tls.connection
    }

    /// Ends TLS, so that the peer does not take the end for a lost connection, then ends the connection. Does not wait for a
    /// peer that reads nothing.
    pub fn close(&mut self) {
        self.tls.end(&mut NonBlocking(&mut self.stream));
        let _ = self.stream.shutdown(Shutdown::Both);
    }
}

/// TLS over a stream that does not wait, which belongs to the caller: for a loop of many connections.
#[derive(Debug)]
pub struct Layer {
    connection: Connection,
    /// The begin of the handshake.
    begun: Instant,
}

impl Layer {
    fn new(connection: Connection) -> Self {
        Self { connection, begun: Instant::now() }
    }

    /// Creates the server's end, before its handshake.
    ///
    /// # Errors
    /// The configuration cannot work.
    pub fn accept(config: Arc<ServerConfig>) -> io::Result<Self> {
        Ok(Self::new(ServerConnection::new(config).map_err(io::Error::other)?.into()))
    }

    /// Goes on with the handshake as far as the peer's bytes have come; returns whether the handshake is over.
    ///
    /// # Errors
    /// The stream's, and those of TLS with advice; the handshake takes longer than [`HANDSHAKE`].
    pub fn shake_hands(&mut self, stream: &mut (impl io::Read + io::Write)) -> io::Result<bool> {
        while self.connection.is_handshaking() {
            match self.process(stream) {
                Ok(0) => return Err(advised(ErrorKind::UnexpectedEof.into())),
                Err(error) if is_silence(&error) && self.begun.elapsed() >= HANDSHAKE => return Err(late()),
                Err(error) if is_silence(&error) => return Ok(false),
                processed => processed?,
            };
        }
        Ok(true)
    }

    /// Reads bytes of the peer; 0 at the end.
    ///
    /// # Errors
    /// [`ErrorKind::WouldBlock`] if none has come; the stream's, and those of TLS with advice.
    pub fn read(&mut self, stream: &mut (impl io::Read + io::Write), buffer: &mut [u8]) -> io::Result<usize> {
        loop {
            match self.decrypted(buffer) {
                Err(error) if error.kind() == ErrorKind::WouldBlock => {}
                read => return read,
            }
            self.process(stream)?;
        }
    }

    /// Reads bytes of TLS, and answers them; 0 at the end.
    fn process(&mut self, stream: &mut (impl io::Read + io::Write)) -> io::Result<usize> {
        let length = self.connection.read_tls(stream)?;
        let processed = self.connection.process_new_packets();
        // The peer gets the reason why it is refused.
        self.flush(stream)?;
        processed.map_err(|error| advised(io::Error::new(ErrorKind::InvalidData, error)))?;
        Ok(length)
    }

    /// Returns the certificate of the peer (DER), after the handshake; `None` if the peer has not shown a certificate.
    pub fn peer_certificate(&self) -> Option<&[u8]> {
        self.connection.peer_certificates()?.first().map(|certificate| &**certificate)
    }

    /// Reads bytes that were received and decrypted before.
    fn decrypted(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let is_served = matches!(&self.connection, Connection::Server(server) if !server.is_handshaking());
        self.connection.reader().read(buffer).map_err(|error| match error.kind() {
            // A server whose handshake is over has accepted its client, and is accepted.
            kind @ ErrorKind::UnexpectedEof if is_served => {
                io::Error::new(kind, "the client has closed the connection without ending TLS")
            }
            _ => advised(error),
        })
    }

    /// Sends as many of `bytes` as fit; returns how many.
    ///
    /// # Errors
    /// [`ErrorKind::WouldBlock`] if nothing fits; the errors of the stream.
    pub fn write(&mut self, stream: &mut impl io::Write, bytes: &[u8]) -> io::Result<usize> {
        self.flush(stream)?;
        if self.connection.wants_write() {
            return Err(ErrorKind::WouldBlock.into());
        }
        let taken = self.connection.writer().write(bytes)?;
        // Bytes that do not fit are sent by the next call.
        self.flush(stream)?;
        Ok(taken)
    }

    /// Sends the bytes that TLS has for the peer, as far as the stream takes them.
    ///
    /// # Errors
    /// The errors of the stream.
    pub fn flush(&mut self, stream: &mut impl io::Write) -> io::Result<()> {
        while self.connection.wants_write() {
            match self.connection.write_tls(stream) {
                Err(error) if is_silence(&error) => break,
                written => written?,
            };
        }
        Ok(())
    }

    /// Ends TLS, so that the peer does not take the end for a lost connection. Does not wait for a peer that reads nothing.
    pub fn end(&mut self, stream: &mut impl io::Write) {
        self.connection.send_close_notify();
        let _ = self.flush(stream);
    }
}

/// A stream that does not wait.
struct NonBlocking<'a>(&'a mut TcpStream);

impl io::Read for NonBlocking<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match self.0.receive(buffer, Wait::limited(Duration::ZERO))? {
            ReceiveOutcome::Bytes(length) => Ok(length),
            ReceiveOutcome::Closed => Ok(0),
            ReceiveOutcome::Nothing => Err(ErrorKind::WouldBlock.into()),
        }
    }
}

impl io::Write for NonBlocking<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self.0.send(bytes)? {
            SendOutcome::Part(0) => Err(ErrorKind::WouldBlock.into()),
            SendOutcome::Part(length) => Ok(length),
            SendOutcome::Buffered | SendOutcome::Transmitted => Ok(bytes.len()),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Transport for Secure {
    fn receive(&mut self, buffer: &mut [u8], mut wait: Wait<'_>) -> io::Result<ReceiveOutcome> {
        let Self { stream, tls } = self;
        let read = match tls.decrypted(buffer) {
            Err(_) => {
                tls.flush(&mut NonBlocking(stream))?;
                wait.room |= tls.connection.wants_write();
                if !wait.readable(&*stream)? {
                    tls.flush(&mut NonBlocking(stream))?;
                    return Ok(ReceiveOutcome::Nothing);
                }
                tls.read(&mut NonBlocking(stream), buffer)
            }
            read => read,
        };
        match read {
            Ok(0) => Ok(ReceiveOutcome::Closed),
            Ok(length) => Ok(ReceiveOutcome::Bytes(length)),
            Err(error) if is_silence(&error) => Ok(ReceiveOutcome::Nothing),
            Err(error) => Err(error),
        }
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<SendOutcome> {
        match self.tls.write(&mut NonBlocking(&mut self.stream), bytes) {
            Ok(taken) if taken == bytes.len() => Ok(SendOutcome::Buffered),
            Ok(taken) => Ok(SendOutcome::Part(taken)),
            Err(error) if is_silence(&error) => Ok(SendOutcome::Part(0)),
            Err(error) => Err(error),
        }
    }

    fn discard_after(&mut self, after: Duration) -> io::Result<()> {
        discard_unacknowledged(&self.stream, after)
    }

    fn wait_for_room(&mut self, wait: Wait<'_>) -> io::Result<()> {
        wait.writable(&self.stream).map(drop)
    }
}

/// Closes the connection.
impl Drop for Secure {
    fn drop(&mut self) {
        self.close();
    }
}

#[cfg(test)]
mod tests {
    use std::net::TcpListener;

    use ::rustls::RootCertStore;

    use super::*;

    /// Returns a client's end whose handshake has this time left, its connection, and the peer, which is silent.
    fn with_silent_peer(left: Duration) -> (Layer, TcpStream, TcpListener) {
        let config =
            ClientConfig::builder().with_root_certificates(RootCertStore::empty()).with_no_client_auth();
        let connection = ClientConnection::new(config.into(), server_name("robot").unwrap()).unwrap();
        let begun = Instant::now().checked_sub(HANDSHAKE.saturating_sub(left)).unwrap();
        let peer = TcpListener::bind("127.0.0.1:0").unwrap();
        let stream = TcpStream::connect(peer.local_addr().unwrap()).unwrap();
        (Layer { connection: connection.into(), begun }, stream, peer)
    }

    struct Broken;

    impl io::Read for Broken {
        fn read(&mut self, _: &mut [u8]) -> io::Result<usize> {
            Err(ErrorKind::ConnectionReset.into())
        }
    }

    impl io::Write for Broken {
        fn write(&mut self, _: &[u8]) -> io::Result<usize> {
            Err(ErrorKind::ConnectionReset.into())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn a_broken_connection_is_not_a_silent_one() {
        let (mut tls, _stream, _peer) = with_silent_peer(HANDSHAKE);
        assert_eq!(tls.flush(&mut Broken).unwrap_err().kind(), ErrorKind::ConnectionReset);
        assert_eq!(tls.shake_hands(&mut Broken).unwrap_err().kind(), ErrorKind::ConnectionReset);
        let (tls, stream, _peer) = with_silent_peer(HANDSHAKE);
        stream.shutdown(std::net::Shutdown::Both).unwrap();
        assert!(Secure { stream, tls }.send(b"!").is_err());
    }

    #[test]
    fn a_handshake_with_a_silent_peer_ends_in_time() {
        let (tls, stream, _peer) = with_silent_peer(Duration::from_millis(50));
        assert_eq!(Secure::shake_hands(stream, tls).unwrap_err().kind(), ErrorKind::TimedOut);
        let (mut tls, mut stream, _peer) = with_silent_peer(HANDSHAKE);
        assert!(!tls.shake_hands(&mut NonBlocking(&mut stream)).unwrap());
        let (mut tls, mut stream, _peer) = with_silent_peer(Duration::ZERO);
        let late = tls.shake_hands(&mut NonBlocking(&mut stream)).unwrap_err();
        assert_eq!(late.kind(), ErrorKind::TimedOut);
    }
}
