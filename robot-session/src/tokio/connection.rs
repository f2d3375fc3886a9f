//! One connection of a task.

use core::any::Any;
use core::convert::Infallible;
use core::future::{Future, poll_fn};
use core::ops::ControlFlow;
use core::panic::AssertUnwindSafe;
use core::pin::{Pin, pin};
use core::task::{Context, Poll, Waker as TaskWaker};
use core::time::Duration;
use std::boxed::Box;
use std::io;
use std::panic::{catch_unwind, resume_unwind};
use std::vec;
use std::vec::Vec;

use ::tokio::io::{AsyncRead, AsyncWrite};
use ::tokio::sync::futures::Notified;
use ::tokio::sync::mpsc;

use super::Waker;
use super::driver::Port;
use super::polled::PolledInput;
use super::served::ServedSession;
use super::service::Service;
use super::timer::Timer;
use crate::machine::is_due;
use crate::pending::PendingWork;
use crate::trace::Span;
use crate::turn::{Outgoing, PortProgress, take};
use crate::{EndReason, Session as _, now};

/// The longest time that a connection which is over waits for the state to be stored.
const LAST_KEEP: Duration = Duration::from_secs(1);

/// A transport of a connection's bytes.
pub(super) trait Stream: AsyncRead + AsyncWrite + Unpin + Send {}

impl<T: AsyncRead + AsyncWrite + Unpin + Send> Stream for T {}

/// A connection, and the session that uses it. The task owns it while it is awake; while the task sleeps it is in the
/// [`Shared`](super::shared::Shared).
pub(super) struct Connection<S: Service> {
    pub(super) served: ServedSession<S>,
    port: Port<Box<dyn Stream>>,
    input: Vec<u8>,
    out: Vec<u8>,
    unsent: PendingWork,
    timer: Timer,
    clock: Clock,
    polls: Option<Polls>,
    /// Whether bytes were sent.
    pub(super) has_sent: bool,
    /// Whether bytes, or their end, were received.
    pub(super) has_received: bool,
    /// The longest time for storing the state.
    stall: Duration,
    /// The work that a caller has left to the task.
    handed_over: Option<HandedOverWork>,
    span: Span,
}

/// The inputs that the task waits for.
pub(super) struct Inputs<'a, 'w, S: Service, O> {
    /// The end of the task or of the connection.
    pub(super) over: Pin<&'a mut O>,
    pub(super) calls: &'a mut mpsc::Receiver<S::Call>,
    pub(super) woken: Pin<&'a mut Notified<'w>>,
    pub(super) waker: &'w Waker,
}

/// The result of a wait.
pub(super) enum WaitResult {
    /// The connection is over.
    Over(ConnectionEnd),
    /// The session has got calls.
    Called,
    /// The work that a caller has left to the task.
    HandedOver(HandedOverWork),
    /// The port has read or written, or the task was woken.
    Passed(PortProgress),
    /// A deadline has passed.
    Time,
}

/// The reason that a connection is over.
pub(super) enum ConnectionEnd {
    /// The task is to end.
    Stopped,
    /// Another connection replaces it.
    Replaced,
    /// The port has failed, or the state could not be stored.
    Lost(io::Error),
    /// The service has ended the connection.
    Unusable(io::Error),
}

/// The work that a caller leaves to the task.
pub(super) enum HandedOverWork {
    /// The call is made; the remaining work may have to wait.
    Rest,
    /// The connection is over.
    Over(ConnectionEnd),
    /// The service has panicked. The task panics in its place.
    Panic(Box<dyn Any + Send>),
}

/// The polled inputs of a task.
struct Polls {
    over: PolledInput,
    calls: PolledInput,
    port: PolledInput,
    waker: PolledInput,
}

/// The clock of a connection. It is read once for everything that happens at the same time.
struct Clock {
    now: Duration,
    is_used: bool,
}

impl<S: Service> Connection<S> {
    pub(super) fn new(served: ServedSession<S>, port: Box<dyn Stream>, stall: Duration, span: Span) -> Self {
        Self {
            served,
            port: Port::new(port),
            input: vec![0; S::Session::MAX_INPUT],
            out: vec![0; S::Session::MAX_TRANSMIT],
            unsent: PendingWork::with_stall(stall),
            timer: Timer::default(),
            clock: Clock { now: now(), is_used: true },
            polls: None,
            has_sent: false,
            has_received: false,
            stall,
            handed_over: None,
            span,
        }
    }

    /// Connects the session.
    pub(super) fn begin(&mut self) {
        self.served.session.handle_connected(self.clock.now);
    }

    /// Disconnects the session, and reports the events of that.
    pub(super) fn end(self) -> ServedSession<S> {
        let mut served = self.served;
        served.session.handle_disconnected(now());
        served.report();
        served
    }

