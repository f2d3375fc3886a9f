//! The constants of the models of both ends, and their properties.

use core::time::Duration;

use crate::faults::Faults;

/// The time of a tick.
pub(super) const TICK: Duration = Duration::from_millis(100);
/// A serial line without parity, much worse than real ones.
pub(super) const FAULTS: Faults =
    Faults { flip: 0.001, lose_byte: 0.0005, insert: 0.0005, lose: 0.03, split: 0.3, ..Faults::NONE };

pub(super) const ONE_OUTCOME: &str = "a request has one outcome";
pub(super) const CREDIT: &str = "the workstation asks first, after an answer, or after a pause";
pub(super) const ASKS: &str = "a display that was paused asks again";
pub(super) const STALE: &str = "who looks at the picture learns when it is stale";
pub(super) const ASKED: &str = "the host sends nothing unasked";
pub(super) const PACED: &str = "at most one packet is sent in an interval";
pub(super) const PILED: &str = "requests that have piled up are answered once";
pub(super) const FRESH: &str = "no pose is sent that is too old";
pub(super) const CLAIMED: &str = "without a fault every request is answered, and nothing is stale or unasked";
