//! Whether bytes are arriving on the line; shared by the machines of client and server.

use core::time::Duration;

use robot_session::end::is_due;

use crate::framing::Framing;

/// Whether bytes are arriving.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Line {
    /// Nothing has arrived for the silence of the framing. On TCP always: frames have their length.
    Silent,
    /// Bytes have arrived; if nothing more comes until `silent_at`, that is a silence.
    Busy {
        /// The time at which the line counts as silent.
        silent_at: Duration,
    },
    /// The bytes that have arrived may be the beginning of a frame. Between the line and the program, a UART or an adapter delays
    /// bytes: a silence in their arrival does not end the frame.
    Partial {
        /// The time at which the rest of the frame is given up.
        until: Duration,
    },
}

impl Line {
    /// Records that bytes have arrived, or are read again.
    pub(crate) fn receive(&mut self, now: Duration, framing: Framing) {
        if let Some(silence) = framing.silence() {
            *self = Self::Busy { silent_at: now.saturating_add(silence) };
        }
    }

    /// Waits for the rest of a frame, whose beginning may have arrived, and at least for the silence.
    pub(crate) fn wait_for_rest(&mut self, until: Duration) {
        *self = Self::Partial { until: self.ends_at().map_or(until, |silent_at| silent_at.max(until)) };
    }

    /// Returns the time at which the bytes that have arrived count as ended.
    pub(crate) const fn ends_at(self) -> Option<Duration> {
        match self {
            Self::Silent => None,
            Self::Busy { silent_at: at } | Self::Partial { until: at } => Some(at),
        }
    }

    /// Returns `ends_at` as a mutable reference.
    pub(crate) const fn ends_at_mut(&mut self) -> Option<&mut Duration> {
        match self {
            Self::Silent => None,
            Self::Busy { silent_at: at } | Self::Partial { until: at } => Some(at),
        }
    }

    /// Returns whether a frame may be sent: on a serial line after a silence only.
    pub(crate) fn may_send(self, framing: Framing) -> bool {
        !framing.is_serial() || !matches!(self, Self::Busy { .. })
    }

    /// Returns whether the bytes that have arrived have ended.
    pub(crate) fn is_due(self, now: Duration) -> bool {
        self.ends_at().is_some_and(|at| is_due(at, now))
    }

    /// Returns whether a silence has passed, after which bytes do not continue those before.
    pub(crate) fn was_silent(self, now: Duration) -> bool {
        matches!(self, Self::Busy { silent_at } if is_due(silent_at, now))
    }
}
