//! The connections to a device: over TCP, or on a serial line.

use std::io;
use std::net::SocketAddr;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use anyhow::{Context, Result, ensure};
use robot_session::tokio::tokio_serial::SerialStream;
use robot_session::tokio::{Connector, Tcp};
use tokio::io::{AsyncRead, AsyncWrite};

use crate::site::Cell;
use cellwire_io::port::AnyPort;
use cellwire_io::serial;
use cellwire_io::tcp::warn_unless_loopback;

/// The address of a device that waits for a connection.
#[derive(Debug)]
pub(super) struct Port {
    place: String,
    way: PortTransport,
}

#[derive(Debug)]
enum PortTransport {
    Tcp(Tcp),
    Serial { baud: u32 },
}

/// The peer of the last connection.
pub(super) type Peer = Arc<Mutex<String>>;

/// A connector that notes the peer of its connections, and warns of an address that is open to the network.
pub(super) struct PeerRecorder<C> {
    pub connector: C,
    pub peer: Peer,
    /// The address at which it listens, until that was checked.
    pub place: Option<SocketAddr>,
}

impl<C: Connector> Connector for PeerRecorder<C> {
    type Transport = C::Transport;

    const DIALS: bool = C::DIALS;

    async fn connect(&mut self) -> io::Result<C::Transport> {
        if let Some(place) = self.place.take() {
            warn_unless_loopback(place);
        }
        let transport = self.connector.connect().await?;
        *self.peer.lock().unwrap_or_else(PoisonError::into_inner) = self.peer().unwrap_or_default();
        Ok(transport)
    }

    fn discard_after(&mut self, after: Duration) {
        self.connector.discard_after(after);
    }

    fn peer(&self) -> Option<String> {
        self.connector.peer()
    }

    async fn replaced(&mut self) {
        self.connector.replaced().await;
    }
}

/// A connection of either kind.
pub(super) trait Bytes: AsyncRead + AsyncWrite + Unpin + Send {}

impl<T: AsyncRead + AsyncWrite + Unpin + Send> Bytes for T {}

impl Port {
    /// Parses `HOST:PORT`, or a serial port if the link has a baud rate.
    ///
    /// # Errors
    /// If the cell has no such address.
    pub(super) fn of(cell: &Cell, baud: Option<u32>) -> Result<Self> {
        let place = cell
            .address
            .clone()
            .context("this link's device does not connect to the bridge: give address instead of listen")?;
        let is_serial = AnyPort::is_serial(&place);
        let way = match baud {
            Some(baud) if is_serial => PortTransport::Serial { baud },
            _ => PortTransport::Tcp(Tcp::new(&place)),
        };
        ensure!(
            baud.is_some() || !is_serial,
            "{place} looks like a serial port, but this link uses TCP: give HOST:PORT"
        );
        Ok(Self { place, way })
    }
}

impl Connector for Port {
    type Transport = Box<dyn Bytes>;

    async fn connect(&mut self) -> io::Result<Box<dyn Bytes>> {
        let place = &self.place;
        match &mut self.way {
            PortTransport::Tcp(tcp) => match tcp.connect().await {
                Ok(stream) => Ok(Box::new(stream)),
                Err(error) => {
                    let why = match error.kind() {
                        io::ErrorKind::TimedOut => "no answer in time".to_owned(),
                        _ => error.to_string(),
                    };
                    Err(io::Error::new(error.kind(), format!("cannot connect to {place}: {why}")))
                }
            },
            PortTransport::Serial { baud } => match SerialStream::open(&serial::settings(place, *baud)) {
                Ok(port) => Ok(Box::new(port)),
                Err(error) => Err(io::Error::other(format!("{:#}", serial::advise(place, *baud, error)))),
            },
        }
    }

    fn discard_after(&mut self, after: Duration) {
        if let PortTransport::Tcp(tcp) = &mut self.way {
            tcp.discard_after(after);
        }
    }

    fn peer(&self) -> Option<String> {
        Some(self.place.clone())
    }
}
