//! The unsent bytes and the pending work of a driver after a turn.

use core::ops::ControlFlow;
use core::time::Duration;

use crate::end_reason::{EndReason, STALL};
use crate::session::Session;
use crate::step::{Step, Steps};

/// While bytes wait to be written, the session's deadline may be in the past, because its next message is due. It is then
/// checked again after this time, not at once.
const RECHECK_INTERVAL: Duration = Duration::from_millis(10);

/// The unsent bytes and the pending work of a turn that has ended, or was dropped.
#[derive(Debug)]
pub(crate) struct PendingWork {
    /// The steps of the session between two inputs.
    steps: Steps,
    /// The index in the driver's buffer at which the unsent bytes begin.
    begin: usize,
    /// The index in the driver's buffer at which the unsent bytes end.
    end: usize,
    /// Whether the hook before a transmission is still due for the unsent bytes.
    pub(crate) hook_pending: bool,
    /// Whether the port still buffers written bytes.
    #[cfg(any(feature = "tokio", feature = "embedded-io", feature = "embedded-io-async"))]
    pub(crate) unflushed: bool,
    /// The time at which the port last took a byte.
    taken_at: Duration,
    /// The longest time for which the port may take no byte.
    stall: Duration,
    /// Whether no turn of this connection has begun.
    #[cfg(feature = "std")]
    pub(crate) is_new: bool,
    /// Whether the previous turn ended by a wake. The caller has handled it, so the next turn calls the session at once.
    pub(crate) woken: bool,
}

impl PendingWork {
    pub(crate) const NOTHING: Self = Self {
        steps: Steps::NEW,
        begin: 0,
        end: 0,
        taken_at: Duration::ZERO,
        stall: STALL,
        #[cfg(feature = "std")]
        is_new: true,
        hook_pending: false,
        #[cfg(any(feature = "tokio", feature = "embedded-io", feature = "embedded-io-async"))]
        unflushed: false,
        woken: false,
    };

    /// Returns whether there are unsent bytes.
    pub(crate) const fn is_some(&self) -> bool {
        self.begin < self.end
    }

    /// Creates a driver state without unsent bytes, for a port that may take no byte for `stall`.
    pub(crate) const fn with_stall(stall: Duration) -> Self {
        Self { stall, ..Self::NOTHING }
    }

    /// Discards all state of this connection before the next one begins.
    pub(crate) const fn clear(&mut self) {
        *self = Self::with_stall(self.stall);
    }

    /// Returns the next step of the session. Unsent bytes come before others.
    #[inline]
    pub(crate) fn next<'a, S: Session>(
        &mut self,
        session: &mut S,
        now: Duration,
        out: &'a mut [u8],
    ) -> Step<'a, S::Event> {
        if self.is_some() {
            return session.poll_event().map_or_else(|| Step::Write(self.of(out)), Step::Event);
        }
        let step = self.steps.next(session, now, out);
        if let Step::Write(bytes) = &step {
            (self.begin, self.end, self.taken_at) = (0, bytes.len(), now);
            self.hook_pending = self.is_some();
        }
        step
    }

    /// Records that the next `length` bytes are written.
    pub(crate) fn take(&mut self, length: usize, now: Duration) {
        self.begin = self.begin.saturating_add(length).min(self.end);
        if length > 0 {
            self.taken_at = now;
        }
    }

    /// Returns whether the port has taken no byte for too long.
    pub(crate) fn is_stalled(&self, now: Duration) -> bool {
        self.is_some() && now >= self.taken_at.saturating_add(self.stall)
    }

    /// Returns the unsent bytes of the driver's buffer.
    pub(crate) fn of<'a>(&self, buffer: &'a [u8]) -> &'a [u8] {
        buffer.get(self.begin..self.end).unwrap_or_default()
    }

    /// Called when a turn ends. If the connection is closed, discards the unsent bytes, so that the next connection does not
    /// send them.
    pub(crate) fn after<B, E>(
        &mut self,
        turned: Result<ControlFlow<EndReason<B>>, E>,
    ) -> Result<ControlFlow<EndReason<B>>, E> {
        if matches!(turned, Err(_) | Ok(ControlFlow::Break(EndReason::ByPeer | EndReason::Stalled))) {
            self.clear();
        }
        turned
    }

    /// Returns the latest time at which the session is to be called again.
    pub(crate) fn due<S: Session>(&self, session: &S, now: Duration) -> Option<Duration> {
        if self.woken {
            return Some(Duration::ZERO);
        }
        let is_hidden = |at: &Duration| self.is_some() && *at <= now;
        let due = session
            .poll_timeout()
            .map(|at| if is_hidden(&at) { now.saturating_add(RECHECK_INTERVAL) } else { at });
        let stalled = self.is_some().then(|| self.taken_at.saturating_add(self.stall));
        due.into_iter().chain(stalled).min()
    }
}

#[cfg(any(feature = "tokio", feature = "embedded-io", feature = "embedded-io-async"))]
impl PendingWork {
    /// Called when the session has got an input: its events come before more bytes.
    pub(crate) const fn restart(&mut self) {
        self.steps = Steps::NEW;
    }

    /// Gives every event to `each`, until there are bytes to be written or nothing is to be done.
    #[inline]
    pub(crate) fn prepare<S: Session, B>(
        &mut self,
        session: &mut S,
        out: &mut [u8],
        now: Duration,
        mut each: impl FnMut(&mut S, S::Event) -> ControlFlow<B>,
    ) -> ControlFlow<B> {
        while let Step::Event(event) = self.next(session, now, out) {
            each(session, event)?;
        }
        ControlFlow::Continue(())
    }

    /// Called when the port has taken `taken` of the bytes; `flushed` if they have left it.
    pub(crate) fn wrote(&mut self, taken: usize, flushed: bool, now: Duration) {
        self.take(taken, now);
        self.unflushed = taken > 0 && !flushed;
    }
}
