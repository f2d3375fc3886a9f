//! The order of calls after any `handle_…`: the loop of every driver, one step at a time.

use core::time::Duration;

use crate::session::Session;

/// The next thing to do for a session.
#[derive(Debug)]
pub enum Step<'a, E> {
    /// An event for the caller to handle.
    Event(E),
    /// The caller sends these bytes.
    Write(&'a [u8]),
    /// Nothing is to be done before bytes arrive or a time is reached.
    Wait {
        /// The latest time to call [`Session::handle_timeout`]; `None` if nothing happens without bytes, a call or a wake.
        until: Option<Duration>,
        /// Whether bytes are to be read from the transport meanwhile: [`Session::wants_input`].
        reads: bool,
    },
}

/// The steps between two inputs of a session: its events, then everything that it sends, until there is neither.
///
/// ```
/// # use core::time::Duration;
/// # use robot_session::{Session, Step, Steps};
/// # fn run<S: Session>(session: &mut S, now: Duration, buffer: &mut [u8]) -> Option<Duration> {
/// let mut steps = Steps::NEW;
/// loop {
///     match steps.next(session, now, buffer) {
///         Step::Event(_event) => {} // a lamp, a call of the session
///         Step::Write(_bytes) => {} // to the port, all of them
///         Step::Wait { until, .. } => return until,
///     }
/// }
/// # }
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Steps {
    /// Whether bytes were just sent: further bytes come before the events of that.
    is_sending: bool,
}

impl Steps {
    /// The first step comes after an input.
    pub const NEW: Self = Self { is_sending: false };

    /// Returns the next step. Before the next call the caller has taken all bytes of a [`Step::Write`]. `buffer` has at least
    /// [`MAX_TRANSMIT`](Session::MAX_TRANSMIT) bytes.
    #[inline]
    pub fn next<'a, S: Session>(
        &mut self,
        session: &mut S,
        now: Duration,
        buffer: &'a mut [u8],
    ) -> Step<'a, S::Event> {
        if !self.is_sending
            && let Some(event) = session.poll_event()
        {
            return Step::Event(event);
        }
        if let Some(length) = session.poll_transmit(now, buffer) {
            self.is_sending = true;
            return Step::Write(buffer.get(..length).unwrap_or_default());
        }
        self.is_sending = false;
        // Even if nothing is to be sent, a deadline may have expired, or a frame was read.
        match session.poll_event() {
            Some(event) => Step::Event(event),
            None => Step::Wait { until: session.poll_timeout(), reads: session.wants_input() },
        }
    }
}
