//! The connection of the two ends: over TCP one of them listens, by default the PC (thesis, section 10.4); over UDP the robot
//! sends first.

use std::io::ErrorKind;
use std::net::{TcpStream, UdpSocket};
use std::time::Duration;

use anyhow::{Result, bail, ensure};
use cellwire_sim::host::{Arrival, ConnectionEnd, Listener};
use kawasaki_msg::{Dialect, Message};
use robot_session::tls::Secure;
use robot_session::{Transport, is_lost_datagram};

use cellwire_io::backoff::Backoff;
use cellwire_io::drive::ConnectionLost;
use cellwire_io::endpoint::Endpoint;
use cellwire_io::output::{admits, remark};
use cellwire_io::stream::Stream;
use cellwire_io::tcp::{self, Dialing};
use cellwire_io::tls::{Carrier, Tls, TlsArgs};
use cellwire_io::udp::{self, Datagrams};

/// The longest datagram.
const MAX_DATAGRAM_LEN: usize = 65536;

/// The end that is connected.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// The PC connects whenever it can.
    Pc,
    /// The robot connects when its session requests it, if PCs do not connect to it.
    Robot,
}

impl Side {
    /// Returns the end of a connection in words.
    pub(super) fn reason(self, ending: &ConnectionEnd) -> String {
        let peer = if self == Self::Pc { "robot" } else { "PC" };
        match ending {
            ConnectionEnd::ByPeer => format!("the {peer} closed the connection"),
            ConnectionEnd::Stopped if self == Self::Robot => "the robot is switched off".into(),
            ConnectionEnd::Stopped => "the PC has ended".into(),
            ConnectionEnd::Replaced => format!("another {peer} has connected"),
            ending => ending.to_string(),
        }
    }
}

/// The address of the peer: listen, connect, or datagrams.
#[derive(Debug)]
pub enum PeerEndpoint {
    /// This end listens, and the other end connects.
    Listen(Listener),
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

/// The transport of a connection, and the name of its peer.
pub type Met = (Box<dyn Transport>, String);

impl PeerEndpoint {
    /// Opens the endpoint of an end; where it is reached, or reaches the other end. `udp` is the table of its messages if they
    /// are datagrams.
    ///
    /// # Errors
    /// If it cannot be opened.
    pub fn open(
        side: Side,
        endpoint: &Endpoint,
        udp: Option<Dialect>,
        dialing: Dialing,
        tls: &TlsArgs,
    ) -> Result<(Self, &'static str, String)> {
        ensure!(udp.is_none() || !tls.is_given(), "--tls is for TCP, and the setting udp is given");
        match (endpoint, udp, side) {
            (Endpoint::Pty(_), ..) => bail!("the link is TCP or UDP: use --listen or --connect"),
            (Endpoint::Listen(address), Some(dialect), Side::Pc) => {
                let socket = udp::bind(address)?;
                let place = socket.local_addr()?.to_string();
                Ok((Self::Datagrams(socket, dialect), "listen", place))
            }
            (Endpoint::Connect(address), Some(_), Side::Robot) => {
                Ok((Self::Peer(udp::connect(address)?, address.clone()), "connect", address.clone()))
            }
            (_, Some(_), Side::Pc) => bail!("over UDP the robot sends first: use --listen"),
            (_, Some(_), Side::Robot) => bail!("over UDP the robot sends first: use --connect"),
            (Endpoint::Listen(address), None, _) => {
                let tls = tls.server()?;
                let listener = tcp::listen(address)?;
                let place = listener.local_addr()?.to_string();
                Ok((Self::Listen(Listener::new(listener)?.with_tls(tls)), "listen", place))
            }
            (Endpoint::Connect(address), None, _) => {
                let (backoff, tls) = (Backoff::default(), tls.client()?);
                let meeting = Self::Connect { address: address.clone(), dialing, backoff, tls };
                Ok((meeting, "connect", address.clone()))
            }
        }
    }

    /// Returns a connection that was made without waiting for one; `None` without a client.
    ///
    /// # Errors
    /// Faults that a person must correct; a connection that cannot be opened now is the inner error.
    pub fn meet(&mut self) -> Result<Result<Option<Met>, String>> {
        Ok(match self {
            Self::Listen(listener) => Ok(newest(listener)?),
            Self::Connect { address, dialing, tls, .. } => {
                match Carrier::connect(address, *dialing, tls.as_ref(), Stream::new) {
                    Ok(client) => Ok(Some((Box::new(client), address.clone()))),
                    Err(error) => Err(format!("{error:#}")),
                }
            }
            Self::Datagrams(socket, dialect) => Ok(first(socket, *dialect)?),
            Self::Peer(socket, address) => {
                Ok(Some((Box::new(Datagrams::connected(socket.try_clone()?)), address.clone())))
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

/// Returns the client that has connected last, of those that have not disconnected again: each later one takes the place of the
/// previous one.
fn newest(listener: &mut Listener) -> Result<Option<Met>> {
    let mut found: Option<Met> = None;
    loop {
        match listener.accept() {
            Ok(Arrival::Client(client, peer)) => {
                let stream = TcpStream::from(client.tcp);
                let has_left = match stream.peek(&mut [0]) {
                    Ok(length) => length == 0,
                    Err(error) => error.kind() != ErrorKind::WouldBlock,
                };
                if has_left {
                    continue;
                }
                stream.set_nonblocking(false)?;
                let client = match client.tls {
                    None => Carrier::Plain(Stream::new(stream)),
                    Some(tls) => Carrier::Secure(Box::new(Secure::new(stream, *tls))),
                };
                found = Some((Box::new(client), peer.to_string()));
            }
            Ok(Arrival::Refused(peer, why)) if admits("refused_client") => {
                remark(&format!("refused {peer}: {why}"));
            }
            Ok(Arrival::Refused(..)) => {}
            // A client for which the system has no resources may be accepted at the next turn.
            Ok(Arrival::Nobody) | Err(_) => return Ok(found),
        }
    }
}

/// Receives the first datagram that a robot can have sent; other datagrams are not answered.
fn first(socket: &UdpSocket, dialect: Dialect) -> Result<Option<Met>> {
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
                    let datagrams = Datagrams::of(socket.try_clone()?, peer, bytes.to_vec());
                    return Ok(Some((Box::new(datagrams), peer.to_string())));
                }
            }
            Err(error) if error.kind() == ErrorKind::WouldBlock => return Ok(None),
            Err(error) if is_lost_datagram(&error) => {}
            Err(error) => return Err(ConnectionLost(format!("the socket: {error}")).into()),
        }
    }
    Ok(None)
}
