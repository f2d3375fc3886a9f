//! For interrupts: the loop over any `embedded-io` port, without a wait and without an allocator.

use core::future::poll_fn;
use core::ops::ControlFlow;
use core::pin::pin;
use core::task::{Context, Poll, Waker};
use core::time::Duration;

use ::embedded_io::{Read, ReadReady, Write, WriteReady};

use crate::pending::PendingWork;
use crate::turn::{Clock, NoHook, Outgoing, PortProgress, Turn};
use crate::{EndReason, Session};

/// The loop over a port, which [`poll`](Self::poll) runs as far as it can without waiting.
///
/// `INPUT` bytes are read at once, up to the session's [`MAX_INPUT`](Session::MAX_INPUT); `OUT` is its
/// [`MAX_TRANSMIT`](Session::MAX_TRANSMIT) or more: a shorter buffer does not compile.
#[derive(Debug)]
pub struct Driver<P, C, const INPUT: usize, const OUT: usize> {
    port: NonBlockingPort<P>,
    now: ClockRef<C>,
    input: [u8; INPUT],
    out: [u8; OUT],
    unsent: PendingWork,
}

impl<P, C, const INPUT: usize, const OUT: usize> Driver<P, C, INPUT, OUT>
where
    P: Read + ReadReady + Write + WriteReady,
    C: Fn() -> Duration,
{
    /// Creates a loop over `port`, with the time that `now` returns. The caller calls [`Session::handle_connected`] and
    /// [`Session::handle_disconnected`].
    pub const fn new(port: P, now: C) -> Self {
        Self {
            port: NonBlockingPort(port),
            now: ClockRef(now),
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

    /// Returns the port.
    pub fn port_mut(&mut self) -> &mut P {
        &mut self.port.0
    }

    /// Reads the bytes that have come, writes those to be sent as far as the port takes them, and gives every event to
    /// `handler`. Returns the latest time at which it must be called again. It must also be called when bytes have come, when
    /// the port can take bytes again, and when another input of the session has changed, such as the queue that a robot
    /// fills: from the interrupts of all these, if they have one priority, or from one that they trigger.
    ///
    /// The port sends its bytes on its own: it is not flushed. While the session does not
    /// [want input](Session::wants_input), bytes stay in the port.
    ///
    /// # Errors
    /// The errors of the port.
    pub fn poll<S: Session, B>(
        &mut self,
        session: &mut S,
        mut handler: impl FnMut(&mut S, S::Event) -> ControlFlow<B>,
    ) -> Result<ControlFlow<EndReason<B>, Option<Duration>>, P::Error> {
        const { assert!(INPUT > 0 && OUT >= S::MAX_TRANSMIT, "the session may send more at once") };
        // Handle the changes of other inputs since the last call once, after the bytes.
        let mut changed = true;
        loop {
            let Self { port, now, input, out, unsent } = self;
            let input = input.get_mut(..S::MAX_INPUT.min(INPUT)).unwrap_or_default();
            let wake = ready_if(|| core::mem::take(&mut changed));
            let turn = Turn { port, time: &*now, input, out, unsent };
            let turn = turn.run(session, wake, None::<NoHook<S, P::Error>>, &mut handler);
            let polled = pin!(turn).poll(&mut Context::from_waker(Waker::noop()));
            match polled {
                Poll::Ready(Ok(ControlFlow::Continue(()))) => {}
                Poll::Ready(Ok(ControlFlow::Break(ended))) => return Ok(ControlFlow::Break(ended)),
                Poll::Ready(Err(error)) => return Err(error),
                Poll::Pending => return Ok(ControlFlow::Continue(unsent.due(session, now.0()))),
            }
        }
    }
}

#[derive(Debug)]
struct ClockRef<C>(C);

impl<C: Fn() -> Duration> Clock for ClockRef<C> {
    fn now(&self) -> Duration {
        (self.0)()
    }

    fn sleep_until(&self, at: Duration) -> impl Future<Output = ()> {
        ready_if(move || self.now() >= at)
    }
}

/// A port without waits.
#[derive(Debug)]
struct NonBlockingPort<P>(P);

impl<P: Read + ReadReady + Write + WriteReady> crate::turn::Port for NonBlockingPort<P> {
    type Error = P::Error;

    async fn pass(
        &mut self,
        mut input: Option<&mut [u8]>,
        out: Outgoing<'_>,
    ) -> Result<PortProgress, P::Error> {
        let Self(port) = self;
        poll_fn(|_| {
            let read = match &mut input {
                None => Poll::Pending,
                Some(input) => match port.read_ready() {
                    Ok(false) => Poll::Pending,
                    Ok(true) => Poll::Ready(port.read(input)),
                    Err(error) => Poll::Ready(Err(error)),
                },
            };
            let written = match out {
                Outgoing::Nothing => Poll::Pending,
                Outgoing::Bytes(bytes) => match port.write_ready() {
                    Ok(false) => Poll::Pending,
                    Ok(true) => Poll::Ready(port.write(bytes)),
                    Err(error) => Poll::Ready(Err(error)),
                },
                Outgoing::Flush => Poll::Ready(Ok(0)),
            };
            PortProgress::both(read, written)
        })
        .await
    }
}

/// Completes when `is_so` returns true.
fn ready_if(mut is_so: impl FnMut() -> bool) -> impl Future<Output = ()> {
    poll_fn(move |_| if is_so() { Poll::Ready(()) } else { Poll::Pending })
}
