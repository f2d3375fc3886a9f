//! For tokio: a decoder under `tokio_util`'s framed transports, and the loop of [`drive`](crate::drive) over any
//! `AsyncRead + AsyncWrite`.

use core::future::{Future as _, pending, poll_fn};
use core::ops::ControlFlow;
use core::pin::pin;
use core::task::Poll;
use core::time::Duration;
use std::io;
use std::sync::Arc;
use std::vec::Vec;

use ::tokio::io::{AsyncRead, AsyncReadExt as _, AsyncWrite, AsyncWriteExt as _};
use ::tokio::sync::Notify;
use ::tokio::time::sleep;
use bytes::{Buf as _, BufMut as _, BytesMut};

use crate::std_driver::{report, wind_down};
use crate::{Decoder, Encode, Ended, Session, now};

/// A decoder as a `tokio_util` codec. Corrupt bytes are an item of the stream and do not end it.
///
/// A frame borrows the decoder: `own` makes of it what the stream is to give.
#[derive(Debug, Clone)]
pub struct Codec<D, F> {
    decoder: D,
    own: F,
}

impl<D: Decoder, I, F: FnMut(D::Frame<'_>) -> I> Codec<D, F> {
    /// A codec over `decoder`.
    pub fn new(decoder: D, own: F) -> Self {
        Self { decoder, own }
    }

    /// The decoder, to ask it for the position of the frame or the error that came last.
    pub fn decoder(&self) -> &D {
        &self.decoder
    }
}

impl<D: Decoder, I, F: FnMut(D::Frame<'_>) -> I> tokio_util::codec::Decoder for Codec<D, F> {
    type Item = Result<I, D::Error>;
    type Error = io::Error;

    fn decode(&mut self, src: &mut BytesMut) -> io::Result<Option<Self::Item>> {
        loop {
            if let Some(frame) = self.decoder.next_frame() {
                return Ok(Some(frame.map(&mut self.own)));
            }
            if src.is_empty() {
                return Ok(None);
            }
            let taken = self.decoder.push(src);
            src.advance(taken);
        }
    }

    fn decode_eof(&mut self, src: &mut BytesMut) -> io::Result<Option<Self::Item>> {
        if let Some(item) = self.decode(src)? {
            return Ok(Some(item));
        }
        self.decoder.finish();
        self.decode(src)
    }
}

impl<D, F, M: Encode> tokio_util::codec::Encoder<M> for Codec<D, F>
where
    M::Error: core::error::Error + Send + Sync + 'static,
{
    type Error = io::Error;

    fn encode(&mut self, message: M, out: &mut BytesMut) -> io::Result<()> {
        let before = out.len();
        out.put_bytes(0, message.encoded_len());
        match message.encode(out.get_mut(before..).unwrap_or_default()) {
            Ok(_) => Ok(()),
            Err(error) => {
                out.truncate(before);
                Err(io::Error::new(io::ErrorKind::InvalidInput, error))
            }
        }
    }
}

/// The loop of [`drive`](crate::drive) for tokio, one turn at a time.
///
/// It owns what is not written yet, so that a dropped future loses nothing: [`turn`](Self::turn) may be one branch of a
/// `select!`.
#[derive(Debug)]
pub struct Driver<T> {
    transport: T,
    input: Vec<u8>,
    out: BytesMut,
    waker: Waker,
    /// The turn before was woken: the caller has done since what it was woken for, and the session is to see it.
    woken: bool,
}

/// Ends the wait of a [`Driver`], from any thread: the hook of a queue, or the caller's own event. It never blocks, and waking often
/// before the driver has looked is as good as waking once.
#[derive(Debug, Clone, Default)]
pub struct Waker(Arc<Notify>);

impl Waker {
    /// Ends the wait of the driver, or its next one.
    pub fn wake(&self) {
        self.0.notify_one();
    }
}

impl<T: AsyncRead + AsyncWrite + Unpin> Driver<T> {
    /// A loop over `transport`. The caller calls [`Session::handle_connected`] and [`Session::handle_disconnected`].
    pub fn new(transport: T) -> Self {
        Self { transport, input: Vec::new(), out: BytesMut::new(), waker: Waker::default(), woken: false }
    }

