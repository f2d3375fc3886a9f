//! One turn of the loops that wait by `.await`: tokio's, and that over `embedded-io-async`. A turn that is dropped loses nothing, so the
//! loop over `embedded-io` is the same one, polled once.

use core::future::{pending, poll_fn};
use core::ops::ControlFlow;
use core::pin::pin;
use core::task::Poll;
use core::time::Duration;

use crate::ended::{Ended, report};
use crate::session::Session;

/// What carries the bytes.
pub(crate) trait Port {
    type Error;

    /// How many bytes have come; none at the end. A dropped future has taken none.
    fn read(&mut self, buffer: &mut [u8]) -> impl Future<Output = Result<usize, Self::Error>>;

    /// How many of the bytes it has taken; none at the end. A dropped future has taken none.
    fn write(&mut self, bytes: &[u8]) -> impl Future<Output = Result<usize, Self::Error>>;

    /// Sends what it has taken.
    fn flush(&mut self) -> impl Future<Output = Result<(), Self::Error>>;
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
    /// The time since an epoch of its choice.
    fn now(&self) -> Duration;

    /// Waits until then, and not at all for what is past.
    fn sleep_until(&self, at: Duration) -> impl Future<Output = ()>;
}

/// What is left of a turn that was dropped, or has ended.
#[derive(Debug)]
pub(crate) struct Left {
    /// What is not written yet is in `out` from here,
    begin: usize,
    /// to here.
    end: usize,
    /// The turn before was woken: the caller has done since what it was woken for, and the session is to see it.
    woken: bool,
}

impl Left {
    pub(crate) const NOTHING: Self = Self { begin: 0, end: 0, woken: false };

    /// Bytes are left to be written.
    pub(crate) const fn is_some(&self) -> bool {
        self.begin < self.end
    }
}

/// What a turn works with. `out` has at least [`MAX_TRANSMIT`](Session::MAX_TRANSMIT) bytes.
pub(crate) struct Turn<'a, P, C> {
    pub(crate) port: &'a mut P,
    pub(crate) clock: &'a C,
    pub(crate) input: &'a mut [u8],
    pub(crate) out: &'a mut [u8],
    pub(crate) left: &'a mut Left,
}

impl<P: Port, C: Clock> Turn<'_, P, C> {
    /// Events and what is to be sent, until there is neither, then one wait for bytes, for the session's timeout or for `wake`, then the
    /// events of that.
    pub(crate) async fn run<S: Session, B>(
        mut self,
        session: &mut S,
        wake: impl Future<Output = ()>,
        mut handler: impl FnMut(&mut S, S::Event) -> ControlFlow<B>,
    ) -> Result<ControlFlow<Ended<B>>, P::Error> {
        let mut idle = false;
        while !core::mem::replace(&mut idle, true) {
            while let Some(event) = session.poll_event() {
                if let ControlFlow::Break(value) = handler(session, event) {
                    return Ok(ControlFlow::Break(Ended::ByHandler(value)));
                }
                idle = false;
            }
            // What a dropped future has left comes first.
            while self.write().await? {
                let Some(length) = session.poll_transmit(self.clock.now(), self.out) else { break };
                (self.left.begin, self.left.end) = (0, length);
                idle = false;
            }
            if self.left.is_some() {
                return Ok(ControlFlow::Break(Ended::ByPeer));
            }
        }
        let at = if self.left.woken { Some(Duration::ZERO) } else { session.poll_timeout() };
        match self.receive(session.wants_input(), at, wake).await? {
            Some(0) => return Ok(ControlFlow::Break(Ended::ByPeer)),
            Some(length) => {
                session.handle_input(self.clock.now(), self.input.get(..length).unwrap_or_default());
            }
            None => {}
        }
        session.handle_timeout(self.clock.now());
        Ok(report(session, &mut handler).map_break(Ended::ByHandler))
    }

    /// How many bytes have come; `None` if the time is over, or the driver was woken.
    async fn receive(
        &mut self,
        wants_input: bool,
        at: Option<Duration>,
        wake: impl Future<Output = ()>,
    ) -> Result<Option<usize>, P::Error> {
        let Self { port, clock, input, left, .. } = self;
        let mut arrival = pin!(async { if wants_input { port.read(input).await } else { pending().await } });
        let mut wake = pin!(wake);
        let mut time = pin!(async {
            match at {
                // The latest time of all is never.
                None | Some(Duration::MAX) => pending().await,
                Some(at) => clock.sleep_until(at).await,
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
        left.woken = is_woken;
        read
    }

    /// Writes what is left, cancel-safe: what a write has taken is no longer left. False: it takes nothing more.
    async fn write(&mut self) -> Result<bool, P::Error> {
        while let Some(bytes @ [_, ..]) = self.out.get(self.left.begin..self.left.end) {
            match self.port.write(bytes).await? {
                0 => return Ok(false),
                taken => self.left.begin += taken,
            }
        }
        self.port.flush().await?;
        Ok(true)
    }
}
