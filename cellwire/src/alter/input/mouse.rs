//! The common parts of 3Dconnexion devices, for every driver.

use std::time::Duration;

use crate::alter::context::Context;
use crate::alter::sample::FULL;

/// Full deflection as these devices report it.
const DEFLECTION: i32 = 350;
/// The age at which a push that is not repeated is old.
pub(super) const MAX_AGE: Duration = Duration::from_millis(100);
/// The interval at which rest is reported: a device at rest sends nothing, so its rest counts as new while the device is there.
pub(super) const PERIOD: Duration = Duration::from_millis(28);
/// A device that is gone is looked for this often.
const REOPEN: Duration = Duration::from_millis(200);

/// Waits for this long; then, whether a device that is gone is to be looked for again, and `next` is when after that.
pub(super) fn looks_again(context: &Context, next: &mut Duration, wait: Duration) -> bool {
    std::thread::sleep(wait);
    let now = context.clock.now();
    let is_due = now >= *next;
    if is_due {
        *next = now + REOPEN;
    }
    is_due
}

/// Converts a value to thousandths of full deflection, and clamps it there.
pub(super) fn thousandths(value: i32) -> i16 {
    let full = i64::from(FULL);
    let value = (i64::from(value) * full / i64::from(DEFLECTION)).clamp(-full, full);
    i16::try_from(value).unwrap_or_default()
}
