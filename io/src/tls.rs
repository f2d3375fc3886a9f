//! TLS: the options of clients, and those of simulated servers.

use std::io;
use std::net::TcpStream;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use anyhow::{Context, Result};
use robot_session::tls::rustls::ClientConfig;
pub use robot_session::tls::rustls::ServerConfig;
use robot_session::tls::{Identity, Secure, client, server};
use robot_session::{Received, Sent, Transport, Wait};

/// The options of a client.
#[derive(Debug, Clone, clap::Args)]
pub struct ClientArgs {
    /// Connect by TLS, to a server whose certificate is signed by this authority (PEM); `cellwire certificates` makes some to try
    #[arg(long, value_name = "AUTHORITY")]
    tls: Option<PathBuf>,
    /// The certificate that the server gets (PEM)
    #[arg(long, value_name = "FILE", requires_all = ["tls", "tls_key"])]
    tls_cert: Option<PathBuf>,
    /// The key of --tls-cert (PEM)
    #[arg(long, value_name = "FILE", requires = "tls_cert")]
    tls_key: Option<PathBuf>,
    /// The name in the server's certificate [default: the host of the address]
    #[arg(long, value_name = "NAME", requires = "tls")]
    tls_name: Option<String>,
}

impl ClientArgs {
    /// The TLS that they ask for; `None` without.
    ///
    /// # Errors
    /// A file that cannot be used.
    pub fn read(&self) -> Result<Option<Tls>> {
        let Some(authority) = &self.tls else { return Ok(None) };
        let own = self.tls_cert.as_deref().zip(self.tls_key.as_deref());
        let own = own.map(|(certificate, key)| Identity { certificate, key });
        Ok(Some(Tls { config: client(authority, own)?, name: self.tls_name.clone() }))
    }
}

/// A port as it is, or a secure connection.
#[derive(Debug)]
pub enum Carrier<T> {
    /// Without TLS.
    Plain(T),
    /// With TLS.
    Secure(Box<Secure>),
}

impl<T: Transport> Transport for Carrier<T> {
    fn receive(&mut self, buffer: &mut [u8], wait: Wait<'_>) -> io::Result<Received> {
        match self {
            Self::Plain(port) => port.receive(buffer, wait),
            Self::Secure(stream) => stream.receive(buffer, wait),
        }
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<Sent> {
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

/// The TLS of a client's connections.
#[derive(Debug, Clone)]
pub struct Tls {
    config: Arc<ClientConfig>,
    name: Option<String>,
}

impl Tls {
    /// Makes a secure connection to the server of this address.
    ///
    /// # Errors
    /// The handshake's.
    pub fn secure(&self, stream: TcpStream, address: &str) -> Result<Secure> {
        let host = address.rsplit_once(':').map_or(address, |(host, _)| host);
        let name = self.name.as_deref().unwrap_or(host.trim_matches(['[', ']']));
        let context = || format!("cannot connect to {address} as {name}");
        Secure::dial(stream, Arc::clone(&self.config), name).with_context(context)
    }
}

/// The options of a server.
#[derive(Debug, Clone, clap::Args)]
pub struct ServerArgs {
    /// Accept clients by TLS alone, with this certificate (PEM)
    #[arg(long, value_name = "FILE", requires = "tls_key")]
    tls_cert: Option<PathBuf>,
    /// The key of --tls-cert (PEM)
    #[arg(long, value_name = "FILE", requires = "tls_cert")]
    tls_key: Option<PathBuf>,
    /// Accept only clients with a certificate of this authority (PEM)
    #[arg(long, value_name = "AUTHORITY", requires = "tls_cert")]
    tls_clients: Option<PathBuf>,
}

impl ServerArgs {
    /// The TLS that they ask for; `None` without.
    ///
    /// # Errors
    /// A file that cannot be used.
    pub fn read(&self) -> Result<Option<Arc<ServerConfig>>> {
        let Some((certificate, key)) = self.tls_cert.as_deref().zip(self.tls_key.as_deref()) else {
            return Ok(None);
        };
        Ok(Some(server(Identity { certificate, key }, self.tls_clients.as_deref())?))
    }

    /// Whether clients need a certificate.
    pub const fn verifies_clients(&self) -> bool {
        self.tls_clients.is_some()
    }
}
