//! A blocking loop over any transport that reads with a deadline.

use core::ops::ControlFlow;
use core::time::Duration;
use std::io::{self, ErrorKind};
use std::net::{TcpStream, UdpSocket};
use std::sync::OnceLock;
use std::time::Instant;
use std::vec::Vec;

use crate::end_reason::{EndReason, keep_first, report, report_all};
use crate::pending::PendingWork;
use crate::session::Session;
use crate::step::Step;
use crate::trace::Span;
use crate::wait::{Wait, Waker};

/// A transport of bytes: a TCP connection, a serial port, a pseudo-terminal, a connected UDP socket.
pub trait Transport {
    /// Returns the time for the session: [`now`], unless the transport has a clock of its own, as a simulated line has. A
    /// clock that advances only in [`receive`](Self::receive) is for sessions that always [want input](Session::wants_input).
    fn now(&self) -> Duration {
        now()
    }

    /// Reads the bytes that have arrived, or waits for some, but no longer than `wait`. Every transport with a socket can use
    /// [`Wait::readable`] for this wait. A [`Waker`] does not end the wait of a transport that uses [`Wait::limit`] alone:
    /// its driver handles the wake after that wait, and a caller that cannot wait this long limits the turn.
    ///
    /// # Errors
    /// The errors of the transport. No bytes in time is not an error: [`ReceiveOutcome::Nothing`].
    fn receive(&mut self, buffer: &mut [u8], wait: Wait<'_>) -> io::Result<ReceiveOutcome>;

    /// Sends as many of `bytes` as it can without a wait. A transport that always sends them all may wait for a line that
    /// takes every byte in its time, and not for a peer that may not read.
    ///
    /// # Errors
    /// The errors of the transport, such as a connection that is lost in the middle.
    fn send(&mut self, bytes: &[u8]) -> io::Result<SendOutcome>;

    /// Sets the time after which bytes that the peer has not acknowledged are discarded, and the connection ends. Called once
    /// for each connection, with [`Session::discards_after`]. Only for a connection that buffers bytes for an unreachable
    /// peer.
    ///
    /// # Errors
    /// The errors of the transport.
    fn discard_after(&mut self, _after: Duration) -> io::Result<()> {
        Ok(())
    }

    /// Waits, without reading, until it takes bytes again after [a part](SendOutcome::Part). Every transport with a socket
    /// can use [`Wait::writable`] for this wait; by default, the driver tries again after 5 ms.
    ///
    /// # Errors
    /// The errors of the transport.
    fn wait_for_room(&mut self, wait: Wait<'_>) -> io::Result<()> {
        wait.at_most(Duration::from_millis(5)).pause()
    }
}

/// The result of [`Transport::receive`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ReceiveOutcome {
    /// This number of bytes was read.
    Bytes(usize),
    /// No byte has come before the wait ended.
    Nothing,
    /// The peer has closed the connection.
    Closed,
}

/// The location of the bytes when [`Transport::send`] returns.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum SendOutcome {
    /// This number of the bytes, perhaps 0, is in a buffer of the system, which is full. The driver gives the others again.
    Part(usize),
    /// All bytes are in a buffer of the system.
    Buffered,
    /// The last byte has left the port: the driver calls [`Session::handle_transmitted`].
    Transmitted,
}

/// Returns the time that [`drive`] gives to sessions: since the first call in this process, the same for every session. In a
/// runtime of tokio whose clock is paused it is the time of that clock: a handle, its task and its session then have the same
/// virtual time.
pub fn now() -> Duration {
    #[cfg(feature = "tokio")]
    let now = ::tokio::time::Instant::now().into_std();
    #[cfg(not(feature = "tokio"))]
    let now = Instant::now();
    now.saturating_duration_since(*START.get_or_init(|| now))
}

static START: OnceLock<Instant> = OnceLock::new();

/// Converts a time of [`now`]; `None` if the clock of the system does not reach it.
#[cfg(feature = "tokio")]
pub(crate) fn instant(at: Duration) -> Option<Instant> {
    START.get_or_init(Instant::now).checked_add(at)
}

/// Runs a session over a transport until `handler` breaks or the peer closes the connection. The session is connected before,
/// and disconnected after; `handler` gets the events of that too, but the first value that it breaks with is the one
/// returned. An error of the transport is returned in its place; the events have reported the outcomes of the requests in
/// flight. A session with inputs other than bytes and time needs a [`Driver`], for its [waker](Driver::waker).
///
/// # Errors
/// The errors of the transport.
pub fn drive<S: Session, B>(
    session: &mut S,
    transport: impl Transport,
    handler: impl FnMut(&mut S, S::Event) -> ControlFlow<B>,
) -> io::Result<EndReason<B>> {
    Span::of([S::LINK, S::END], None).within(|| run(session, transport, handler))
}

