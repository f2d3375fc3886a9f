//! Faults that nobody between the ends can see, and why not.

use super::faults::Case;

/// Why the fault cannot be seen; `None` where it should be.
pub(crate) fn unseen(_case: &Case<'_>) -> Option<&'static str> {
    None
}
