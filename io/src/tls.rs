//! TLS: its options, and the connections of clients.

use std::io::{self, ErrorKind};
use std::net::TcpStream;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use anyhow::{Context, Result, ensure};
use robot_session::tls::rustls::ClientConfig;
pub use robot_session::tls::rustls::ServerConfig;
use robot_session::tls::{Identity, Secure, client, server};
use robot_session::{ReceiveOutcome, SendOutcome, Transport, Wait};

use crate::tcp::{self, Dialing};

/// The options of every command that opens or accepts TCP connections.
#[derive(Debug, Clone, Default, clap::Args)]
pub struct TlsArgs {
    /// Speak TLS, with peers whose certificate is signed by this authority (PEM); `cellwire certificates` makes some to try.
    /// A server with --tls-cert alone accepts clients without a certificate
    #[arg(long, value_name = "AUTHORITY")]
    tls: Option<PathBuf>,
    /// The certificate of this end (PEM); a server needs one
    #[arg(long, value_name = "FILE", requires = "tls_key")]
    tls_cert: Option<PathBuf>,
    /// The key of --tls-cert (PEM)
    #[arg(long, value_name = "FILE", requires = "tls_cert")]
    tls_key: Option<PathBuf>,
    /// The name in the certificate of the server that this end connects to [default: the host of its address]
    #[arg(long, value_name = "NAME", requires = "tls")]
    tls_name: Option<String>,
}

impl TlsArgs {
    /// Returns whether the options select TLS.
    pub const fn is_given(&self) -> bool {
        self.tls.is_some() || self.tls_cert.is_some()
    }

    /// Returns whether a server with them verifies the certificates of its clients.
    pub const fn verifies_clients(&self) -> bool {
        self.tls.is_some()
    }

    fn own(&self) -> Option<Identity<'_>> {
        let (certificate, key) = self.tls_cert.as_deref().zip(self.tls_key.as_deref())?;
        Some(Identity { certificate, key })
    }

    /// Returns the TLS of a client; `None` without TLS.
    ///
    /// # Errors
    /// There is no authority, or a file cannot be used.
    pub fn client(&self) -> Result<Option<Tls>> {
        let Some(authority) = &self.tls else {
            ensure!(!self.is_given(), "--tls-cert of a client needs --tls too: the authority of the server");
            return Ok(None);
        };
        Ok(Some(Tls { config: client(authority, self.own())?, name: self.tls_name.clone() }))
    }

    /// Returns the TLS of a server; `None` without TLS.
    ///
    /// # Errors
    /// There is no certificate, or a file cannot be used.
    pub fn server(&self) -> Result<Option<Arc<ServerConfig>>> {
        ensure!(
            self.tls_name.is_none(),
            "--tls-name is for a connection to a server, and this end accepts clients"
        );
        let Some(own) = self.own() else {
            ensure!(
                !self.is_given(),
                "--tls of a server needs --tls-cert and --tls-key too: its certificate"
            );
            return Ok(None);
        };
        Ok(Some(server(own, self.tls.as_deref())?))
    }
}

/// A port as it is, or a secure connection.
#[derive(Debug)]
pub enum Carrier<T> {
    /// The port without TLS.
    Plain(T),
    /// The port with TLS.
    Secure(Box<Secure>),
}

impl<T> Carrier<T> {
    /// Connects to a server, by TLS if there is one; `plain` makes the port of a connection without.
    ///
    /// # Errors
    /// As [`tcp::connect`]; those of the handshake.
    pub fn connect(
        address: &str,
        dialing: Dialing,
        tls: Option<&Tls>,
        plain: impl FnOnce(TcpStream) -> T,
    ) -> Result<Self> {
        let stream = tcp::connect(address, dialing)?;
        Ok(match tls {
            None => Self::Plain(plain(stream)),
            Some(tls) => Self::Secure(Box::new(tls.secure(stream, address)?)),
        })
    }
}

impl Carrier<TcpStream> {
    /// Returns the TCP connection.
    pub const fn stream(&self) -> &TcpStream {
        match self {
            Self::Plain(stream) => stream,
            Self::Secure(secure) => secure.stream(),
        }
    }
}

impl<T: Transport> Transport for Carrier<T> {
    fn receive(&mut self, buffer: &mut [u8], wait: Wait<'_>) -> io::Result<ReceiveOutcome> {
        match self {
            Self::Plain(port) => {
                let received = port.receive(buffer, wait)?;
                if let ReceiveOutcome::Bytes(length) = received
                    && is_alert(buffer.get(..length).unwrap_or_default())
                {
                    let speaks = "the peer speaks TLS on this port: give --tls";
                    return Err(io::Error::new(ErrorKind::InvalidData, speaks));
                }
                Ok(received)
            }
            Self::Secure(stream) => stream.receive(buffer, wait),
        }
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<SendOutcome> {
        match self {
            Self::Plain(port) => port.send(bytes),
            Self::Secure(stream) => stream.send(bytes),
        }
    }

    fn discard_after(&mut self, after: Duration) -> io::Result<()> {
        match self {
            Self::Plain(port) => port.discard_after(after),
            Self::Secure(stream) => stream.discard_after(after),
        }
    }

    fn wait_for_room(&mut self, wait: Wait<'_>) -> io::Result<()> {
        match self {
            Self::Plain(port) => port.wait_for_room(wait),
            Self::Secure(stream) => stream.wait_for_room(wait),
        }
    }
}

/// Returns whether bytes are the answer of a TLS server to others: a record with one fatal alert. No link has a message of
/// these bytes; in RTU the third one would be an odd number of bytes of registers.
fn is_alert(bytes: &[u8]) -> bool {
    matches!(bytes, [0x15, 3, 1 | 3, 0, 2, 2, _])
}

/// The TLS of a client's connections.
#[derive(Debug, Clone)]
pub struct Tls {
    config: Arc<ClientConfig>,
    name: Option<String>,
}

impl Tls {
    /// Makes a secure connection to the server of this address.
    fn secure(&self, stream: TcpStream, address: &str) -> Result<Secure> {
        let host = address.rsplit_once(':').map_or(address, |(host, _)| host);
        let name = self.name.as_deref().unwrap_or(host.trim_matches(['[', ']']));
        let context = || format!("cannot connect to {address} as {name}");
        Secure::dial(stream, Arc::clone(&self.config), name).with_context(context)
    }
}
