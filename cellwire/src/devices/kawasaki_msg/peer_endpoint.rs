//! The connection of the two ends: over TCP one of them listens, by default the PC (thesis, section 10.4); over UDP the robot
//! sends first.

use std::collections::VecDeque;
use std::io::ErrorKind;
use std::net::{SocketAddr, TcpStream, UdpSocket};
use std::sync::Arc;
use std::time::Duration;

use anyhow::{Result, bail, ensure};
use cellwire_sim::host::{Arrival, Listener};
use kawasaki_msg::{Dialect, Message};
use robot_session::tls::Secure;
use robot_session::{ReceiveOutcome, SendOutcome, Transport, Wait, is_lost_datagram};

use cellwire_io::backoff::Backoff;
use cellwire_io::drive::ConnectionLost;
use cellwire_io::endpoint::Endpoint;
use cellwire_io::output::{admits, remark};
use cellwire_io::stream::Stream;
use cellwire_io::tcp::{self, Dialing};
use cellwire_io::tls::{self, ServerConfig, Tls, TlsArgs};
use cellwire_io::udp::{self, Datagrams};

/// The most handshakes at once; the oldest one ends for another.
const MAX_HANDSHAKES: usize = 64;

/// The longest datagram.
const MAX_DATAGRAM_LEN: usize = 65536;

/// The address of the peer: listen, connect, or datagrams.
#[derive(Debug)]
pub enum PeerEndpoint {
    /// This end listens, and the other end connects.
    Listen(Arrivals),
    /// This end connects, and the other end listens.
    Connect {
        /// The address of the other end, `HOST:PORT`.
        address: String,
        /// The settings of a connection.
        dialing: Dialing,
        /// The pauses between attempts to connect.
        backoff: Backoff,
        /// The TLS of the connections; `None`: they are not encrypted.
        tls: Option<Tls>,
    },
    /// The other end sends datagrams; each must be a message of this table.
    Datagrams(UdpSocket, Dialect),
    /// Datagrams are sent to the other end.
    Peer(UdpSocket, String),
}

/// The transport of a connection.
#[derive(Debug)]
pub enum Carrier {
    /// A TCP connection, perhaps with TLS.
    Tcp(tls::Carrier<Stream>),
    /// Datagrams of one peer.
    Udp(Datagrams),
}

/// The clients that arrive.
#[derive(Debug)]
pub struct Arrivals {
    listener: Listener,
    tls: Option<Arc<ServerConfig>>,
    /// The clients whose TLS handshake is not over, the oldest first.
    handshakes: VecDeque<(Box<Secure>, SocketAddr)>,
}

impl PeerEndpoint {
    /// Opens a PC's endpoint; where it is reached, or reaches the robot.
    ///
    /// # Errors
    /// If it cannot be opened.
    pub fn of_pc(
        endpoint: &Endpoint,
        datagrams: bool,
        dialect: Dialect,
        dialing: Dialing,
        tls: &TlsArgs,
    ) -> Result<(Self, &'static str, String)> {
        ensure!(!(datagrams && tls.is_given()), "--tls is for TCP, and the setting udp is given");
        match endpoint {
            Endpoint::Listen(address) if datagrams => {
                let socket = udp::bind(address)?;
                let place = socket.local_addr()?.to_string();
                Ok((Self::Datagrams(socket, dialect), "listen", place))
            }
            Endpoint::Connect(_) if datagrams => bail!("over UDP the robot sends first: use --listen"),
            endpoint => Self::tcp(endpoint, dialing, tls),
        }
    }

    /// Opens a robot's endpoint; where it is reached, or reaches the PC.
    ///
    /// # Errors
    /// If it cannot be opened.
    pub fn of_robot(
        endpoint: &Endpoint,
        datagrams: bool,
        dialing: Dialing,
        tls: &TlsArgs,
    ) -> Result<(Self, &'static str, String)> {
        ensure!(!(datagrams && tls.is_given()), "--tls is for TCP, and the setting udp is given");
        match endpoint {
            Endpoint::Connect(address) if datagrams => {
                Ok((Self::Peer(udp::connect(address)?, address.clone()), "connect", address.clone()))
            }
            Endpoint::Listen(_) if datagrams => bail!("over UDP the robot sends first: use --connect"),
            endpoint => Self::tcp(endpoint, dialing, tls),
        }
    }

    fn tcp(endpoint: &Endpoint, dialing: Dialing, tls: &TlsArgs) -> Result<(Self, &'static str, String)> {
        match endpoint {
            Endpoint::Listen(address) => {
                let tls = tls.server()?;
                let listener = tcp::listen(address)?;
                let place = listener.local_addr()?.to_string();
                let arrivals =
                    Arrivals { listener: Listener::new(listener)?, tls, handshakes: VecDeque::new() };
                Ok((Self::Listen(arrivals), "listen", place))
            }
            Endpoint::Connect(address) => {
                let (backoff, tls) = (Backoff::default(), tls.client()?);
                let meeting = Self::Connect { address: address.clone(), dialing, backoff, tls };
                Ok((meeting, "connect", address.clone()))
            }
            Endpoint::Pty(_) => bail!("the link is TCP or UDP: use --listen or --connect"),
        }
    }