fn run<S: Session, B>(
    session: &mut S,
    transport: impl Transport,
    handler: impl FnMut(&mut S, S::Event) -> ControlFlow<B>,
) -> io::Result<EndReason<B>> {
    let mut value = None;
    let mut note = keep_first(&mut value, handler);
    let mut driver = Driver::new(transport);
    session.handle_connected(driver.transport.now());
    let ended = loop {
        match driver.turn(session, None, &mut note) {
            Ok(ControlFlow::Continue(())) => {}
            Ok(ControlFlow::Break(ended)) => break Ok(ended),
            Err(error) => break Err(error),
        }
    };
    session.handle_disconnected(driver.transport.now());
    report_all(session, &mut note);
    drop(note);
    ended.map(|ended| ended.or(value))
}

/// A transport and the buffers of its loop: for a caller that has other work between two turns.
#[derive(Debug)]
pub struct Driver<T> {
    transport: T,
    input: Vec<u8>,
    out: Vec<u8>,
    unsent: PendingWork,
    waker: Option<Waker>,
}

impl<T: Transport> Driver<T> {
    /// Creates a loop over `transport`. The caller calls [`Session::handle_connected`] and [`Session::handle_disconnected`].
    pub fn new(transport: T) -> Self {
        Self { transport, input: Vec::new(), out: Vec::new(), unsent: PendingWork::NOTHING, waker: None }
    }

    /// Replaces the time [`STALL`](crate::STALL).
    #[must_use]
    pub fn stall(self, stall: Duration) -> Self {
        Self { unsent: PendingWork::with_stall(stall), ..self }
    }

    /// Returns a waker that ends the wait of the current turn, or of the next.
    ///
    /// # Errors
    /// The errors of the system, which has no descriptor or no loopback address.
    pub fn waker(&mut self) -> io::Result<Waker> {
        let waker = self.waker.take().map_or_else(Waker::new, Ok)?;
        Ok(self.waker.insert(waker).clone())
    }

    /// Runs one turn: events and bytes to be sent, until there is neither or the transport takes no more, then one wait for
    /// bytes or until the transport takes more, until the session's timeout at most and no longer than `wait`, then the
    /// events of that. When it returns, every event was given to `handler`, unless that broke. While the session does not
    /// [want input](Session::wants_input), bytes stay in the transport.
    ///
    /// After a turn that was [woken](Self::waker) the next one does not wait: between the two, the caller passes on the
    /// change that has woken it.
    ///
    /// # Errors
    /// The errors of the transport.
    pub fn turn<S: Session, B>(
        &mut self,
        session: &mut S,
        wait: Option<Duration>,
        handler: impl FnMut(&mut S, S::Event) -> ControlFlow<B>,
    ) -> io::Result<ControlFlow<EndReason<B>>> {
        self.turn_with(session, wait, |_| Ok(()), handler)
    }

    /// As [`turn`](Self::turn), with a hook that is called before the session's bytes are sent: it stores the state that must
    /// survive the program, such as the number of jobs of an order that were sent, so that the peer has received nothing that
    /// was not stored.
    ///
    /// # Errors
    /// The errors of the transport and of `before_send`. After an error of `before_send` nothing is sent, and the connection
    /// is over.
    pub fn turn_with<S: Session, B>(
        &mut self,
        session: &mut S,
        wait: Option<Duration>,
        before_send: impl FnMut(&mut S) -> io::Result<()>,
        handler: impl FnMut(&mut S, S::Event) -> ControlFlow<B>,
    ) -> io::Result<ControlFlow<EndReason<B>>> {
        if core::mem::take(&mut self.unsent.is_new)
            && let Some(after) = session.discards_after()
        {
            self.transport.discard_after(after)?;
        }
        let turned = self.pass(session, wait, before_send, handler);
        self.unsent.after(turned)
    }

    fn pass<S: Session, B>(
        &mut self,
        session: &mut S,
        wait: Option<Duration>,
        mut before_send: impl FnMut(&mut S) -> io::Result<()>,
        mut handler: impl FnMut(&mut S, S::Event) -> ControlFlow<B>,
    ) -> io::Result<ControlFlow<EndReason<B>>> {
        if let ControlFlow::Break(value) = self.settle(session, &mut before_send, &mut handler)? {
            return Ok(ControlFlow::Break(EndReason::ByHandler(value)));
        }
        let Self { transport, input, unsent, waker, .. } = self;
        let now = transport.now();
        let due = unsent.due(session, now).map(|at| at.saturating_sub(now));
        let limit = if unsent.woken { due } else { due.into_iter().chain(wait).min() };
        let wait = Wait::new(limit, waker.as_ref(), unsent.is_some());
        if session.wants_input() {
            input.resize(S::MAX_INPUT, 0);
            match transport.receive(input, wait)? {
                ReceiveOutcome::Bytes(length) => {
                    session.handle_input(transport.now(), input.get(..length).unwrap_or_default());
                }
                ReceiveOutcome::Nothing => {}
                ReceiveOutcome::Closed => return Ok(ControlFlow::Break(EndReason::ByPeer)),
            }
        } else if unsent.is_some() {
            transport.wait_for_room(wait)?;
        } else {
            wait.pause()?;
        }
        unsent.woken = waker.as_ref().is_some_and(Waker::take);
        let now = transport.now();
        session.handle_timeout(now);
        if unsent.is_stalled(now) {
            return Ok(ControlFlow::Break(EndReason::Stalled));
        }
        Ok(report(session, &mut handler).map_break(EndReason::ByHandler))
    }

