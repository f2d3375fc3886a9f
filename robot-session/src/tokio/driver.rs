//! The loop over `AsyncRead + AsyncWrite`.

use core::future::poll_fn;
use core::ops::ControlFlow;
use core::pin::Pin;
use core::task::{Context, Poll};
use core::time::Duration;
use std::io;
use std::sync::Arc;
use std::vec::Vec;

use ::tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use ::tokio::sync::Notify;
use ::tokio::time::sleep;

use crate::ended::{Connection, keep_first};
use crate::left::Left;
use crate::trace::Span;
use crate::turn::{Outgoing, Passed, Turn};
use crate::{Clock, Ended, Session, now};

/// The loop of [`drive`](crate::drive) for tokio, one turn at a time.
///
/// It owns what is not written yet, so that a dropped future loses nothing: [`turn`](Self::turn) may be one branch of a
/// `select!`.
#[derive(Debug)]
pub struct Driver<T> {
    port: Port<T>,
    input: Vec<u8>,
    out: Vec<u8>,
    left: Left,
    waker: Waker,
}

/// Ends the wait of a [`Driver`], from any thread: the hook of a queue, or the caller's own event. It never blocks, and waking often
/// before the driver has looked is as good as waking once.
#[derive(Debug, Clone, Default)]
pub struct Waker(pub(super) Arc<Notify>);

impl Waker {
    /// Ends the wait of the driver, or its next one.
    pub fn wake(&self) {
        self.0.notify_one();
    }

    /// Waits until it is woken, or was since the last wait: what a driver does with its own, and a motion task with that of its queue.
    pub async fn woken(&self) {
        self.0.notified().await;
    }
}

impl<T: AsyncRead + AsyncWrite + Unpin> Driver<T> {
    /// A loop over `transport`. The caller calls [`Session::handle_connected`] and [`Session::handle_disconnected`].
    pub fn new(transport: T) -> Self {
        let waker = Waker::default();
        Self { port: Port(transport), input: Vec::new(), out: Vec::new(), left: Left::NOTHING, waker }
    }

    /// Replaces the time [`STALL`](crate::STALL).
    #[must_use]
    pub fn stall(self, stall: Duration) -> Self {
        Self { left: Left::with_stall(stall), ..self }
    }

    /// A waker that ends the wait of the current turn, or of the next.
    pub fn waker(&self) -> Waker {
        self.waker.clone()
    }

    /// The transport.
    pub fn transport_mut(&mut self) -> &mut T {
        &mut self.port.0
    }

    /// One turn: events and what is to be sent, until there is neither, then one wait for bytes or for the session's timeout, then
    /// the events of that. While the session does not [want input](Session::wants_input), bytes stay in the transport.
    ///
    /// After a turn that was [woken](Self::waker) the next one does not wait: between the two the caller hands over what it was
    /// woken for.
    ///
    /// # Errors
    /// The transport's.
    pub async fn turn<S: Session, B>(
        &mut self,
        session: &mut S,
        handler: impl FnMut(&mut S, S::Event) -> ControlFlow<B>,
    ) -> io::Result<ControlFlow<Ended<B>>> {
        self.turn_keeping(session, async |_: &mut S| Ok(()), handler).await
    }

    /// As [`turn`](Self::turn), with a hook that is called before what the session has written is sent: it keeps what has to survive the
    /// program, such as how many jobs of an order were sent, so that the peer has nothing that was not kept. Where the future of this is
    /// dropped, it is called again.
    ///
    /// # Errors
    /// The transport's; what `keep` returns, and then nothing is sent, and the connection is over.
    pub async fn turn_keeping<S: Session, B>(
        &mut self,
        session: &mut S,
        keep: impl AsyncFnMut(&mut S) -> io::Result<()>,
        handler: impl FnMut(&mut S, S::Event) -> ControlFlow<B>,
    ) -> io::Result<ControlFlow<Ended<B>>> {
        let Self { port, input, out, left, waker } = self;
        input.resize(S::MAX_INPUT, 0);
        out.resize(out.len().max(S::MAX_TRANSMIT), 0); // of another session there may be more left
        Turn { port, clock: &Process, input, out, left }.run(session, waker.woken(), keep, handler).await
    }

    /// Runs a session until `handler` breaks or the peer closes the connection, as [`drive`](crate::drive) does. A dropped future
    /// disconnects the session, and `handler` gets the events of that.
    ///
    /// # Errors
    /// The transport's.
    pub async fn drive<S: Session, B>(
        &mut self,
        session: &mut S,
        handler: impl FnMut(&mut S, S::Event) -> ControlFlow<B>,
    ) -> io::Result<Ended<B>> {
        Span::of([S::LINK, S::END], None).instrument(self.run(session, handler)).await
    }

    /// [`drive`](Self::drive), in the span of the caller.
    pub(super) async fn run<S: Session, B>(
        &mut self,
        session: &mut S,
        handler: impl FnMut(&mut S, S::Event) -> ControlFlow<B>,
    ) -> io::Result<Ended<B>> {
        let mut value = None;
        let note = keep_first(&mut value, handler);
        self.left.clear();
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
struct Process;

impl Clock for Process {
    fn now(&self) -> Duration {
        now()
    }

    fn sleep_until(&self, at: Duration) -> impl Future<Output = ()> {
        sleep(at.saturating_sub(now()))
    }
}

#[derive(Debug)]
pub(super) struct Port<T>(pub(super) T);

impl<T: AsyncRead + AsyncWrite + Unpin> crate::turn::Port for Port<T> {
    type Error = io::Error;

    async fn pass(&mut self, mut input: Option<&mut [u8]>, out: Outgoing<'_>) -> io::Result<Passed> {
        poll_fn(|context| {
            let read = match &mut input {
                None => Poll::Pending,
                Some(input) => self.poll_read(context, input),
            };
            self.poll_write(context, out).passed(read)
        })
        .await
    }
}

impl<T: AsyncRead + AsyncWrite + Unpin> Port<T> {
    #[inline]
    pub(super) fn poll_read(
        &mut self,
        context: &mut Context<'_>,
        input: &mut [u8],
    ) -> Poll<io::Result<usize>> {
        let mut buffer = ReadBuf::new(input);
        let read = Pin::new(&mut self.0).poll_read(context, &mut buffer);
        read.map_ok(|()| buffer.filled().len())
    }

    #[inline]
    pub(super) fn poll_write(&mut self, context: &mut Context<'_>, out: Outgoing<'_>) -> Written {
        let mut port = Pin::new(&mut self.0);
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
        Written { written, flushed }
    }
}

/// The result of writing the bytes that are to be sent.
pub(super) struct Written {
    pub(super) written: Poll<io::Result<usize>>,
    flushed: bool,
}

impl Written {
    /// Combines it with the result of reading.
    #[inline]
    pub(super) fn passed(self, read: Poll<io::Result<usize>>) -> Poll<io::Result<Passed>> {
        let Self { written, flushed } = self;
        Passed::both(read, written).map_ok(|passed| Passed { flushed, ..passed })
    }
}
