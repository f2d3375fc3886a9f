//! For Embassy and other executors: the loop over any `embedded-io-async` port, without an allocator.

use core::future::pending;
use core::ops::ControlFlow;

use ::embedded_io_async::{Read, Write};

use crate::ended::wind_down;
use crate::turn::{Left, Turn};
use crate::{Clock, Ended, Session};

/// The loop over a port, one turn at a time.
///
/// `INPUT` bytes are read at once, up to the session's [`MAX_INPUT`](Session::MAX_INPUT); `OUT` is its
/// [`MAX_TRANSMIT`](Session::MAX_TRANSMIT) or more: a shorter buffer does not compile.
///
/// It owns what is not written yet, so that a dropped future loses nothing, if the port's own are cancel-safe, as those of Embassy's
/// buffered ports are: [`turn`](Self::turn) may be one branch of a `select`.
#[derive(Debug)]
pub struct Driver<P, C, const INPUT: usize, const OUT: usize> {
    port: Port<P>,
    clock: C,
    input: [u8; INPUT],
    out: [u8; OUT],
    left: Left,
}

impl<P: Read + Write, C: Clock, const INPUT: usize, const OUT: usize> Driver<P, C, INPUT, OUT> {
    /// A loop over `port`. The caller calls [`Session::handle_connected`] and [`Session::handle_disconnected`].
    pub fn new(port: P, clock: C) -> Self {
        Self { port: Port(port), clock, input: [0; INPUT], out: [0; OUT], left: Left::NOTHING }
    }

    /// The port.
    pub fn port_mut(&mut self) -> &mut P {
        &mut self.port.0
    }

    /// The clock.
    pub fn clock(&self) -> &C {
        &self.clock
    }

    /// One turn: events and what is to be sent, until there is neither, then one wait for bytes, for the session's timeout or for `wake`,
    /// then the events of that. While the session does not [want input](Session::wants_input), bytes stay in the port.
    ///
    /// `wake` is what a session works with beside bytes and time, as the `wait` of an `embassy_sync` signal that the hook of a queue
    /// sets, or [`pending`]. After a turn that was woken the next one does not wait: between the two the caller hands over what it was
    /// woken for.
    ///
    /// # Errors
    /// The port's.
    pub async fn turn<S: Session, B>(
        &mut self,
        session: &mut S,
        wake: impl Future<Output = ()>,
        handler: impl FnMut(&mut S, S::Event) -> ControlFlow<B>,
    ) -> Result<ControlFlow<Ended<B>>, P::Error> {
        const { assert!(INPUT > 0 && OUT >= S::MAX_TRANSMIT, "the session may send more at once") };
        let Self { port, clock, input, out, left } = self;
        let input = input.get_mut(..S::MAX_INPUT.min(INPUT)).unwrap_or_default();
        Turn { port, clock, input, out, left }.run(session, wake, handler).await
    }

    /// Runs a session that works with nothing but bytes and time until `handler` breaks or the peer closes the connection. The session
    /// is connected before, and disconnected after; `handler` gets the events of that too, but the first value that it breaks with is the
    /// one returned.
    ///
    /// # Errors
    /// The port's.
    pub async fn drive<S: Session, B>(
        &mut self,
        session: &mut S,
        mut handler: impl FnMut(&mut S, S::Event) -> ControlFlow<B>,
    ) -> Result<Ended<B>, P::Error> {
        session.handle_connected(self.clock.now());
        let ended = loop {
            match self.turn(session, pending(), &mut handler).await {
                Ok(ControlFlow::Continue(())) => {}
                Ok(ControlFlow::Break(ended)) => break Ok(ended),
                Err(error) => break Err(error),
            }
        };
        session.handle_disconnected(self.clock.now());
        wind_down(session, &mut handler, ended)
    }
}

#[derive(Debug)]
struct Port<P>(P);

impl<P: Read + Write> crate::turn::Port for Port<P> {
    type Error = P::Error;

    async fn read(&mut self, buffer: &mut [u8]) -> Result<usize, P::Error> {
        self.0.read(buffer).await
    }

    async fn write(&mut self, bytes: &[u8]) -> Result<usize, P::Error> {
        self.0.write(bytes).await
    }

    async fn flush(&mut self) -> Result<(), P::Error> {
        self.0.flush().await
    }
}