    /// Handles events and sends bytes, until there is neither, or the transport takes no more.
    fn settle<S: Session, B>(
        &mut self,
        session: &mut S,
        before_send: &mut impl FnMut(&mut S) -> io::Result<()>,
        handler: &mut impl FnMut(&mut S, S::Event) -> ControlFlow<B>,
    ) -> io::Result<ControlFlow<B>> {
        let Self { transport, out, unsent, .. } = self;
        out.resize(out.len().max(S::MAX_TRANSMIT), 0); // of another session there may be more left
        loop {
            match unsent.next(session, transport.now(), out) {
                Step::Event(event) => {
                    if let broken @ ControlFlow::Break(_) = handler(session, event) {
                        return Ok(broken);
                    }
                    continue;
                }
                Step::Write(_) => {}
                Step::Wait { .. } => return Ok(ControlFlow::Continue(())),
            }
            if unsent.hook_pending {
                before_send(session)?;
                unsent.hook_pending = false;
            }
            let bytes = unsent.of(out);
            let sent = transport.send(bytes)?;
            let taken = if let SendOutcome::Part(length) = sent { length } else { bytes.len() };
            unsent.take(taken, transport.now());
            match sent {
                SendOutcome::Part(_) => return Ok(report(session, handler)),
                SendOutcome::Buffered => {}
                SendOutcome::Transmitted => session.handle_transmitted(transport.now()),
            }
        }
    }

    /// Returns the transport. After a reconnection it has no earlier bytes once the last turn has reported the end of the
    /// connection.
    pub fn transport_mut(&mut self) -> &mut T {
        &mut self.transport
    }
}

impl<T: Transport + ?Sized> Transport for &mut T {
    fn now(&self) -> Duration {
        (**self).now()
    }

