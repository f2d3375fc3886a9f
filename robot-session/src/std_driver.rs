//! A blocking loop over any transport that reads with a deadline.

use core::ops::ControlFlow;
use core::time::Duration;
use std::io::{self, ErrorKind, Read, Write};
use std::net::TcpStream;
use std::sync::OnceLock;
use std::time::Instant;
use std::vec::Vec;

use crate::ended::{Ended, report, wind_down};
use crate::session::Session;
use crate::settle::{Output, settle};
use crate::wait::{Wait, Waker};

/// What carries bytes: a TCP connection, a serial port, a pseudo-terminal, a connected UDP socket.
pub trait Transport {
    /// The time that the session is given: [`now`], unless what carries the bytes has a clock of its own, as a simulated line has. One
    /// that goes on with [`receive`](Self::receive) alone is for sessions that always [want input](Session::wants_input).
    fn now(&self) -> Duration {
        now()
    }

    /// Reads what has arrived, or waits until something does, but no longer than `wait`: [`Wait::readable`] is that wait for all that
    /// has a socket. A transport that waits for something else than a descriptor, and looks at [`Wait::limit`] alone, is not woken by
    /// a [`Waker`]: what its driver is woken for is done when the wait has ended, and whoever cannot wait so long limits the turn.
    ///
    /// # Errors
    /// The transport's own. Nothing in time is no error: [`Received::Nothing`].
    fn receive(&mut self, buffer: &mut [u8], wait: Wait<'_>) -> io::Result<Received>;

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

/// The time that [`drive`] gives to sessions: since the first call in this process, the same for every session.
pub fn now() -> Duration {
    static START: OnceLock<Instant> = OnceLock::new();
    START.get_or_init(Instant::now).elapsed()
}

/// Runs a session over a transport until `handler` breaks or the peer closes the connection. The session is connected before,
/// and disconnected after; `handler` gets the events of that too, but the first value that it breaks with is the one returned. A
/// session that works with something else than bytes and time needs a [`Driver`], for its [waker](Driver::waker).
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
    waker: Option<Waker>,
    /// The turn before was woken: the caller has done since what it was woken for, and the session is to see it.
    woken: bool,
}

impl<T: Transport> Driver<T> {
    /// A loop over `transport`. The caller calls [`Session::handle_connected`] and [`Session::handle_disconnected`].
    pub fn new(transport: T) -> Self {
        Self { transport, input: Vec::new(), out: Vec::new(), waker: None, woken: false }
    }

    /// What ends the wait of a turn, or its next one.
    ///
    /// # Errors
    /// The system's, which has no descriptor or no loopback address.
    pub fn waker(&mut self) -> io::Result<Waker> {
        let waker = self.waker.take().map_or_else(Waker::new, Ok)?;
        Ok(self.waker.insert(waker).clone())
    }

    /// One turn: events, then what is to be sent, then one wait for bytes, until the session's timeout at most and no longer
    /// than `wait`, then the events of that. When it returns, every event was given to `handler`, unless that broke. While the
    /// session does not [want input](Session::wants_input), bytes stay in the transport.
    ///
    /// After a turn that was [woken](Self::waker) the next one does not wait: between the two the caller hands over what it was
    /// woken for.
    ///
    /// # Errors
    /// The transport's.
    pub fn turn<S: Session, B>(
        &mut self,
        session: &mut S,
        wait: Option<Duration>,
        mut handler: impl FnMut(&mut S, S::Event) -> ControlFlow<B>,
    ) -> io::Result<ControlFlow<Ended<B>>> {
        let Self { transport, input, out, waker, woken } = self;
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
        let limit = if *woken { Some(Duration::ZERO) } else { due.into_iter().chain(wait).min() };
        let wait = Wait::new(limit, waker.as_ref());
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
            wait.pause()?;
        }
        *woken = waker.as_ref().is_some_and(Waker::take);
        session.handle_timeout(transport.now());
        Ok(report(session, &mut handler).map_break(Ended::ByHandler))
    }

    /// The transport.
    pub fn transport_mut(&mut self) -> &mut T {
        &mut self.transport
    }
}

impl<T: Transport + ?Sized> Transport for &mut T {
    fn now(&self) -> Duration {
        (**self).now()
    }

    fn receive(&mut self, buffer: &mut [u8], wait: Wait<'_>) -> io::Result<Received> {
        (**self).receive(buffer, wait)
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<Sent> {
        (**self).send(bytes)
    }
}

impl Transport for TcpStream {
    fn receive(&mut self, buffer: &mut [u8], wait: Wait<'_>) -> io::Result<Received> {
        if !wait.readable(&*self)? {
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

/// A read that ended because nothing came in time, or a signal did.
fn is_silence(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted)
}
