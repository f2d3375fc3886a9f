//! What a turn has not written yet.

use core::ops::ControlFlow;
use core::time::Duration;

use crate::ended::{Ended, STALL};
use crate::session::Session;
use crate::step::{Step, Steps};

/// While bytes wait to be written, what is due next may be the next bytes: other deadlines are looked for as often as this.
const LOOK: Duration = Duration::from_millis(10);

/// What is left of a turn that has ended, or was dropped.
#[derive(Debug)]
pub(crate) struct Left {
    /// The steps of the session between two inputs.
    steps: Steps,
    /// What is not written yet is in the driver's buffer from here,
    begin: usize,
    /// to here.
    end: usize,
    /// What is not written yet was not announced.
    pub(crate) unannounced: bool,
    /// The port holds what was written.
    #[cfg(any(feature = "tokio", feature = "embedded-io", feature = "embedded-io-async"))]
    pub(crate) unflushed: bool,
    /// When the port has last taken a byte.
    taken_at: Duration,
    /// For so long it may take none.
    stall: Duration,
    /// No turn of this connection has begun.
    #[cfg(feature = "std")]
    pub(crate) is_new: bool,
    /// The turn before was woken: the caller has done since what it was woken for, and the session is to see it.
    pub(crate) woken: bool,
}

impl Left {
    pub(crate) const NOTHING: Self = Self {
        steps: Steps::NEW,
        begin: 0,
        end: 0,
        taken_at: Duration::ZERO,
        stall: STALL,
        #[cfg(feature = "std")]
        is_new: true,
        unannounced: false,
        #[cfg(any(feature = "tokio", feature = "embedded-io", feature = "embedded-io-async"))]
        unflushed: false,
        woken: false,
    };

    /// Bytes are left to be written.
    pub(crate) const fn is_some(&self) -> bool {
        self.begin < self.end
    }

    /// Nothing, from a port that may take none for this long.
    pub(crate) const fn with_stall(stall: Duration) -> Self {
        Self { stall, ..Self::NOTHING }
    }

    /// The next connection begins with nothing of this one.
    pub(crate) const fn clear(&mut self) {
        *self = Self::with_stall(self.stall);
    }

    /// The next step of the session. Bytes that are not written yet come before others.
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
            self.unannounced = self.is_some();
        }
        step
    }

    /// The next bytes are written.
    pub(crate) fn take(&mut self, length: usize, now: Duration) {
        self.begin = self.begin.saturating_add(length).min(self.end);
        if length > 0 {
            self.taken_at = now;
        }
    }

    /// The port takes nothing any more.
    pub(crate) fn is_stalled(&self, now: Duration) -> bool {
        self.is_some() && now >= self.taken_at.saturating_add(self.stall)
    }

    /// Those bytes of the driver's buffer.
    pub(crate) fn of<'a>(&self, buffer: &'a [u8]) -> &'a [u8] {
        buffer.get(self.begin..self.end).unwrap_or_default()
    }

    /// A turn has ended. With the connection ends what it did not take: the next one begins with nothing of it.
    pub(crate) fn after<B, E>(
        &mut self,
        turned: Result<ControlFlow<Ended<B>>, E>,
    ) -> Result<ControlFlow<Ended<B>>, E> {
        if matches!(turned, Err(_) | Ok(ControlFlow::Break(Ended::ByPeer | Ended::Stalled))) {
            self.clear();
        }
        turned
    }

    /// When the session is to be called again at the latest.
    pub(crate) fn due<S: Session>(&self, session: &S, now: Duration) -> Option<Duration> {
        if self.woken {
            return Some(Duration::ZERO);
        }
        let is_hidden = |at: &Duration| self.is_some() && *at <= now;
        let due = session.poll_timeout().map(|at| if is_hidden(&at) { now.saturating_add(LOOK) } else { at });
        let stalled = self.is_some().then(|| self.taken_at.saturating_add(self.stall));
        due.into_iter().chain(stalled).min()
    }
}

#[cfg(any(feature = "tokio", feature = "embedded-io", feature = "embedded-io-async"))]
impl Left {
    /// The session has got an input: its events come before more bytes.
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
