//! The ways in which a [`Task`](super::Task) makes its connections.

use core::fmt;
use core::future::{Future, pending};
use core::net::SocketAddr;
use core::pin::Pin;
use core::task::{Context, Poll, ready};
use core::time::Duration;
use std::io;
use std::string::{String, ToString};
use std::vec;
use std::vec::Vec;

use ::tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use ::tokio::net::{TcpListener, TcpStream, ToSocketAddrs, UdpSocket, lookup_host};
use ::tokio::time::{sleep, timeout};
use socket2::{SockRef, TcpKeepalive};

use crate::{discard_unacknowledged, is_lost_datagram, is_unsendable};

/// Makes one connection after the other. A closure that dials is a connector, as [`Dial`].
pub trait Connector: Send {
    /// The transport of the bytes.
    type Transport: AsyncRead + AsyncWrite + Unpin + Send + 'static;

    /// Whether the connector dials: then a lost connection is followed by a pause. A connector that listens accepts the next
    /// peer at once.
    const DIALS: bool = true;

    /// Makes a connection, or waits for one. A dropped future has not made a connection.
    fn connect(&mut self) -> impl Future<Output = io::Result<Self::Transport>> + Send;

    /// Sets the time for all connections from now on after which bytes that the peer has not acknowledged are discarded, and
    /// the connection ends: [`Session::discards_after`](crate::Session::discards_after).
    fn discard_after(&mut self, _after: Duration) {}

    /// Returns the peer of the last attempt, for records of `tracing`: an address or the name of a port. `None`: unknown.
    fn peer(&self) -> Option<String> {
        None
    }

    /// Waits until another connection, which [`connect`](Self::connect) then returns, replaces the one in use. Never returns
    /// if it dials.
    fn replaced(&mut self) -> impl Future<Output = ()> + Send {
        pending()
    }
}

/// Dials with a closure: a TLS stream, a pipe of a test.
#[derive(Debug, Clone)]
pub struct Dial<F>(pub F);

impl<F, C, T> Connector for Dial<F>
where
    F: FnMut() -> C + Send,
    C: Future<Output = io::Result<T>> + Send,
    T: AsyncRead + AsyncWrite + Unpin + Send + 'static,
{
    type Transport = T;

    fn connect(&mut self) -> impl Future<Output = io::Result<T>> + Send {
        self.0()
    }
}

/// Dials a TCP peer by name or address and port. The name is looked up for each connection.
#[derive(Debug, Clone)]
pub struct Tcp {
    address: String,
    timeout: Duration,
    discard_after: Option<Duration>,
}

impl Tcp {
    /// Dials an address such as `"192.168.0.10:502"` or `"robot.local:502"`. An attempt ends after 5 s.
    pub fn new(address: impl Into<String>) -> Self {
        Self { address: address.into(), timeout: Duration::from_secs(5), discard_after: None }
    }

    /// Sets the longest time of an attempt.
    #[must_use]
    pub fn timeout(self, timeout: Duration) -> Self {
        Self { timeout, ..self }
    }

    /// Adds the expected form to the error of an invalid address, which no attempt can reach.
    fn explain(&self, error: io::Error) -> io::Error {
        if error.kind() != io::ErrorKind::InvalidInput {
            return error;
        }
        let text = std::format!("{:?} is no address: give HOST:PORT, such as 192.168.0.10:502", self.address);
        io::Error::new(error.kind(), text)
    }
}

impl Connector for Tcp {
    type Transport = TcpStream;

    async fn connect(&mut self) -> io::Result<TcpStream> {
        let connect = timeout(self.timeout, TcpStream::connect(&self.address));
        let stream =
            connect.await.map_err(|_| io::ErrorKind::TimedOut)?.map_err(|error| self.explain(error))?;
        prepare(&stream, self.discard_after)?;
        Ok(stream)
    }

    fn discard_after(&mut self, after: Duration) {
        self.discard_after = Some(after);
    }

    fn peer(&self) -> Option<String> {
        Some(self.address.clone())
    }
}

/// Accepts TCP peers, one at a time. A later peer replaces an earlier one: a robot that was switched off and on is back
/// before its first connection is known to be dead.
#[derive(Debug)]
pub struct Listen {
    address: String,
    listener: Option<TcpListener>,
    next: Option<TcpStream>,
    peer: Option<SocketAddr>,
    discard_after: Option<Duration>,
}