    /// Reports events before a wait, and puts the bytes to be sent into the buffer. Returns whether to store the state
    /// first.
    pub(super) fn prepare(&mut self) -> io::Result<bool> {
        let Self { served, unsent, out, clock, .. } = self;
        served.prepare(unsent, out, clock.now)?;
        Ok(unsent.hook_pending || served.has_reported)
    }

    /// Stores the state. It is stored even if the connection is over meanwhile, but for no longer than [`LAST_KEEP`].
    pub(super) async fn keep(
        &mut self,
        mut over: Pin<&mut impl Future<Output = ConnectionEnd>>,
    ) -> Result<(), ConnectionEnd> {
        let Self { served, unsent, polls, clock, timer, stall, .. } = self;
        let mut keep = pin!(served.service.keep(&mut served.session));
        let (mut until, mut is_over) = (None, None);
        let kept = poll_fn(|context| {
            if let Poll::Ready(kept) = keep.as_mut().poll(context) {
                return Poll::Ready(kept);
            }
            let until = until.get_or_insert_with(|| now().saturating_add(*stall));
            let Polls { over: polled, .. } = Polls::of(polls, context);
            if is_over.is_none() && polled.is_due() {
                match over.as_mut().poll(&mut polled.context()) {
                    Poll::Ready(over) => {
                        is_over = Some(over);
                        *until = now().saturating_add(LAST_KEEP).min(*until);
                    }
                    Poll::Pending => polled.set_pending(),
                }
            }
            let late = || Err(io::Error::new(io::ErrorKind::TimedOut, "the state was not stored in time"));
            timer.poll(context, Some(*until)).map(|()| late())
        })
        .await;
        if until.is_some() {
            clock.read();
        }
        match (kept, is_over) {
            (_, Some(over)) => Err(over),
            (Err(error), None) => Err(ConnectionEnd::Lost(error)),
            (Ok(()), None) => {
                (unsent.hook_pending, served.has_reported) = (false, false);
                Ok(())
            }
        }
    }

    /// Called after the task has slept; returns the work that a caller has handed over.
    pub(super) fn wake_up(&mut self) -> Option<HandedOverWork> {
        self.clock.read();
        self.handed_over.take()
    }

    /// Polls everything that the task waits for.
    #[inline(always)]
    pub(super) fn poll<O: Future<Output = ConnectionEnd>>(
        &mut self,
        context: &mut Context<'_>,
        inputs: &mut Inputs<'_, '_, S, O>,
    ) -> Poll<WaitResult> {
        let Self { served, port, input, out, unsent, timer, clock, polls, .. } = self;
        let polls = Polls::of(polls, context);
        if polls.over.is_due() {
            if let Poll::Ready(over) = inputs.over.as_mut().poll(&mut polls.over.context()) {
                return Poll::Ready(WaitResult::Over(over));
            }
            polls.over.set_pending();
        }
        let mut is_called = false;
        while polls.calls.is_due() && served.has_room() {
            match inputs.calls.poll_recv(&mut polls.calls.context()) {
                Poll::Ready(Some(call)) => {
                    let now = clock.next();
                    served.service.call(&mut served.session, now, call);
                }
                Poll::Ready(None) => return Poll::Ready(WaitResult::Over(ConnectionEnd::Stopped)),
                Poll::Pending => {
                    polls.calls.set_pending();
                    break;
                }
            }
            is_called = true;
        }
        if is_called {
            return Poll::Ready(WaitResult::Called);
        }
        let input = (polls.port.is_due() && served.session.wants_input()).then_some(&mut **input);
        let mut is_unread = false;
        let outgoing = Outgoing::of(unsent, out);
        let passed = port.poll(&mut polls.port.context(), input, outgoing, || is_unread = true);
        if is_unread {
            polls.port.set_pending();
        }
        if let Poll::Ready(passed) = passed {
            return Poll::Ready(match passed {
                Ok(passed) => WaitResult::Passed(passed),
                Err(error) => WaitResult::Over(ConnectionEnd::Lost(error)),
            });
        }
        if polls.waker.is_due() {
            if inputs.woken.as_mut().poll(&mut polls.waker.context()).is_ready() {
                inputs.woken.set(inputs.waker.0.notified());
                return Poll::Ready(WaitResult::Passed(PortProgress::default()));
            }
            polls.waker.set_pending();
        }
        timer.poll(context, served.due(unsent, clock.now)).map(|()| WaitResult::Time)
    }

