//! The software handshake of the line (§5): an end that cannot take more holds the other one.

use core::time::Duration;

use robot_session::end::is_due;

/// Lets an end send again, ASCII DC1.
pub const XON: u8 = 0x11;
/// Holds an end, ASCII DC3.
pub const XOFF: u8 = 0x13;

/// Whether an end may send.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Flow {
    /// The end may send whatever is due.
    Free,
    /// XOFF has come, and no XON since.
    Held {
        /// The time from which the end may send nevertheless: the XOFF may be noise.
        until: Duration,
    },
}

impl Flow {
    /// Called when XOFF has come.
    pub(crate) fn hold(&mut self, until: Duration, prolongs: bool) {
        if *self == Self::Free || prolongs {
            *self = Self::Held { until };
        }
    }

    pub(crate) const fn until(self) -> Duration {
        match self {
            Self::Held { until } => until,
            Self::Free => Duration::MAX,
        }
    }

    pub(crate) fn is_over(self, now: Duration) -> bool {
        is_due(self.until(), now)
    }
}
