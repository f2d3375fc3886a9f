//! The loop over `AsyncRead + AsyncWrite`.

use core::future::{pending, poll_fn};
use core::ops::ControlFlow;
use core::pin::Pin;
use core::task::{Context, Poll};
use core::time::Duration;
use std::io;
use std::sync::{Arc, OnceLock};
use std::vec::Vec;

use ::tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use ::tokio::sync::Notify;

use super::timer::Timer;
use crate::end_reason::{Connection, keep_first};
use crate::pending::PendingWork;
use crate::trace::Span;
use crate::turn::{NoHook, Outgoing, PortProgress, Time, Turn};
use crate::{EndReason, Session, now};

/// The loop of [`drive`](crate::drive) for tokio, one turn at a time.
///
/// The driver owns the unsent bytes, so a dropped future loses nothing: [`turn`](Self::turn) may be one branch of a
/// `select!`. It may go from task to task, and stays in the runtime of its first turn.
///
/// A loop that owns its peer needs no [`Handle`](super::Handle): a call of the session, then turns until its outcome is reported.
#[derive(Debug)]
pub struct Driver<T> {
    port: Port<T>,
    input: Vec<u8>,
    out: Vec<u8>,
    unsent: PendingWork,
    timer: Timer,
    /// The waker, made when it is requested: a driver without one does not check for wakes.
    waker: OnceLock<Waker>,
}

/// Ends the wait of a [`Driver`], from any thread: the hook of a queue, or the caller's own event. It never blocks, and many
/// wakes before the driver has checked have the effect of one.
#[derive(Debug, Clone, Default)]
pub struct Waker(pub(super) Arc<Notify>);

impl Waker {
    /// Ends the wait of the driver, or its next one.
    pub fn wake(&self) {
        self.0.notify_one();
    }

    /// Waits until the waker is used, or was used since the last wait. A driver waits so for its own waker, a motion task for
    /// that of its queue.
    pub async fn woken(&self) {
        self.0.notified().await;
    }
}

impl<T: AsyncRead + AsyncWrite + Unpin> Driver<T> {
    /// Creates a loop over `transport`. The caller calls [`Session::handle_connected`] and [`Session::handle_disconnected`].
    pub fn new(transport: T) -> Self {
        let (timer, waker) = (Timer::default(), OnceLock::new());
        let unsent = PendingWork::NOTHING;
        Self { port: Port::new(transport), input: Vec::new(), out: Vec::new(), unsent, timer, waker }
    }

    /// Replaces the time [`STALL`](crate::STALL).
    #[must_use]
    pub fn stall(self, stall: Duration) -> Self {
        Self { unsent: PendingWork::with_stall(stall), ..self }
    }

    /// Returns a waker that ends the wait of the current turn, or of the next.
    pub fn waker(&self) -> Waker {
        self.waker.get_or_init(Waker::default).clone()
    }

    /// Returns the transport.
    pub fn transport_mut(&mut self) -> &mut T {
        &mut self.port.transport
    }

    /// Runs one turn: events and bytes to be sent, until there is neither, then one wait for bytes or for the session's
    /// timeout, then the events of that. While the session does not [want input](Session::wants_input), bytes stay in the
    /// transport.
    ///
    /// After a turn that was [woken](Self::waker) the next one does not wait: between the two, the caller passes on the
    /// change that has woken it.
    ///
    /// # Errors
    /// The errors of the transport.
    pub async fn turn<S: Session, B>(
        &mut self,
        session: &mut S,
        handler: impl FnMut(&mut S, S::Event) -> ControlFlow<B>,
    ) -> io::Result<ControlFlow<EndReason<B>>> {
        self.pass(session, None::<NoHook<S, io::Error>>, handler).await
    }

    /// As [`turn`](Self::turn), with a hook that is called before the session's bytes are sent: it stores the state that must
    /// survive the program, such as the number of jobs of an order that were sent, so that the peer has received nothing that
    /// was not stored. If the future of this call is dropped, the hook is called again.
    ///
    /// # Errors
    /// The errors of the transport and of `before_send`. After an error of `before_send` nothing is sent, and the connection
    /// is over.
    pub async fn turn_with<S: Session, B>(
        &mut self,
        session: &mut S,
        before_send: impl AsyncFnMut(&mut S) -> io::Result<()>,
        handler: impl FnMut(&mut S, S::Event) -> ControlFlow<B>,
    ) -> io::Result<ControlFlow<EndReason<B>>> {
        self.pass(session, Some(before_send), handler).await
    }

    async fn pass<S: Session, B>(
        &mut self,
        session: &mut S,
        before_send: Option<impl AsyncFnMut(&mut S) -> io::Result<()>>,
        handler: impl FnMut(&mut S, S::Event) -> ControlFlow<B>,
    ) -> io::Result<ControlFlow<EndReason<B>>> {
        let Self { port, input, out, unsent, timer, waker } = self;
        input.resize(S::MAX_INPUT, 0);
        out.resize(out.len().max(S::MAX_TRANSMIT), 0); // of another session there may be more left
        let wake = async {
            match waker.get() {
                Some(waker) => waker.woken().await,
                None => pending().await,
            }
        };
        Turn { port, time: Process(timer), input, out, unsent }.run(session, wake, before_send, handler).await
    }

