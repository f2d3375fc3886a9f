//! One turn of the loops that wait by `.await`: tokio's, and that over `embedded-io-async`. A turn that is dropped loses
//! nothing, so the loop over `embedded-io` is the same one, polled once.

use core::future::{Ready, pending, poll_fn};
use core::ops::ControlFlow;
use core::pin::{Pin, pin};
use core::task::Poll;
use core::time::Duration;

use crate::end_reason::{EndReason, report};
use crate::pending::PendingWork;
use crate::session::Session;

/// The transport of a driver.
pub(crate) trait Port {
    type Error;

    /// Waits until bytes have come into `input`, if it is given, or until `out` has gone on. A dropped future has done
    /// neither.
    fn pass(
        &mut self,
        input: Option<&mut [u8]>,
        out: Outgoing<'_>,
    ) -> impl Future<Output = Result<PortProgress, Self::Error>>;
}

/// The output of a driver.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Outgoing<'a> {
    /// Nothing.
    Nothing,
    /// Some of these bytes.
    Bytes(&'a [u8]),
    /// Flush the bytes that the port has taken.
    Flush,
}

impl<'a> Outgoing<'a> {
    /// Returns the unsent bytes of the driver's buffer, or a flush if they are all written.
    pub(crate) fn of(unsent: &PendingWork, buffer: &'a [u8]) -> Self {
        match unsent.of(buffer) {
            bytes @ [_, ..] => Self::Bytes(bytes),
            [] if unsent.unflushed => Self::Flush,
            [] => Self::Nothing,
        }
    }
}

/// The progress of a port.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct PortProgress {
    /// The number of bytes read; 0 at the end of the stream, `None` while the read is pending.
    pub(crate) read: Option<usize>,
    /// The number of bytes taken; 0 at the end of the stream and for a flush, `None` while the write is pending.
    pub(crate) written: Option<usize>,
    /// Whether the bytes taken have left the port: no flush is needed.
    pub(crate) flushed: bool,
}

impl PortProgress {
    /// Combines the completed directions. Bytes that have come are handled before an error of writing, which occurs again.
    pub(crate) fn both<E>(
        read: Poll<Result<usize, E>>,
        written: Poll<Result<usize, E>>,
    ) -> Poll<Result<Self, E>> {
        let (read, written) = match (read, written) {
            (Poll::Pending, Poll::Pending) => return Poll::Pending,
            (Poll::Ready(Err(error)), _) | (Poll::Pending, Poll::Ready(Err(error))) => {
                return Poll::Ready(Err(error));
            }
            (Poll::Ready(Ok(read)), Poll::Ready(Ok(written))) => (Some(read), Some(written)),
            (Poll::Ready(Ok(read)), _) => (Some(read), None),
            (Poll::Pending, Poll::Ready(Ok(written))) => (None, Some(written)),
        };
        Poll::Ready(Ok(Self { read, written, flushed: false }))
    }
}

/// The time, and a wait for it.
///
/// With `embassy-time`:
///
/// ```ignore
/// struct EmbassyClock;
///
/// impl Clock for EmbassyClock {
///     fn now(&self) -> Duration {
///         Duration::from_micros(Instant::now().as_micros())
///     }
///
///     async fn sleep_until(&self, at: Duration) {
///         Timer::at(Instant::from_micros(at.as_micros() as u64)).await;
///     }
/// }
/// ```
pub trait Clock {
    /// Returns the time since an epoch of the clock's choice.
    fn now(&self) -> Duration;

    /// Waits until `at`; returns at once if that is past.
    fn sleep_until(&self, at: Duration) -> impl Future<Output = ()>;
}

/// The clock of a turn, and its wait for a deadline.
pub(crate) trait Time {
    /// Returns the time.
    fn now(&self) -> Duration;

    /// Waits until `due`. With `None` and [`Duration::MAX`] it never ends.
    fn until(&mut self, due: Option<Duration>) -> impl Future<Output = ()>;
}

impl<C: Clock> Time for &C {
    fn now(&self) -> Duration {
        Clock::now(*self)
    }

    async fn until(&mut self, due: Option<Duration>) {
        match due {
            None | Some(Duration::MAX) => pending().await,
            Some(at) => self.sleep_until(at).await,
        }
    }
}

/// The type of a turn's hook that stores nothing.
pub(crate) type NoHook<S, E> = fn(&mut S) -> Ready<Result<(), E>>;

/// The parts that a turn needs. `out` has at least [`MAX_TRANSMIT`](Session::MAX_TRANSMIT) bytes.
pub(crate) struct Turn<'a, P, T> {
    pub(crate) port: &'a mut P,
    pub(crate) time: T,
    pub(crate) input: &'a mut [u8],
    pub(crate) out: &'a mut [u8],
    pub(crate) unsent: &'a mut PendingWork,
}

