//! What is left to do when the user ends a device or a demo: a session that runs leaves its trace, a pseudo-terminal its link.

use std::sync::{Mutex, PoisonError};

use anyhow::{Context, Result};

type Last = Box<dyn FnOnce() + Send>;

/// `None` as long as nobody waits for an interrupt.
static LAST: Mutex<Option<Vec<Last>>> = Mutex::new(None);

/// The exit status of a program that was interrupted, as shells know it.
const INTERRUPTED: i32 = 130;

/// From now on an interrupt (Ctrl-C, or being asked to terminate) ends the program after everything given to [`last`].
///
/// # Errors
/// When somebody else handles interrupts already.
pub fn wait_for() -> Result<()> {
    lock().get_or_insert_default();
    ctrlc::set_handler(|| {
        let last = lock().take().unwrap_or_default();
        last.into_iter().for_each(|last| last());
        std::process::exit(INTERRUPTED);
    })
    .context("cannot wait for an interrupt")
}

/// Keeps `last` for an interrupt, if one is waited for.
pub fn last(last: impl FnOnce() + Send + 'static) {
    if let Some(kept) = lock().as_mut() {
        kept.push(Box::new(last));
    }
}

fn lock() -> std::sync::MutexGuard<'static, Option<Vec<Last>>> {
    LAST.lock().unwrap_or_else(PoisonError::into_inner)
}