    /// What ends the wait of a turn, or its next one.
    pub fn waker(&self) -> Waker {
        self.waker.clone()
    }

    /// The transport.
    pub fn transport_mut(&mut self) -> &mut T {
        &mut self.transport
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
        mut handler: impl FnMut(&mut S, S::Event) -> ControlFlow<B>,
    ) -> io::Result<ControlFlow<Ended<B>>> {
        let mut idle = false;
        while !core::mem::replace(&mut idle, true) {
            while let Some(event) = session.poll_event() {
                if let ControlFlow::Break(value) = handler(session, event) {
                    return Ok(ControlFlow::Break(Ended::ByHandler(value)));
                }
                idle = false;
            }
            // What a dropped future has left comes first.
            self.write().await?;
            while self.transmit(session) {
                self.write().await?;
                idle = false;
            }
        }
        let due = session.poll_timeout().map(|at| at.saturating_sub(now()));
        let limit = if self.woken { Some(Duration::ZERO) } else { due };
        self.input.resize(S::MAX_INPUT, 0);
        match self.receive(session.wants_input(), limit).await? {
            Some(0) => return Ok(ControlFlow::Break(Ended::ByPeer)),
            Some(length) => session.handle_input(now(), self.input.get(..length).unwrap_or_default()),
            None => {}
        }
        session.handle_timeout(now());
        Ok(report(session, &mut handler).map_break(Ended::ByHandler))
    }

    /// Runs a session until `handler` breaks or the peer closes the connection, as [`drive`](crate::drive) does.
    ///
    /// # Errors
    /// The transport's.
    pub async fn drive<S: Session, B>(
        &mut self,
        session: &mut S,
        mut handler: impl FnMut(&mut S, S::Event) -> ControlFlow<B>,
    ) -> io::Result<Ended<B>> {
        session.handle_connected(now());
        let ended = loop {
            match self.turn(session, &mut handler).await {
                Ok(ControlFlow::Continue(())) => {}
                Ok(ControlFlow::Break(ended)) => break Ok(ended),
                Err(error) => break Err(error),
            }
        };
        session.handle_disconnected(now());
        wind_down(session, &mut handler, ended)
    }

    /// How many bytes have come; `None` if the time is over, or the driver was woken.
    async fn receive(&mut self, wants_input: bool, limit: Option<Duration>) -> io::Result<Option<usize>> {
        let Self { transport, input, waker, woken, .. } = self;
        let mut arrival =
            pin!(async { if wants_input { transport.read(input).await } else { pending().await } });
        let mut wake = pin!(waker.0.notified());
        let mut time = pin!(async {
            match limit {
                Some(limit) => sleep(limit).await,
                None => pending().await,
            }
        });
        let (is_woken, read) = poll_fn(|context| {
            if let Poll::Ready(read) = arrival.as_mut().poll(context) {
                return Poll::Ready((false, read.map(Some)));
            }
            if wake.as_mut().poll(context).is_ready() {
                return Poll::Ready((true, Ok(None)));
            }
            time.as_mut().poll(context).map(|()| (false, Ok(None)))
        })
        .await;
        *woken = is_woken;
        read
    }

    /// Whether the session had something to send: it is in `out`.
    fn transmit<S: Session>(&mut self, session: &mut S) -> bool {
        let begin = self.out.len();
        self.out.put_bytes(0, S::MAX_TRANSMIT);
        let written = session.poll_transmit(now(), self.out.get_mut(begin..).unwrap_or_default());
        self.out.truncate(begin + written.unwrap_or(0));
        written.is_some()
    }

    /// Writes what is left, cancel-safe: what a write has taken is gone from `out`.
    async fn write(&mut self) -> io::Result<()> {
        while !self.out.is_empty() {
            if self.transport.write_buf(&mut self.out).await? == 0 {
                return Err(io::ErrorKind::WriteZero.into());
            }
        }
        self.transport.flush().await
    }
}
