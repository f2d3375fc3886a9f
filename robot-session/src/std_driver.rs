//! A blocking loop over any transport that reads with a deadline.

use core::ops::ControlFlow;
use core::time::Duration;
use std::io::{self, ErrorKind, Read, Write};
use std::net::TcpStream;
use std::sync::OnceLock;
use std::thread;
use std::time::Instant;
use std::vec::Vec;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fd::AsFd;

use crate::session::Session;
use crate::settle::{Output, settle};

/// What carries bytes: a TCP connection, a serial port, a pseudo-terminal, a connected UDP socket.
pub trait Transport {
    /// The time that the session is given: [`now`], unless what carries the bytes has a clock of its own, as a simulated line has.
    fn now(&self) -> Duration {
        now()
    }

    /// Reads what has arrived, or waits until something does, but no longer than `wait`; `None` is without limit.
    ///
    /// # Errors
    /// The transport's own. Nothing in time is no error: [`Received::Nothing`].
    fn receive(&mut self, buffer: &mut [u8], wait: Option<Duration>) -> io::Result<Received>;

    /// Sends all of `bytes`.
    ///
    /// # Errors
    /// The transport's own; a connection that is lost in the middle is one.
    fn send(&mut self, bytes: &[u8]) -> io::Result<Sent>;

    /// Waits without reading, for a session that does not [want input](Session::wants_input).
    fn pause(&mut self, wait: Duration) {
        thread::sleep(wait);
    }
}

/// What [`Transport::receive`] brought.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Received {
    /// So many bytes.
    Bytes(usize),
    /// Nothing in time.
    Nothing,
    /// The peer has closed the connection.
    Closed,
}

/// Where the bytes are when [`Transport::send`] returns.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Sent {
    /// In a buffer of the system.
    Buffered,
    /// The last one has left the port: the driver calls [`Session::handle_transmitted`].
    Transmitted,
}

/// How a loop ended that no error ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Ended<B> {
    /// The handler has ended it.
    ByHandler(B),
    /// The peer has closed the connection.
    ByPeer,
}

/// The time that [`drive`] gives to sessions: since the first call in this process, the same for every session.
pub fn now() -> Duration {
    static START: OnceLock<Instant> = OnceLock::new();
    START.get_or_init(Instant::now).elapsed()
}

/// Runs a session over a transport until `handler` breaks or the peer closes the connection. The session is connected before,
/// and disconnected after; `handler` gets the events of that too, but the first value that it breaks with is the one returned.
///
/// # Errors
/// The transport's.
pub fn drive<S: Session, B>(
    session: &mut S,
    transport: impl Transport,
    mut handler: impl FnMut(&mut S, S::Event) -> ControlFlow<B>,
) -> io::Result<Ended<B>> {
    let mut driver = Driver::new(transport);
    session.handle_connected(driver.transport.now());
    let ended = loop {
        match driver.turn(session, None, &mut handler) {
            Ok(ControlFlow::Continue(())) => {}
            Ok(ControlFlow::Break(ended)) => break Ok(ended),
            Err(error) => break Err(error),
        }
    };
    session.handle_disconnected(driver.transport.now());
    wind_down(session, &mut handler, ended)
}

/// While a session does not want input, it is asked so often whether its caller has made it want some.
pub(crate) const HELD: Duration = Duration::from_millis(10);

/// A transport and the buffers of its loop: for a caller who has something else to do between two turns.
#[derive(Debug)]
pub struct Driver<T> {
    transport: T,
    input: Vec<u8>,
    out: Vec<u8>,
}

impl<T: Transport> Driver<T> {
    /// A loop over `transport`. The caller calls [`Session::handle_connected`] and [`Session::handle_disconnected`].
    pub fn new(transport: T) -> Self {
        Self { transport, input: Vec::new(), out: Vec::new() }
    }

