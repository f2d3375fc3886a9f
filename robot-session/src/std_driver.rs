//! A blocking loop over any transport that reads with a deadline.

use core::ops::ControlFlow;
use core::time::Duration;
use std::io::{self, ErrorKind, Read, Write};
use std::net::TcpStream;
use std::sync::OnceLock;
use std::thread;
use std::time::Instant;
use std::vec;
use std::vec::Vec;

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

/// A transport and the buffers of its loop: for a caller who has something else to do between two turns.
#[derive(Debug)]
pub struct Driver<T> {
    transport: T,
    input: Vec<u8>,
    out: Vec<u8>,
}

impl<T: Transport> Driver<T> {
    /// The longest read: a whole datagram.
    const LONGEST_READ: usize = 65536;

    /// A loop over `transport`. The caller calls [`Session::handle_connected`] and [`Session::handle_disconnected`].
    pub fn new(transport: T) -> Self {
        Self { transport, input: vec![0; Self::LONGEST_READ], out: Vec::new() }
    }

    /// One turn: events, then what is to be sent, then one wait for bytes, until the session's timeout at most and no longer
    /// than `wait`, then the events of that. When it returns, every event was given to `handler`, unless that broke.
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
        match transport.receive(input, wait)? {
            Received::Bytes(length) => {
                session.handle_input(transport.now(), input.get(..length).unwrap_or_default());
            }
            Received::Nothing => {}
            Received::Closed => return Ok(ControlFlow::Break(Ended::ByPeer)),
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
}

/// A socket's own time limit is rounded up, to 4 ms and more on many systems: what is left of a wait is waited in short sleeps.
const ROUNDED: Duration = Duration::from_millis(10);
const SLEEP: Duration = Duration::from_micros(250);

impl Transport for TcpStream {
    fn receive(&mut self, buffer: &mut [u8], wait: Option<Duration>) -> io::Result<Received> {
        let until = wait.map(|wait| now().saturating_add(wait));
        loop {
            let left = until.map(|until| until.saturating_sub(now()));
            let is_short = left.is_some_and(|left| left <= ROUNDED);
            let outcome = if is_short {
                self.set_nonblocking(true)?;
                let outcome = self.read(buffer);
                self.set_nonblocking(false)?;
                outcome
            } else {
                self.set_read_timeout(left.map(|left| left.saturating_sub(ROUNDED).max(SLEEP)))?;
                self.read(buffer)
            };
            match outcome {
                Ok(0) => return Ok(Received::Closed),
                Ok(length) => return Ok(Received::Bytes(length)),
                Err(error) if !is_silence(&error) => return Err(error),
                Err(_) if left == Some(Duration::ZERO) => return Ok(Received::Nothing),
                Err(_) if is_short => thread::sleep(left.unwrap_or_default().min(SLEEP)),
                Err(_) => {}
            }
        }
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<Sent> {
        self.write_all(bytes).map(|()| Sent::Buffered)
    }
}

/// A read that ended because nothing came in time, or a signal did.
fn is_silence(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted)
}
