//! The signals that end a command: Ctrl-C (SIGINT), SIGTERM, and SIGHUP, which a terminal sends when it is closed. The first
//! one requests an orderly end, the second one ends the program at once, with a message about the remaining work.
//!
//! SIGHUP is never a second signal: a closed terminal may send it twice, and a service manager may send it with SIGTERM.

use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::mpsc::channel;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, Result};

use crate::output;

type Action = Box<dyn FnOnce() + Send>;

static ACTIONS: Mutex<Vec<Action>> = Mutex::new(Vec::new());

/// The line that [`end_at_once`] prints: the completed work, the unknown outcomes, and the work that the machine still has.
static ACCOUNT: Mutex<String> = Mutex::new(String::new());

/// Whether a thread ends the program at once.
static ENDS: AtomicBool = AtomicBool::new(false);

/// The number of signals, and the time of the first.
static COUNT: AtomicU32 = AtomicU32::new(0);
static FIRST: Mutex<Option<Instant>> = Mutex::new(None);

/// The exit status that shells use for a program that was interrupted.
pub const INTERRUPTED: i32 = 130;

/// Signals so soon after the first belong to it: `timeout` sends its signal twice.
const REPEAT_WINDOW: Duration = Duration::from_millis(20);

/// The longest wait for the reply to a request in flight.
const REPLY_WITHIN: Duration = Duration::from_secs(5);

/// The longest wait for a terminal or a pipe to accept the last line.
const LAST_LINE: Duration = Duration::from_secs(2);

