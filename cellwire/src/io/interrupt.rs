//! What is done when the user interrupts a device or a demo, or closes its console: a running session writes its trace, and the link of a
//! pseudo-terminal is removed.

use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use anyhow::{Context, Result};

use crate::io::output;

type Action = Box<dyn FnOnce() + Send>;

/// `None` until [`handle`] is called.
static ACTIONS: Mutex<Option<Vec<Action>>> = Mutex::new(None);

/// The exit status that shells use for a program that was interrupted.
pub const INTERRUPTED: i32 = 130;

/// From now on an interrupt (Ctrl-C, or a termination signal) runs every action given to [`before_exit`] and ends the program.
///
/// # Errors
/// When another handler is installed already.
pub fn handle() -> Result<()> {
    lock().get_or_insert_default();
    install(|| {
        let actions = lock().take().unwrap_or_default();
        actions.into_iter().for_each(|action| action());
        output::finish();
        std::process::exit(INTERRUPTED);
    })
}

/// From now on an interrupt, a termination signal and the end of the terminal are counted, and do nothing but call `handler` with
/// their count, from 1, on a thread of its own: for a program that needs time to end.
///
/// # Errors
/// When another handler is installed already.
pub fn watch(mut handler: impl FnMut(u32) + Send + 'static) -> Result<()> {
    install(move || handler(count()))
}

/// Counts an interrupt, for a program that has a handler of its own: the count, from 1.
pub fn count() -> u32 {
    COUNT.fetch_add(1, Ordering::Relaxed) + 1
}

#[cfg(not(windows))]
fn install(handler: impl FnMut() + Send + 'static) -> Result<()> {
    ctrlc::set_handler(handler).context("cannot handle interrupts")
}

/// Also of a console that is closed, of a user who logs off, and of a machine that is shut down.
#[cfg(windows)]
fn install(handler: impl FnMut() + Send + 'static) -> Result<()> {
    let handler = std::sync::Arc::new(Mutex::new(handler));
    let call = move || handler.lock().unwrap_or_else(PoisonError::into_inner)();
    ctrlc::set_handler(call.clone()).context("cannot handle interrupts")?;
    super::windows::when_closed(call)
}

/// From now on the first interrupt is noted: [`requested`] is true then, and the command ends normally. Another one ends the program.
///
/// # Errors
/// When another handler is installed already.
pub fn note() -> Result<()> {
    watch(|count| {
        if count > 1 {
            std::process::exit(INTERRUPTED);
        }
    })
}

/// As [`note`]; a command that has not ended after `limit` is terminated, with a remark: a disk may block for minutes.
///
/// # Errors
/// When another handler is installed already.
pub fn note_within(limit: Duration, remark: &'static str) -> Result<()> {
    watch(within(limit, remark))
}

/// The handler of [`note_within`].
pub fn within(limit: Duration, remark: &'static str) -> impl FnMut(u32) + Send + 'static {
    move |count| {
        if count == 1 {
            thread::spawn(move || {
                thread::sleep(limit);
                output::remark(remark);
                output::finish();
                std::process::exit(INTERRUPTED);
            });
        } else {
            std::process::exit(INTERRUPTED);
        }
    }
}

/// Whether an interrupt was [noted](note), or [handled](watch).
pub fn requested() -> bool {
    COUNT.load(Ordering::Relaxed) > 0
}

static COUNT: AtomicU32 = AtomicU32::new(0);

/// Adds an action that an interrupt runs. Does nothing if interrupts are not handled.
pub fn before_exit(action: impl FnOnce() + Send + 'static) {
    if let Some(actions) = lock().as_mut() {
        actions.push(Box::new(action));
    }
}

fn lock() -> std::sync::MutexGuard<'static, Option<Vec<Action>>> {
    ACTIONS.lock().unwrap_or_else(PoisonError::into_inner)
}