    /// One turn: events, then what is to be sent, then one wait for bytes, until the session's timeout at most and no longer
    /// than `wait`, then the events of that. When it returns, every event was given to `handler`, unless that broke. While the
    /// session does not [want input](Session::wants_input), bytes stay in the transport, and a wait is 10 ms at most.
    ///
    /// # Errors
    /// The transport's.
    pub fn turn<S: Session, B>(
        &mut self,
        session: &mut S,
        wait: Option<Duration>,
        mut handler: impl FnMut(&mut S, S::Event) -> ControlFlow<B>,
    ) -> io::Result<ControlFlow<Ended<B>>> {
        let Self { transport, input, out } = self;
        out.resize(S::MAX_TRANSMIT, 0);
        let settled = settle(session, transport.now(), out, |session, output| match output {
            Output::Event(event) => handler(session, event).map_break(|value| Ok(Ended::ByHandler(value))),
            Output::Transmit(bytes) => match transport.send(bytes) {
                Ok(sent) => {
                    if sent == Sent::Transmitted {
                        session.handle_transmitted(transport.now());
                    }
                    ControlFlow::Continue(())
                }
                Err(error) => ControlFlow::Break(Err(error)),
            },
        });
        if let ControlFlow::Break(ended) = settled {
            return ended.map(ControlFlow::Break);
        }
        let due = session.poll_timeout().map(|at| at.saturating_sub(transport.now()));
        let wait = due.into_iter().chain(wait).min();
        if session.wants_input() {
            input.resize(S::MAX_INPUT, 0);
            match transport.receive(input, wait)? {
                Received::Bytes(length) => {
                    session.handle_input(transport.now(), input.get(..length).unwrap_or_default());
                }
                Received::Nothing => {}
                Received::Closed => return Ok(ControlFlow::Break(Ended::ByPeer)),
            }
        } else {
            transport.pause(wait.map_or(HELD, |wait| wait.min(HELD)));
        }
        session.handle_timeout(transport.now());
        Ok(report(session, &mut handler).map_break(Ended::ByHandler))
    }

    /// The transport.
    pub fn transport_mut(&mut self) -> &mut T {
        &mut self.transport
    }
}

/// Gives the events of the end to `handler`, all of them: what ended the loop first stays its end.
pub(crate) fn wind_down<S: Session, B>(
    session: &mut S,
    handler: &mut impl FnMut(&mut S, S::Event) -> ControlFlow<B>,
    ended: io::Result<Ended<B>>,
) -> io::Result<Ended<B>> {
    let mut value = None;
    while let Some(event) = session.poll_event() {
        let broke = handler(session, event).break_value();
        value = value.or(broke);
    }
    match (ended, value) {
        (Ok(Ended::ByPeer), Some(value)) => Ok(Ended::ByHandler(value)),
        (ended, _) => ended,
    }
}

/// Gives every event to `handler`.
pub(crate) fn report<S: Session, B>(
    session: &mut S,
    handler: &mut impl FnMut(&mut S, S::Event) -> ControlFlow<B>,
) -> ControlFlow<B> {
    while let Some(event) = session.poll_event() {
        handler(session, event)?;
    }
    ControlFlow::Continue(())
}

impl<T: Transport + ?Sized> Transport for &mut T {
    fn now(&self) -> Duration {
        (**self).now()
    }

    fn receive(&mut self, buffer: &mut [u8], wait: Option<Duration>) -> io::Result<Received> {
        (**self).receive(buffer, wait)
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<Sent> {
        (**self).send(bytes)
    }

    fn pause(&mut self, wait: Duration) {
        (**self).pause(wait);
    }
}

impl Transport for TcpStream {
    fn receive(&mut self, buffer: &mut [u8], wait: Option<Duration>) -> io::Result<Received> {
        if !readable(&*self, wait)? {
            return Ok(Received::Nothing);
        }
        match self.read(buffer) {
            Ok(0) => Ok(Received::Closed),
            Ok(length) => Ok(Received::Bytes(length)),
            Err(error) if is_silence(&error) => Ok(Received::Nothing),
            Err(error) => Err(error),
        }
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<Sent> {
        self.write_all(bytes).map(|()| Sent::Buffered)
    }
}

/// Whether within `wait` there is something to read, an end or an error. The wait is exact, where a socket's own time limit is
/// rounded up to 4 ms and more on many systems. A signal may end it early.
///
/// # Errors
/// The system's.
pub fn readable(socket: impl AsFd, wait: Option<Duration>) -> io::Result<bool> {
    // What no system can express is as good as no limit.
    let wait = wait.and_then(|wait| Timespec::try_from(wait).ok());
    match poll(&mut [PollFd::new(&socket, PollFlags::IN)], wait.as_ref()) {
        Ok(ready) => Ok(ready > 0),
        Err(rustix::io::Errno::INTR) => Ok(false),
        Err(error) => Err(error.into()),
    }
}

/// A read that ended because nothing came in time, or a signal did.
fn is_silence(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted)
}