/// The effect of the signals that end a command.
#[allow(missing_debug_implementations, reason = "it holds a closure")]
pub enum Policy {
    /// A signal ends the program, after every action given to [`before_exit`]. If there is an [`account`], it is printed.
    End,
    /// As [`End`](Self::End); the first signal waits, five seconds at most, while there is an [`account`]: for a program
    /// whose request is in flight.
    EndAfterReply,
    /// The first signal is noted: [`requested`] is true then, and the command ends normally. Another one ends the program.
    Note,
    /// As [`Note`](Self::Note); a command that has not ended after this time is terminated, with the remark: a disk may
    /// block for minutes.
    NoteWithin(Duration, &'static str),
    /// Each signal only calls this with its count, from 1, on a thread of its own.
    Call(Box<dyn FnMut(u32) + Send>),
}

/// Sets the effect of signals from now on.
///
/// # Errors
/// If the system has no room for a thread.
pub fn on_interrupt(policy: Policy) -> Result<()> {
    install(policy.handler())
}

impl Policy {
    /// Returns the function to call with the count of each signal, for a program that has a handler of its own.
    pub fn handler(self) -> Box<dyn FnMut(u32) + Send> {
        let mut first: Box<dyn FnMut() + Send> = match self {
            Self::End => {
                return Box::new(|_| {
                    let is_silent = lock(&ACCOUNT).is_empty();
                    if is_silent {
                        exit();
                    }
                    end_at_once("interrupted");
                });
            }
            Self::Call(handler) => return handler,
            Self::EndAfterReply => Box::new(|| drop(thread::spawn(end_after_reply))),
            Self::Note => Box::new(|| {}),
            Self::NoteWithin(limit, remark) => Box::new(move || {
                thread::spawn(move || {
                    thread::sleep(limit);
                    end_at_once(remark);
                });
            }),
        };
        Box::new(move |count| {
            if count > 1 {
                end_at_once("a second signal ended the program");
            }
            first();
        })
    }
}

fn end_after_reply() {
    let (end, is_busy) = (Instant::now() + REPLY_WITHIN, || !lock(&ACCOUNT).is_empty());
    if is_busy() {
        while is_busy() && Instant::now() < end {
            thread::sleep(REPEAT_WINDOW);
        }
        // The program may end by itself, and report the requests that it has not sent.
        thread::sleep(5 * REPEAT_WINDOW);
    }
    end_at_once("interrupted");
}

/// Returns whether there was a signal.
pub fn requested() -> bool {
    COUNT.load(Ordering::Relaxed) > 0
}

/// Counts a signal, for a program that has a handler of its own: the count, from 1. `None` if the signal belongs to an
/// earlier one.
pub fn count(is_hangup: bool) -> Option<u32> {
    let mut first = lock(&FIRST);
    if first.is_some_and(|first| is_hangup || first.elapsed() < REPEAT_WINDOW) {
        return None;
    }
    first.get_or_insert_with(Instant::now);
    Some(COUNT.fetch_add(1, Ordering::Relaxed) + 1)
}

/// Adds an action that runs before a signal ends the program.
pub fn before_exit(action: impl FnOnce() + Send + 'static) {
    lock(&ACTIONS).push(Box::new(action));
}

/// Sets the line that follows if the program must end at once.
pub fn account(text: String) {
    *lock(&ACCOUNT) = text;
}

/// Ends the program, and prints why, and the [`account`]. A terminal that accepts nothing delays the end by two seconds at most.
pub fn end_at_once(why: &str) -> ! {
    // Only one thread ends the program.
    while ENDS.swap(true, Ordering::Relaxed) {
        thread::park();
    }
    let account = core::mem::take(&mut *lock(&ACCOUNT));
    let line = if account.is_empty() { why.to_owned() } else { format!("{why}: {account}") };
    let (done, wait) = channel();
    thread::spawn(move || {
        output::remark(&line);
        let _ = done.send(());
    });
    let _ = wait.recv_timeout(LAST_LINE);
    exit()
}

fn exit() -> ! {
    let actions = core::mem::take(&mut *lock(&ACTIONS));
    actions.into_iter().for_each(|action| action());
    output::finish();
    std::process::exit(INTERRUPTED)
}

/// Installs the handler. A SIGHUP that is ignored from the start stays ignored: `nohup` means that the terminal may close.
#[cfg(unix)]
fn install(mut handler: impl FnMut(u32) + Send + 'static) -> Result<()> {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
    use signal_hook::iterator::Signals;

    let hangup = (!is_ignored(SIGHUP)).then_some(SIGHUP);
    let mut signals =
        Signals::new([SIGINT, SIGTERM].into_iter().chain(hangup)).context("cannot handle signals")?;
    let run = move || {
        for signal in signals.forever() {
            if let Some(count) = count(signal == SIGHUP) {
                handler(count);
            }
        }
    };
    thread::Builder::new().name("signals".into()).spawn(run).context("cannot handle signals")?;
    Ok(())
}

/// Returns whether the process ignores a signal; false if the system does not report it.
#[cfg(unix)]
fn is_ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok())
        .is_some_and(|mask| mask >> (signal - 1) & 1 == 1)
}

/// Installs a handler, also for a closed console, a user who logs off, and a shutdown of the computer.
#[cfg(windows)]
fn install(mut handler: impl FnMut(u32) + Send + 'static) -> Result<()> {
    let handler = std::sync::Arc::new(Mutex::new(move || {
        if let Some(count) = count(false) {
            handler(count);
        }
    }));
    let call = move || lock(&handler)();
    ctrlc::set_handler(call.clone()).context("cannot handle interrupts")?;
    super::windows::when_closed(call)
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use std::env;
    use std::process::Command;

    use super::*;

    /// The test runs itself again, as the program that a signal ends.
    #[test]
    fn a_signal_ends_the_program_after_its_last_actions() {
        const NAME: &str = "interrupt::tests::a_signal_ends_the_program_after_its_last_actions";
        if env::var_os(NAME).is_some() {
            before_exit(|| output::remark("the link is removed"));
            Policy::End.handler()(1);
            return;
        }
        let mut program = Command::new(env::current_exe().unwrap());
        let ended = program.args([NAME, "--exact", "--nocapture"]).env(NAME, "").output().unwrap();
        assert_eq!(ended.status.code(), Some(INTERRUPTED));
        assert_eq!(String::from_utf8(ended.stderr).unwrap(), "the link is removed\n");
    }
}
