//! The time at which the session is to be called.

use core::time::Duration;

use crate::{chip, now};

/// No alarm is set for longer: the session is called early, and says again when.
const LONGEST: Duration = Duration::from_secs(60);

/// Sets the alarm of the session.
pub(crate) fn set(at: Option<Duration>) {
    let Some(at) = at else { return chip::clear_alarm() };
    match at.checked_sub(now()) {
        None | Some(Duration::ZERO) => chip::trigger_session(),
        Some(left) => chip::set_alarm(left.min(LONGEST)),
    }
}
