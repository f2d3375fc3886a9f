//! Signals of the system to the bridge: to end, or to reload the site file.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use anyhow::Result;
use cellwire_io::interrupt::{self, Policy};

/// Notes SIGINT and SIGTERM from now on ([`interrupt::requested`]); a bridge that has not ended within `limit` is ended with the
/// remark. Returns a flag that is true after each SIGHUP, if the system has that.
///
/// # Errors
/// If the system has no room for a thread.
#[cfg(unix)]
pub fn handle(limit: Duration, remark: &'static str) -> Result<Arc<AtomicBool>> {
    use std::sync::atomic::Ordering;

    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
    use signal_hook::iterator::Signals;

    let mut signals = Signals::new([SIGHUP, SIGINT, SIGTERM])?;
    let (reload, mut end) = (Arc::new(AtomicBool::new(false)), Policy::NoteWithin(limit, remark).handler());
    let shared = Arc::clone(&reload);
    let run = move || {
        for signal in signals.forever() {
            match signal {
                SIGHUP => shared.store(true, Ordering::Relaxed),
                _ => interrupt::count(false).into_iter().for_each(&mut end),
            }
        }
    };
    std::thread::Builder::new().name("signals".into()).spawn(run)?;
    Ok(reload)
}

/// Handles interrupts from now on: an interrupt is noted ([`interrupt::requested`]), and a bridge that has not ended within
/// `limit` is ended with the remark.
///
/// # Errors
/// If another handler is installed already.
#[cfg(not(unix))]
pub fn handle(limit: Duration, remark: &'static str) -> Result<Arc<AtomicBool>> {
    interrupt::on_interrupt(Policy::NoteWithin(limit, remark))?;
    Ok(Arc::default())
}
