//! For Embassy and other executors: the loop over any `embedded-io-async` port, without an allocator.

use core::future::{pending, poll_fn};
use core::ops::ControlFlow;
use core::pin::pin;
use core::time::Duration;

use ::embedded_io_async::{Read, Write};

use crate::end_reason::{Connection, keep_first};
use crate::pending::PendingWork;
use crate::turn::{NoHook, Outgoing, PortProgress, Turn};
use crate::{Clock, EndReason, Session};

/// The loop over both halves of a port, one turn at a time.
///
/// `INPUT` bytes are read at once, up to the session's [`MAX_INPUT`](Session::MAX_INPUT); `OUT` is its
/// [`MAX_TRANSMIT`](Session::MAX_TRANSMIT) or more: a shorter buffer does not compile.
///
/// The driver owns the unsent bytes, so a dropped future loses nothing if the port's own futures are cancel-safe, as those of
/// Embassy's buffered ports are: [`turn`](Self::turn) may be one branch of a `select`.
#[derive(Debug)]
pub struct Driver<R, W, C, const INPUT: usize, const OUT: usize> {
    port: Port<R, W>,
    clock: C,
    input: [u8; INPUT],
    out: [u8; OUT],
    unsent: PendingWork,
}

impl<R, W, C, const INPUT: usize, const OUT: usize> Driver<R, W, C, INPUT, OUT>
where
    R: Read,
    W: Write<Error = R::Error>,
    C: Clock,
{
    /// Creates a loop over a port that is split, so that both halves are waited for at once. The caller calls
    /// [`Session::handle_connected`] and [`Session::handle_disconnected`].
    pub fn new(reader: R, writer: W, clock: C) -> Self {
        Self {
            port: Port(reader, writer),
            clock,
            input: [0; INPUT],
            out: [0; OUT],
            unsent: PendingWork::NOTHING,
        }
    }

    /// Replaces the time [`STALL`](crate::STALL).
    #[must_use]
    pub fn stall(self, stall: Duration) -> Self {
        Self { unsent: PendingWork::with_stall(stall), ..self }
    }

    /// Returns the half that reads.
    pub fn reader_mut(&mut self) -> &mut R {
        &mut self.port.0
    }

    /// Returns the clock.
    pub fn clock(&self) -> &C {
        &self.clock
    }

    /// Runs one turn: events and bytes to be sent, until there is neither, then one wait for bytes, for the session's timeout
    /// or for `wake`, then the events of that. While the session does not [want input](Session::wants_input), bytes stay in
    /// the port.
    ///
    /// `wake` ends when the session's other inputs have changed, such as the `wait` of an `embassy_sync` signal that the hook
    /// of a queue sets, or [`pending`]. After a turn that was woken the next one does not wait: between the two, the caller
    /// passes on the change that has woken it.
    ///
    /// # Errors
    /// The errors of the port.
    pub async fn turn<S: Session, B>(
        &mut self,
        session: &mut S,
        wake: impl Future<Output = ()>,
        handler: impl FnMut(&mut S, S::Event) -> ControlFlow<B>,
    ) -> Result<ControlFlow<EndReason<B>>, R::Error> {
        self.pass(session, wake, None::<NoHook<S, R::Error>>, handler).await
    }

    /// As [`turn`](Self::turn), with a hook that is called before the session's bytes are sent: it stores the state that must
    /// survive a reset, for example in flash, so that the peer has received nothing that was not stored. If the future of
    /// this call is dropped, the hook is called again.
    ///
    /// # Errors
    /// The errors of the port and of `before_send`. After an error of `before_send` nothing is sent, and the connection is over.
    pub async fn turn_with<S: Session, B>(
        &mut self,
        session: &mut S,
        wake: impl Future<Output = ()>,
        before_send: impl AsyncFnMut(&mut S) -> Result<(), R::Error>,
        handler: impl FnMut(&mut S, S::Event) -> ControlFlow<B>,
    ) -> Result<ControlFlow<EndReason<B>>, R::Error> {
        self.pass(session, wake, Some(before_send), handler).await
    }

    async fn pass<S: Session, B>(
        &mut self,
        session: &mut S,
        wake: impl Future<Output = ()>,
        before_send: Option<impl AsyncFnMut(&mut S) -> Result<(), R::Error>>,
        handler: impl FnMut(&mut S, S::Event) -> ControlFlow<B>,
    ) -> Result<ControlFlow<EndReason<B>>, R::Error> {
        const { assert!(INPUT > 0 && OUT >= S::MAX_TRANSMIT, "the session may send more at once") };
        let Self { port, clock, input, out, unsent } = self;
        let input = input.get_mut(..S::MAX_INPUT.min(INPUT)).unwrap_or_default();
        Turn { port, time: &*clock, input, out, unsent }.run(session, wake, before_send, handler).await
    }

    /// Runs a session with no inputs but bytes and time until `handler` breaks or the peer closes the connection. The session
    /// is connected before, and disconnected after, even by a dropped future; `handler` gets the events of that too, but the
    /// first value that it breaks with is the one returned.
    ///
    /// # Errors
    /// The errors of the port.
    pub async fn drive<S: Session, B>(
        &mut self,
        session: &mut S,
        handler: impl FnMut(&mut S, S::Event) -> ControlFlow<B>,
    ) -> Result<EndReason<B>, R::Error> {
        let mut value = None;
        let note = keep_first(&mut value, handler);
        self.unsent.clear();
        let Self { port, clock, input, out, unsent } = self;
        let input = input.get_mut(..S::MAX_INPUT.min(INPUT)).unwrap_or_default();
        let mut connection = Connection::begin(session, || clock.now(), note);
        let ended = loop {
            let turn = Turn { port, time: &*clock, input, out, unsent };
            let before_send = None::<NoHook<S, R::Error>>;
            let turned =
                turn.run(connection.session, pending(), before_send, &mut connection.handler).await?;
            if let ControlFlow::Break(ended) = turned {
                break ended;
            }
        };
        drop(connection);
        Ok(ended.or(value))
    }
}

/// The two halves of a port.
#[derive(Debug)]
struct Port<R, W>(R, W);

impl<R: Read, W: Write<Error = R::Error>> crate::turn::Port for Port<R, W> {
    type Error = R::Error;

    async fn pass(&mut self, input: Option<&mut [u8]>, out: Outgoing<'_>) -> Result<PortProgress, R::Error> {
        let Self(reader, writer) = self;
        let mut read = pin!(async {
            match input {
                Some(input) => reader.read(input).await,
                None => pending().await,
            }
        });
        let mut written = pin!(async {
            match out {
                Outgoing::Nothing => pending().await,
                Outgoing::Bytes(bytes) => writer.write(bytes).await,
                Outgoing::Flush => writer.flush().await.map(|()| 0),
            }
        });
        poll_fn(|context| PortProgress::both(read.as_mut().poll(context), written.as_mut().poll(context)))
            .await
    }
}