impl<P: Port, T: Time> Turn<'_, P, T> {
    /// Handles events and bytes to be sent, until there is neither, then waits once for bytes, for the session's timeout or
    /// for `wake`, then handles the events of that. The bytes to be sent are written in that wait: a peer that does not read
    /// does not delay anything else.
    ///
    /// `before_send` is called when the session has written the bytes that are sent next, and again if its future was dropped.
    pub(crate) async fn run<S: Session, B>(
        mut self,
        session: &mut S,
        wake: impl Future<Output = ()>,
        before_send: Option<impl AsyncFnMut(&mut S) -> Result<(), P::Error>>,
        handler: impl FnMut(&mut S, S::Event) -> ControlFlow<B>,
    ) -> Result<ControlFlow<EndReason<B>>, P::Error> {
        let turned = self.pass(session, pin!(wake), before_send, handler).await;
        self.unsent.after(turned)
    }

    async fn pass<S: Session, B>(
        &mut self,
        session: &mut S,
        mut wake: Pin<&mut impl Future<Output = ()>>,
        mut before_send: Option<impl AsyncFnMut(&mut S) -> Result<(), P::Error>>,
        mut handler: impl FnMut(&mut S, S::Event) -> ControlFlow<B>,
    ) -> Result<ControlFlow<EndReason<B>>, P::Error> {
        // The clock is read once for everything that happens without a wait.
        let mut now = self.time.now();
        loop {
            let Self { out, unsent, .. } = &mut *self;
            if let ControlFlow::Break(value) = unsent.prepare(session, out, now, &mut handler) {
                return Ok(ControlFlow::Break(EndReason::ByHandler(value)));
            }
            if self.unsent.hook_pending {
                if let Some(before_send) = &mut before_send {
                    before_send(session).await?;
                    now = self.time.now();
                }
                self.unsent.hook_pending = false;
            }
            // The session itself is not lent to the wait: a task that waits need not share it.
            let due = self.unsent.due(session, now);
            let (has_waited, passed) = self.wait(session.wants_input(), due, wake.as_mut()).await;
            if has_waited {
                now = self.time.now();
            }
            let Self { input, unsent, .. } = &mut *self;
            let passed = passed?;
            if let ControlFlow::Break(ended) = take(session, unsent, input, passed, now) {
                return Ok(ControlFlow::Break(ended));
            }
            if passed.read.is_some() || passed.written.is_none() {
                return Ok(report(session, &mut handler).map_break(EndReason::ByHandler));
            }
        }
    }

    /// Waits until the port has made progress, the time is over, or the driver is woken. Returns whether that took a wait,
    /// and the port's progress.
    async fn wait(
        &mut self,
        wants_input: bool,
        due: Option<Duration>,
        mut wake: Pin<&mut impl Future<Output = ()>>,
    ) -> (bool, Result<PortProgress, P::Error>) {
        let Self { port, time, input, out, unsent } = self;
        let mut passed = pin!(port.pass(wants_input.then_some(input), Outgoing::of(unsent, out)));
        let mut time = pin!(time.until(due));
        let mut has_waited = false;
        let (is_woken, passed) = poll_fn(|context| {
            if let Poll::Ready(passed) = passed.as_mut().poll(context) {
                return Poll::Ready((false, passed));
            }
            if wake.as_mut().poll(context).is_ready() {
                return Poll::Ready((true, Ok(PortProgress::default())));
            }
            has_waited = true;
            time.as_mut().poll(context).map(|()| (false, Ok(PortProgress::default())))
        })
        .await;
        unsent.woken = is_woken;
        (has_waited, passed)
    }
}

/// Gives the session the bytes that the port has read during a wait, and the time.
#[inline]
pub(crate) fn take<S: Session, B>(
    session: &mut S,
    unsent: &mut PendingWork,
    input: &[u8],
    passed: PortProgress,
    now: Duration,
) -> ControlFlow<EndReason<B>> {
    let PortProgress { read, written, flushed } = passed;
    if read.is_some() || written.is_none() {
        unsent.restart();
    }
    match written {
        Some(0) if unsent.is_some() => return ControlFlow::Break(EndReason::ByPeer),
        Some(taken) => unsent.wrote(taken, flushed, now),
        None => {}
    }
    match read {
        Some(0) => return ControlFlow::Break(EndReason::ByPeer),
        Some(length) => session.handle_input(now, input.get(..length).unwrap_or_default()),
        None => {}
    }
    session.handle_timeout(now);
    if unsent.is_stalled(now) {
        return ControlFlow::Break(EndReason::Stalled);
    }
    ControlFlow::Continue(())
}
