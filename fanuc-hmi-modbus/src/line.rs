//! What both machines know of their line.

use core::time::Duration;

use robot_session::is_due;

use crate::framing::Framing;

/// Whether bytes are arriving.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Line {
    /// Nothing has arrived for the silence of the framing. On TCP always: frames have their length.
    Silent,
    /// Bytes have arrived; nothing more until then is a silence.
    Busy {
        /// When the line counts as silent.
        silent_at: Duration,
    },
}

impl Line {
    /// Bytes have arrived, or are read again.
    pub(crate) fn receive(&mut self, now: Duration, framing: Framing) {
        if let Some(silence) = framing.silence() {
            *self = Self::Busy { silent_at: now.saturating_add(silence) };
        }
    }

    /// Whether a frame may be sent: on a serial line after the silence only.
    pub(crate) fn may_send(self, framing: Framing) -> bool {
        !framing.is_serial() || self == Self::Silent
    }

    /// Whether the silence is over.
    pub(crate) fn is_due(self, now: Duration) -> bool {
        matches!(self, Self::Busy { silent_at } if is_due(silent_at, now))
    }
}