    /// Gives the result of a wait to the session.
    pub(super) fn take(&mut self, waited: WaitResult) -> ControlFlow<ConnectionEnd> {
        let Self { served, input, unsent, clock, has_sent, has_received, .. } = self;
        let passed = match waited {
            WaitResult::Over(over) | WaitResult::HandedOver(HandedOverWork::Over(over)) => {
                return ControlFlow::Break(over);
            }
            WaitResult::HandedOver(HandedOverWork::Panic(panic)) => resume_unwind(panic),
            WaitResult::Called | WaitResult::HandedOver(HandedOverWork::Rest) => {
                unsent.restart();
                return ControlFlow::Continue(());
            }
            WaitResult::Time => {
                clock.read();
                if served.service.poll_timeout().is_some_and(|at| is_due(at, clock.now)) {
                    served.service.handle_timeout(&mut served.session, clock.now);
                }
                PortProgress::default()
            }
            WaitResult::Passed(passed) => passed,
        };
        *has_sent |= passed.written.is_some();
        *has_received |= passed.read.is_some();
        let has_only_written = passed.read.is_none() && passed.written.is_some();
        if !has_only_written {
            clock.next();
        }
        let taken = take::<_, Infallible>(&mut *served.session, unsent, input, passed, clock.now);
        if let ControlFlow::Break(ended) = taken {
            let (kind, why) = match ended {
                EndReason::Stalled => (io::ErrorKind::TimedOut, "the peer does not read"),
                _ => (io::ErrorKind::UnexpectedEof, "the peer has closed the connection"),
            };
            return ControlFlow::Break(ConnectionEnd::Lost(io::Error::new(kind, why)));
        }
        ControlFlow::Continue(())
    }

    /// Makes a call, and sends the bytes for it. If more is to be done, the task is woken for it.
    ///
    /// # Errors
    /// The session cannot accept another call: the call is given back.
    pub(super) fn call(&mut self, call: S::Call) -> Result<(), S::Call> {
        if self.handed_over.is_some() || !self.served.has_room() {
            return Err(call);
        }
        let made = catch_unwind(AssertUnwindSafe(|| {
            let now = now();
            let span = self.span.clone();
            span.within(|| {
                self.served.service.call(&mut self.served.session, now, call);
                self.send(now)
            })
        }));
        self.handed_over = match made {
            Ok(Ok(CallBytes::All)) => None,
            Ok(Ok(CallBytes::Part)) => Some(HandedOverWork::Rest),
            Ok(Err(over)) => Some(HandedOverWork::Over(over)),
            Err(panic) => Some(HandedOverWork::Panic(panic)),
        };
        if let (Some(_), Some(polls)) = (&self.handed_over, &self.polls) {
            polls.calls.wake();
        }
        Ok(())
    }

    /// Sends the bytes for a call.
    fn send(&mut self, now: Duration) -> Result<CallBytes, ConnectionEnd> {
        let Self { served, port, out, unsent, timer, has_sent, polls: Some(polls), .. } = self else {
            return Ok(CallBytes::Part);
        };
        unsent.restart();
        served.prepare(unsent, out, now).map_err(ConnectionEnd::Unusable)?;
        if unsent.hook_pending || served.has_reported {
            let keep = pin!(served.service.keep(&mut served.session));
            match keep.poll(&mut Context::from_waker(TaskWaker::noop())) {
                Poll::Ready(kept) => kept.map_err(ConnectionEnd::Lost)?,
                Poll::Pending => return Ok(CallBytes::Part),
            }
            (unsent.hook_pending, served.has_reported) = (false, false);
        }
        if unsent.is_some() {
            let written = port.poll_write(&mut polls.port.context(), Outgoing::of(unsent, out));
            // An error is left to the task, which first reads the bytes that have come.
            let Poll::Ready(Ok(passed)) = written.passed(Poll::Pending) else { return Ok(CallBytes::Part) };
            *has_sent = true;
            unsent.wrote(passed.written.unwrap_or_default(), passed.flushed, now);
            served.prepare(unsent, out, now).map_err(ConnectionEnd::Unusable)?;
        }
        let is_all = !unsent.is_some() && !served.has_reported && timer.is_in_time(served.due(unsent, now));
        Ok(if is_all { CallBytes::All } else { CallBytes::Part })
    }
}

/// Whether the bytes for a call are sent.
enum CallBytes {
    /// All of them, and the task sleeps on.
    All,
    /// The task continues.
    Part,
}

impl Polls {
    /// Returns those of the task of `context`. If another task waits now, all inputs are due.
    #[inline]
    fn of<'a>(polls: &'a mut Option<Self>, context: &Context<'_>) -> &'a mut Self {
        if polls.as_ref().is_some_and(|polls| !polls.over.wakes(context)) {
            *polls = None;
        }
        polls.get_or_insert_with(|| Self::new(context))
    }

    #[cold]
    fn new(context: &Context<'_>) -> Self {
        let [over, calls, port, waker] = core::array::from_fn(|_| PolledInput::new(context));
        Self { over, calls, port, waker }
    }
}

impl Clock {
    /// Reads the clock.
    fn read(&mut self) {
        (self.now, self.is_used) = (now(), false);
    }

    /// Returns the time of the current event: later than that of the previous one.
    fn next(&mut self) -> Duration {
        if core::mem::replace(&mut self.is_used, true) {
            self.now = now();
        }
        self.now
    }
}