    /// Returns a connection that was made without waiting for one; `None` without a client.
    ///
    /// # Errors
    /// Faults that a person must correct; a connection that cannot be opened now is the inner error.
    pub fn meet(&mut self) -> Result<Result<Option<(Carrier, String)>, String>> {
        Ok(match self {
            Self::Listen(arrivals) => {
                Ok(arrivals.newest()?.map(|(client, peer)| (Carrier::Tcp(client), peer.to_string())))
            }
            Self::Connect { address, dialing, tls, .. } => {
                match tls::Carrier::connect(address, *dialing, tls.as_ref(), Stream::new) {
                    Ok(client) => Ok(Some((Carrier::Tcp(client), address.clone()))),
                    Err(error) => Err(format!("{error:#}")),
                }
            }
            Self::Datagrams(socket, dialect) => Ok(first(socket, *dialect)?.map(|(socket, peer, first)| {
                (Carrier::Udp(Datagrams::of(socket, peer, first)), peer.to_string())
            })),
            Self::Peer(socket, address) => {
                Ok(Some((Carrier::Udp(Datagrams::connected(socket.try_clone()?)), address.clone())))
            }
        })
    }

    /// Returns whether another peer may replace a connected one: only the connection of the replaced peer ends then.
    pub fn takes_another(&self) -> bool {
        matches!(self, Self::Listen(_))
    }

    /// Returns the pause after a connection that could not be opened, or has ended.
    pub fn pause(&mut self) -> Duration {
        if let Self::Connect { backoff, .. } = self { backoff.pause() } else { Duration::ZERO }
    }

    /// Called when the peer has sent bytes: the next pause is the shortest again.
    pub fn answered(&mut self) {
        if let Self::Connect { backoff, .. } = self {
            backoff.answered();
        }
    }
}

impl Arrivals {
    /// Returns the client that has connected last, of those that have not disconnected again: each later one takes the place of
    /// the previous one. In TLS a client has connected when its handshake is over.
    fn newest(&mut self) -> Result<Option<(tls::Carrier<Stream>, SocketAddr)>> {
        let mut found = None;
        loop {
            match self.listener.accept() {
                Ok(Arrival::Client(client, peer)) => {
                    let client = TcpStream::from(client);
                    let has_left = match client.peek(&mut [0]) {
                        Ok(length) => length == 0,
                        Err(error) => error.kind() != ErrorKind::WouldBlock,
                    };
                    if has_left {
                        continue;
                    }
                    client.set_nonblocking(false)?;
                    let Some(tls) = &self.tls else {
                        found = Some((tls::Carrier::Plain(Stream::new(client)), peer));
                        continue;
                    };
                    if self.handshakes.len() == MAX_HANDSHAKES {
                        self.handshakes.pop_front();
                    }
                    self.handshakes.push_back((Box::new(Secure::begin(client, Arc::clone(tls))?), peer));
                }
                Ok(Arrival::Refused(peer)) => {
                    remark(&format!("refused {peer}: too many open files, see ulimit -n"));
                }
                // A client without room may be accepted at the next turn.
                Ok(Arrival::Nobody) | Err(_) => break,
            }
        }
        for _ in 0..self.handshakes.len() {
            let Some((mut client, peer)) = self.handshakes.pop_front() else { break };
            match client.is_ready() {
                Ok(true) => found = Some((tls::Carrier::Secure(client), peer)),
                Ok(false) => self.handshakes.push_back((client, peer)),
                Err(error) if admits("refused_client") => remark(&format!("refused {peer}: {error}")),
                Err(_) => {}
            }
        }
        Ok(found)
    }
}

/// Receives the first datagram that a robot can have sent; other datagrams are not answered.
fn first(socket: &UdpSocket, dialect: Dialect) -> Result<Option<(UdpSocket, SocketAddr, Vec<u8>)>> {
    let mut buffer = vec![0; MAX_DATAGRAM_LEN];
    // A flood of others does not keep the caller.
    for _ in 0..64 {
        match socket.recv_from(&mut buffer) {
            Ok((length, peer)) => {
                let bytes = buffer.get(..length).unwrap_or_default();
                let message = Message::decode(bytes, dialect.charset());
                if let Ok(Some((message, _))) = message
                    && dialect.read(&message).is_ok()
                {
                    return Ok(Some((socket.try_clone()?, peer, bytes.to_vec())));
                }
            }
            Err(error) if error.kind() == ErrorKind::WouldBlock => return Ok(None),
            Err(error) if is_lost_datagram(&error) => {}
            Err(error) => return Err(ConnectionLost(format!("the socket: {error}")).into()),
        }
    }
    Ok(None)
}

impl Transport for Carrier {
    fn receive(&mut self, buffer: &mut [u8], wait: Wait<'_>) -> std::io::Result<ReceiveOutcome> {
        match self {
            Self::Tcp(stream) => stream.receive(buffer, wait),
            Self::Udp(datagrams) => datagrams.receive(buffer, wait),
        }
    }

    fn send(&mut self, bytes: &[u8]) -> std::io::Result<SendOutcome> {
        match self {
            Self::Tcp(stream) => stream.send(bytes),
            Self::Udp(datagrams) => datagrams.send(bytes),
        }
    }

    fn discard_after(&mut self, after: Duration) -> std::io::Result<()> {
        match self {
            Self::Tcp(stream) => stream.discard_after(after),
            Self::Udp(datagrams) => datagrams.discard_after(after),
        }
    }

    fn wait_for_room(&mut self, wait: Wait<'_>) -> std::io::Result<()> {
        match self {
            Self::Tcp(stream) => stream.wait_for_room(wait),
            Self::Udp(datagrams) => datagrams.wait_for_room(wait),
        }
    }
}