impl Listen {
    /// Listens at an address.
    ///
    /// # Errors
    /// The errors of the system: the address is in use, or does not belong to this computer.
    pub async fn bind(address: impl ToSocketAddrs) -> io::Result<Self> {
        let listener = TcpListener::bind(address).await?;
        let address = listener.local_addr()?.to_string();
        Ok(Self { listener: Some(listener), ..Self::at(address) })
    }

    /// Listens at an address, such as `"0.0.0.0:9105"`, from the first attempt to connect on. While that is not possible, for
    /// example because the address is in use, the attempts fail with this reason, and are repeated.
    pub fn at(address: impl Into<String>) -> Self {
        Self { address: address.into(), listener: None, next: None, peer: None, discard_after: None }
    }

    /// Returns the address at which it listens: for port 0, with the port that the system has chosen.
    ///
    /// # Errors
    /// The errors of the system. It does not listen yet ([`at`](Self::at)).
    pub fn address(&self) -> io::Result<SocketAddr> {
        self.listener.as_ref().ok_or(io::ErrorKind::NotConnected)?.local_addr()
    }
}

impl Connector for Listen {
    type Transport = TcpStream;

    const DIALS: bool = false;

    async fn connect(&mut self) -> io::Result<TcpStream> {
        let stream = match self.next.take() {
            Some(stream) => stream,
            None => {
                let listener = match &mut self.listener {
                    Some(listener) => listener,
                    none => none.insert(listen(&self.address, TcpListener::bind(&self.address).await)?),
                };
                listener.accept().await?.0
            }
        };
        self.peer = stream.peer_addr().ok();
        prepare(&stream, self.discard_after)?;
        Ok(stream)
    }

    fn discard_after(&mut self, after: Duration) {
        self.discard_after = Some(after);
    }

    fn peer(&self) -> Option<String> {
        self.peer.map(|peer| peer.to_string())
    }

    async fn replaced(&mut self) {
        let Some(listener) = &self.listener else { return pending().await };
        while self.next.is_none() {
            match listener.accept().await {
                Ok((stream, _)) => self.next = Some(stream),
                // No descriptor is free at present, or the peer has already gone.
                Err(_) => sleep(Duration::from_millis(100)).await,
            }
        }
    }
}

/// Returns the result of an attempt to listen, with an error that names the address.
fn listen<T>(address: &str, bound: io::Result<T>) -> io::Result<T> {
    bound.map_err(|error| io::Error::new(error.kind(), std::format!("cannot listen at {address}: {error}")))
}

/// Sets the options of a connection: no delay, since small messages are useless if they are late; keepalive, since a peer
/// without power is silent.
pub(super) fn prepare(stream: &TcpStream, discard_after: Option<Duration>) -> io::Result<()> {
    stream.set_nodelay(true)?;
    if let Some(after) = discard_after {
        discard_unacknowledged(stream, after)?;
    }
    let keepalive =
        TcpKeepalive::new().with_time(Duration::from_secs(10)).with_interval(Duration::from_secs(5));
    SockRef::from(stream).set_tcp_keepalive(&keepalive)
}

/// Datagrams to and from one peer by name or address and port.
#[derive(Debug, Clone)]
pub struct Udp {
    local: SocketAddr,
    peer: String,
}

impl Udp {
    /// Sends from the address `local`; the system chooses a port for 0.
    pub fn new(local: SocketAddr, peer: impl Into<String>) -> Self {
        Self { local, peer: peer.into() }
    }
}

impl Connector for Udp {
    type Transport = Datagrams;

    async fn connect(&mut self) -> io::Result<Datagrams> {
        let socket = UdpSocket::bind(self.local).await?;
        let of_its_kind = |peer: &SocketAddr| peer.is_ipv4() == self.local.is_ipv4();
        let peer = lookup_host(&self.peer).await?.find(of_its_kind).ok_or(io::ErrorKind::AddrNotAvailable)?;
        socket.connect(peer).await?;
        Ok(Datagrams::from(socket))
    }

    fn peer(&self) -> Option<String> {
        Some(self.peer.clone())
    }
}

/// Datagrams to and from a peer that sends first: the sender of the first datagram that is accepted, one peer at a time. The
/// datagrams of others are not read until the connection has ended, for example because its peer is silent.
pub struct UdpListen<F> {
    address: String,
    accepts: F,
    peer: Option<SocketAddr>,
}