    /// Runs a session until `handler` breaks or the peer closes the connection, as [`drive`](crate::drive) does. A dropped future
    /// disconnects the session, and `handler` gets the events of that.
    ///
    /// # Errors
    /// The errors of the transport.
    pub async fn drive<S: Session, B>(
        &mut self,
        session: &mut S,
        handler: impl FnMut(&mut S, S::Event) -> ControlFlow<B>,
    ) -> io::Result<EndReason<B>> {
        Span::of([S::LINK, S::END], None).instrument(self.run(session, handler)).await
    }

    /// Runs [`drive`](Self::drive) in the span of the caller.
    pub(super) async fn run<S: Session, B>(
        &mut self,
        session: &mut S,
        handler: impl FnMut(&mut S, S::Event) -> ControlFlow<B>,
    ) -> io::Result<EndReason<B>> {
        let mut value = None;
        let note = keep_first(&mut value, handler);
        self.unsent.clear();
        let mut connection = Connection::begin(session, now, note);
        let ended = loop {
            if let ControlFlow::Break(ended) = self.turn(connection.session, &mut connection.handler).await? {
                break ended;
            }
        };
        drop(connection);
        Ok(ended.or(value))
    }
}

/// The clock of the process, and tokio's timer.
struct Process<'a>(&'a mut Timer);

impl Time for Process<'_> {
    fn now(&self) -> Duration {
        now()
    }

    fn until(&mut self, due: Option<Duration>) -> impl Future<Output = ()> {
        poll_fn(move |context| self.0.poll(context, due))
    }
}

/// A transport.
#[derive(Debug)]
pub(super) struct Port<T> {
    transport: T,
    /// Whether bytes were written since the port was last read.
    has_written: bool,
}

impl<T: AsyncRead + AsyncWrite + Unpin> crate::turn::Port for Port<T> {
    type Error = io::Error;

    async fn pass(&mut self, mut input: Option<&mut [u8]>, out: Outgoing<'_>) -> io::Result<PortProgress> {
        poll_fn(|context| self.poll(context, input.as_deref_mut(), out, || {})).await
    }
}

impl<T: AsyncRead + AsyncWrite + Unpin> Port<T> {
    pub(super) const fn new(transport: T) -> Self {
        Self { transport, has_written: false }
    }

    /// Writes bytes first: in most cases the peer sends nothing before it has received them. Then reads the port, so that a
    /// session that always has bytes to send reads too. `unread` is called if the port had no bytes.
    #[inline(always)]
    pub(super) fn poll(
        &mut self,
        context: &mut Context<'_>,
        input: Option<&mut [u8]>,
        out: Outgoing<'_>,
        unread: impl FnOnce(),
    ) -> Poll<io::Result<PortProgress>> {
        let writes_first = matches!(out, Outgoing::Bytes(_)) && !self.has_written;
        let first = writes_first.then(|| self.poll_write(context, out));
        self.has_written = matches!(first, Some(WriteProgress { written: Poll::Ready(Ok(_)), .. }));
        let read = match input {
            Some(input) if !self.has_written => {
                let read = self.poll_read(context, input);
                if read.is_pending() {
                    unread();
                }
                read
            }
            _ => Poll::Pending,
        };
        first.unwrap_or_else(|| self.poll_write(context, out)).passed(read)
    }

    #[inline]
    fn poll_read(&mut self, context: &mut Context<'_>, input: &mut [u8]) -> Poll<io::Result<usize>> {
        let mut buffer = ReadBuf::new(input);
        let read = Pin::new(&mut self.transport).poll_read(context, &mut buffer);
        read.map_ok(|()| buffer.filled().len())
    }

    #[inline]
    pub(super) fn poll_write(&mut self, context: &mut Context<'_>, out: Outgoing<'_>) -> WriteProgress {
        let mut port = Pin::new(&mut self.transport);
        let mut flushed = false;
        let written = match out {
            Outgoing::Nothing => Poll::Pending,
            Outgoing::Bytes(bytes) => match port.as_mut().poll_write(context, bytes) {
                Poll::Ready(Ok(0)) => Poll::Ready(Err(io::ErrorKind::WriteZero.into())),
                // A socket has nothing to flush.
                Poll::Ready(Ok(length)) => match port.as_mut().poll_flush(context) {
                    Poll::Ready(Err(error)) => Poll::Ready(Err(error)),
                    flush => {
                        flushed = flush.is_ready();
                        Poll::Ready(Ok(length))
                    }
                },
                written => written,
            },
            Outgoing::Flush => port.as_mut().poll_flush(context).map_ok(|()| 0),
        };
        WriteProgress { written, flushed }
    }
}

/// The result of writing the bytes that are to be sent.
pub(super) struct WriteProgress {
    pub(super) written: Poll<io::Result<usize>>,
    flushed: bool,
}

impl WriteProgress {
    /// Combines it with the result of reading.
    #[inline]
    pub(super) fn passed(self, read: Poll<io::Result<usize>>) -> Poll<io::Result<PortProgress>> {
        let Self { written, flushed } = self;
        PortProgress::both(read, written).map_ok(|passed| PortProgress { flushed, ..passed })
    }
}