    fn receive(&mut self, buffer: &mut [u8], wait: Wait<'_>) -> io::Result<ReceiveOutcome> {
        (**self).receive(buffer, wait)
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<SendOutcome> {
        (**self).send(bytes)
    }

    fn discard_after(&mut self, after: Duration) -> io::Result<()> {
        (**self).discard_after(after)
    }

    fn wait_for_room(&mut self, wait: Wait<'_>) -> io::Result<()> {
        (**self).wait_for_room(wait)
    }
}

impl Transport for TcpStream {
    fn receive(&mut self, buffer: &mut [u8], wait: Wait<'_>) -> io::Result<ReceiveOutcome> {
        if !wait.readable(&*self)? {
            return Ok(ReceiveOutcome::Nothing);
        }
        match receive_some(self, buffer) {
            Ok(0) => Ok(ReceiveOutcome::Closed),
            Ok(length) => Ok(ReceiveOutcome::Bytes(length)),
            Err(error) if is_silence(&error) => Ok(ReceiveOutcome::Nothing),
            Err(error) => Err(error),
        }
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<SendOutcome> {
        match send_some(self, bytes) {
            Ok(length) if length == bytes.len() => Ok(SendOutcome::Buffered),
            Ok(0) => Err(ErrorKind::WriteZero.into()),
            Ok(length) => Ok(SendOutcome::Part(length)),
            Err(error) if is_silence(&error) => Ok(SendOutcome::Part(0)),
            Err(error) => Err(error),
        }
    }

    fn discard_after(&mut self, after: Duration) -> io::Result<()> {
        discard_unacknowledged(self, after)
    }

    fn wait_for_room(&mut self, wait: Wait<'_>) -> io::Result<()> {
        wait.writable(&*self).map(drop)
    }
}

/// Discards the bytes of a TCP connection that its peer has not acknowledged after this time, even if the program has ended,
/// and ends the connection with [`ErrorKind::TimedOut`]. Without this, the system sends a request again for many minutes: a
/// robot executes it when its cable is back. On Linux and Android; other systems have no such limit in milliseconds, and
/// there this does nothing.
///
/// # Errors
/// The errors of the system.
#[cfg(any(target_os = "linux", target_os = "android"))]
pub fn discard_unacknowledged(stream: impl std::os::fd::AsFd, after: Duration) -> io::Result<()> {
    let ms = u32::try_from(after.as_millis()).unwrap_or(u32::MAX).max(1); // 0 is the system's own limit
    Ok(rustix::net::sockopt::set_tcp_user_timeout(stream, ms)?)
}

/// Does nothing: this system has no such limit in milliseconds.
#[cfg(not(any(target_os = "linux", target_os = "android")))]
pub fn discard_unacknowledged<T>(_stream: T, _after: Duration) -> io::Result<()> {
    Ok(())
}

/// Exchanges datagrams with the peer that the socket is connected to. A lost datagram and a missing peer are not errors.
impl Transport for UdpSocket {
    fn receive(&mut self, buffer: &mut [u8], wait: Wait<'_>) -> io::Result<ReceiveOutcome> {
        if !wait.readable(&*self)? {
            return Ok(ReceiveOutcome::Nothing);
        }
        #[cfg(unix)]
        let received = receive_some(self, buffer);
        #[cfg(not(unix))]
        let received = self.recv(buffer);
        match received {
            Ok(length) => Ok(ReceiveOutcome::Bytes(length)),
            Err(error) if is_silence(&error) || is_lost_datagram(&error) => Ok(ReceiveOutcome::Nothing),
            Err(error) => Err(error),
        }
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<SendOutcome> {
        match UdpSocket::send(self, bytes) {
            Err(error) if is_unsendable(&error) => Err(error),
            // The datagram is as good as lost on its way.
            _ => Ok(SendOutcome::Buffered),
        }
    }
}

/// Reads the bytes that have arrived. A blocking socket does not wait, even if it was reported readable and is not, or
/// another reader has read the bytes.
#[cfg(unix)]
fn receive_some(socket: &impl std::os::fd::AsFd, buffer: &mut [u8]) -> io::Result<usize> {
    use rustix::net::{RecvFlags, recv};
    Ok(recv(socket, buffer, RecvFlags::DONTWAIT)?.0)
}

#[cfg(not(unix))]
fn receive_some(stream: &mut TcpStream, buffer: &mut [u8]) -> io::Result<usize> {
    use std::io::Read as _;
    stream.read(buffer)
}

/// Sends the bytes that fit the system's buffer. A blocking socket does not wait for the rest.
#[cfg(unix)]
fn send_some(stream: &mut TcpStream, bytes: &[u8]) -> io::Result<usize> {
    use rustix::net::{SendFlags, send};
    // Systems without this flag: the standard library has turned the signal off.
    #[cfg(not(target_vendor = "apple"))]
    const FLAGS: SendFlags = SendFlags::DONTWAIT.union(SendFlags::NOSIGNAL);
    #[cfg(target_vendor = "apple")]
    const FLAGS: SendFlags = SendFlags::DONTWAIT;
    Ok(send(stream, bytes, FLAGS)?)
}

#[cfg(not(unix))]
fn send_some(stream: &mut TcpStream, bytes: &[u8]) -> io::Result<usize> {
    use std::io::Write as _;
    stream.set_nonblocking(true)?;
    let sent = stream.write(bytes);
    stream.set_nonblocking(false)?;
    sent
}

/// Returns whether a read or a write has ended because nothing came in time, or because a signal came. Returns false for the
/// system's own [`ErrorKind::TimedOut`], which ends a TCP connection whose peer has acknowledged nothing in time.
pub fn is_silence(error: &io::Error) -> bool {
    match error.kind() {
        ErrorKind::WouldBlock | ErrorKind::Interrupted => true,
        ErrorKind::TimedOut => cfg!(windows) || error.raw_os_error().is_none(),
        _ => false,
    }
}

/// Returns whether an error of a UDP socket is about one datagram and not about the socket: the datagram was not delivered,
/// or was longer than any message. Windows has errors of its own for that: it reports a reset, and refuses to truncate a
/// datagram that is too long.
pub fn is_lost_datagram(error: &io::Error) -> bool {
    /// `WSAEMSGSIZE`, which has no kind.
    const TOO_LONG: i32 = 10040;
    matches!(error.kind(), ErrorKind::ConnectionRefused | ErrorKind::ConnectionReset)
        || cfg!(windows) && error.raw_os_error() == Some(TOO_LONG)
}

/// Returns whether an error of a UDP socket says that a datagram can never be sent: it has no address, or one that nobody can
/// have, or is longer than any.
pub fn is_unsendable(error: &io::Error) -> bool {
    use rustix::io::Errno;
    matches!(error.kind(), ErrorKind::InvalidInput | ErrorKind::NotConnected)
        || matches!(Errno::from_io_error(error), Some(Errno::DESTADDRREQ | Errno::MSGSIZE))
}