impl<F: FnMut(&[u8]) -> bool> UdpListen<F> {
    /// Listens at an address, such as `"0.0.0.0:9105"`; `accepts` returns whether a datagram can be the first one of a peer.
    /// While that is not possible, the attempts to connect fail with this reason, and are repeated.
    pub fn at(address: impl Into<String>, accepts: F) -> Self {
        Self { address: address.into(), accepts, peer: None }
    }
}

impl<F: FnMut(&[u8]) -> bool + Send> Connector for UdpListen<F> {
    type Transport = Datagrams;

    const DIALS: bool = false;

    async fn connect(&mut self) -> io::Result<Datagrams> {
        self.peer = None;
        let socket = listen(&self.address, UdpSocket::bind(&self.address).await)?;
        let mut first = vec![0; MAX_DATAGRAM_LEN];
        loop {
            match socket.recv_from(&mut first).await {
                Ok((length, peer)) => {
                    first.truncate(length);
                    if (self.accepts)(&first) {
                        socket.connect(peer).await?;
                        self.peer = Some(peer);
                        return Ok(Datagrams { socket, only: Some(peer), first: Some(first) });
                    }
                    first.resize(MAX_DATAGRAM_LEN, 0);
                }
                Err(error) if is_lost_datagram(&error) => {}
                Err(error) => return Err(error),
            }
        }
    }

    fn peer(&self) -> Option<String> {
        self.peer.map(|peer| peer.to_string())
    }
}

impl<F> fmt::Debug for UdpListen<F> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("UdpListen").field("address", &self.address).finish_non_exhaustive()
    }
}

/// The length of the longest datagram, in bytes.
const MAX_DATAGRAM_LEN: usize = 65536;

/// A connected UDP socket as a transport: the bytes of one write are a datagram, and so are those of one read. A lost
/// datagram or an absent peer is not an error; an empty datagram is skipped.
#[derive(Debug)]
pub struct Datagrams {
    socket: UdpSocket,
    /// The peer whose datagrams are accepted, if the socket has been open for others: their datagrams may still be in it.
    only: Option<SocketAddr>,
    /// The datagram whose sender became the peer.
    first: Option<Vec<u8>>,
}

impl Datagrams {
    /// Returns the address that it sends from.
    ///
    /// # Errors
    /// The errors of the system.
    pub fn local_addr(&self) -> io::Result<SocketAddr> {
        self.socket.local_addr()
    }
}

/// Uses a socket that is connected to its peer.
impl From<UdpSocket> for Datagrams {
    fn from(socket: UdpSocket) -> Self {
        Self { socket, only: None, first: None }
    }
}

impl AsyncRead for Datagrams {
    fn poll_read(
        self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let Self { socket, only, first } = self.get_mut();
        if let Some(first) = first.take() {
            // The bytes that do not fit are lost, as of any datagram.
            buffer.put_slice(first.get(..buffer.remaining()).unwrap_or(&first));
            return Poll::Ready(Ok(()));
        }
        let before = buffer.filled().len();
        loop {
            match ready!(socket.poll_recv_from(context, buffer)) {
                Ok(peer) if only.is_some_and(|only| peer != only) => buffer.set_filled(before),
                Ok(_) if buffer.filled().len() > before => return Poll::Ready(Ok(())),
                Err(error) if !is_lost_datagram(&error) => return Poll::Ready(Err(error)),
                Ok(_) | Err(_) => {}
            }
        }
    }
}

impl AsyncWrite for Datagrams {
    fn poll_write(self: Pin<&mut Self>, context: &mut Context<'_>, bytes: &[u8]) -> Poll<io::Result<usize>> {
        match ready!(self.socket.poll_send(context, bytes)) {
            Err(error) if is_unsendable(&error) => Poll::Ready(Err(error)),
            // The datagram is as good as lost on its way.
            _ => Poll::Ready(Ok(bytes.len())),
        }
    }

    fn poll_flush(self: Pin<&mut Self>, _context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Poll::Ready(Ok(()))
    }

    fn poll_shutdown(self: Pin<&mut Self>, _context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Poll::Ready(Ok(()))
    }
}

/// Opens a serial port by its path or name. A port that vanishes, such as an adapter that is pulled, is opened again when it
/// is back.
#[cfg(feature = "tokio-serial")]
#[derive(Debug, Clone)]
pub struct Serial(pub tokio_serial::SerialPortBuilder);

#[cfg(feature = "tokio-serial")]
impl Connector for Serial {
    type Transport = tokio_serial::SerialStream;

    async fn connect(&mut self) -> io::Result<tokio_serial::SerialStream> {
        Ok(tokio_serial::SerialStream::open(&self.0)?)
    }
}
