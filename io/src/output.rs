//! The output of the tool: lines of JSON, or for people at a terminal, on standard output; remarks on standard error.

use core::fmt::Display;
use std::io::{self, ErrorKind, IsTerminal as _, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Sender;
use std::sync::{Mutex, OnceLock, PoisonError};

use anyhow::{Context as _, Result};
use serde_json::{Value, json};
use terminal_size::{Height, Width};

#[cfg(feature = "progress")]
use crate::bar::beside_bar;
use crate::limiter::Limiter;
use crate::outlet::Outlet;
use crate::plain;
use cellwire_links::json;
use robot_session::now;

/// Returns whether an error is that standard output is closed.
pub fn is_closed(error: &anyhow::Error) -> bool {
    let is_broken = |error: &io::Error| error.kind() == ErrorKind::BrokenPipe;
    error.chain().any(|cause| cause.downcast_ref().is_some_and(is_broken))
}

/// Standard output does not accept the output: it is closed, or its disk is full.
#[derive(Debug, thiserror::Error)]
#[error("cannot write to standard output")]
pub struct OutputFailed;

/// An error of standard output, as one of [`stdout()`] has it.
#[derive(Debug, thiserror::Error)]
#[error("cannot write to standard output: {0}")]
struct StdoutError(io::Error);

/// Returns whether standard output did not accept the output.
pub fn is_unwritten(error: &anyhow::Error) -> bool {
    let is_refused = |error: &io::Error| error.get_ref().is_some_and(|inner| inner.is::<StdoutError>());
    error.is::<OutputFailed>() || error.chain().any(|cause| cause.downcast_ref().is_some_and(is_refused))
}

/// Returns standard output for a text or a table: its errors name standard output.
pub fn stdout() -> impl Write {
    struct SharedStdout(io::Stdout);

    impl Write for SharedStdout {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.0.write(bytes).map_err(refused)
        }

        fn flush(&mut self) -> io::Result<()> {
            self.0.flush().map_err(refused)
        }
    }

    fn refused(error: io::Error) -> io::Error {
        io::Error::new(error.kind(), StdoutError(error))
    }

    SharedStdout(io::stdout())
}

/// Standard output and error, once writes never wait.
static OUTLETS: OnceLock<[Outlet; 2]> = OnceLock::new();

/// Makes writes to standard output and error non-blocking from now on: for a simulator, whose peers must not wait for a slow
/// reader. Up to 1 MiB waits for a reader; further lines are dropped, and a line in their place gives their number.
///
/// # Errors
/// When the system has no room for a thread.
pub fn never_wait() -> Result<()> {
    let out =
        Outlet::start(io::stdout(), |lines| format!("{{\"event\":\"lines_dropped\",\"lines\":{lines}}}\n"))?;
    let error = Outlet::start(io::stderr(), |lines| {
        format!("warning: {lines} lines were dropped: the reader is too slow\n")
    })?;
    OUTLETS.get_or_init(|| [out, error]);
    Ok(())
}

/// Called before the program ends: prints the counts of omitted lines, and waits a second at most until all lines are written.
pub fn finish() {
    let _ = log_left_out();
    settle();
}

/// Waits a second at most until all lines so far are written, so that a screen does not appear under them.
pub fn settle() {
    OUTLETS.get().into_iter().flatten().for_each(|outlet| drop(outlet.finish()));
}

/// The form in which a command prints events.
#[derive(Debug, Clone, Copy, clap::Args)]
pub struct EventArgs {
    /// Lines of JSON at a terminal too, as always in a pipe
    #[arg(long)]
    json: bool,
}

/// Whether [`log()`] prints lines for people.
static IS_FOR_PEOPLE: AtomicBool = AtomicBool::new(false);

impl EventArgs {
    /// Makes [`log()`]print lines for people from now on if standard output is a terminal, otherwise JSON.
    pub fn choose(self) {
        IS_FOR_PEOPLE.store(!self.json && io::stdout().is_terminal(), Ordering::Relaxed);
    }
}

/// Returns whether [`log()`] prints lines for people.
pub fn is_for_people() -> bool {
    IS_FOR_PEOPLE.load(Ordering::Relaxed)
}

/// Whether [`log()`] and [`notice`] print nothing.
static IS_QUIET: AtomicBool = AtomicBool::new(false);

/// Silences [`log()`] and [`notice`] from now on; [`announce`] still prints.
pub fn be_quiet() {
    IS_QUIET.store(true, Ordering::Relaxed);
}

fn is_quiet() -> bool {
    IS_QUIET.load(Ordering::Relaxed)
}

/// The lines that [`admits`] has counted.
static LIMITER: Mutex<Limiter> = Mutex::new(Limiter::NEW);

/// Returns whether a line of this kind is to be printed: ten a second are. The next line that is printed is preceded by the
/// number of the others.
pub fn admits(kind: &str) -> bool {
    LIMITER.lock().unwrap_or_else(PoisonError::into_inner).admits(now(), kind)
}

/// Logs as [`log()`] does an event that a peer can cause at any rate, such as corrupt bytes: at most ten of a kind are
/// printed per second. An outcome is not such an event.
///
/// # Errors
/// When standard output is closed.
pub fn notice(event: &Value) -> Result<()> {
    let kind = event.get("event").and_then(Value::as_str).unwrap_or_default();
    if admits(kind) { log(event) } else { Ok(()) }
}

/// Prints one line and flushes it, so that a script can read it while the tool runs: of JSON, or for people.
///
/// # Errors
/// When standard output is closed.
pub fn log(line: &Value) -> Result<()> {
    if is_quiet() {
        return Ok(());
    }
    log_left_out()?;
    put(line)
}

fn log_left_out() -> Result<()> {
    if is_quiet() {
        return Ok(());
    }
    let mut limiter = LIMITER.lock().unwrap_or_else(PoisonError::into_inner);
    let mut lines =
        limiter.take_left_out().map(|(of, count)| json!({"event": "left_out", "of": of, "count": count}));
    lines.try_for_each(|line| put(&line))
}

#[cfg(not(feature = "progress"))]
fn beside_bar<T>(write: impl FnOnce() -> T) -> T {
    write()
}

/// Returns the number of columns of the terminal.
fn width() -> usize {
    columns(terminal_size::terminal_size())
}

fn columns(size: Option<(Width, Height)>) -> usize {
    const USUAL: u16 = 80;
    let columns = size.map_or(0, |(Width(columns), _)| columns);
    usize::from(if columns == 0 { USUAL } else { columns })
}

/// Returns the number of columns of the terminal at standard output; `None` if it is not a terminal, as in a pipe.
pub fn terminal_columns() -> Option<usize> {
    let out = io::stdout();
    out.is_terminal().then(|| columns(terminal_size::terminal_size_of(&out)))
}

/// Returns a message in a form for people, on one line.
pub fn message(message: &Value) -> String {
    printable(&plain::message(message))
}

fn put(line: &Value) -> Result<()> {
    let mut bytes = Vec::new();
    if is_for_people() {
        bytes.extend(printable(&plain::line(line, width())).bytes());
    } else {
        json::write(line, &mut bytes)?;
    }
    bytes.push(b'\n');
    if let Some([out, _]) = OUTLETS.get() {
        return out.put(&bytes).context(OutputFailed);
    }
    let mut out = io::stdout().lock();
    beside_bar(|| out.write_all(&bytes).and_then(|()| out.flush())).context(OutputFailed)
}

/// Prints the line that reports a device as ready, and its endpoint: `{"ready":"kawasaki-pc","listen":"127.0.0.1:9105"}`.
///
/// # Errors
/// When standard output is closed.
pub fn ready(device: &str, kind: &str, place: &str) -> Result<()> {
    announce(&json!({"ready": device, kind: place}))
}

/// Prints a line that others wait for, and waits until it is written; a reader that accepts nothing delays this by a second.
///
/// # Errors
/// When standard output does not accept it.
pub fn announce(line: &Value) -> Result<()> {
    put(line)?;
    match OUTLETS.get() {
        Some([out, _]) => out.finish().context(OutputFailed),
        None => Ok(()),
    }
}

/// The destination of remarks while a screen covers standard error.
static SCREEN: Mutex<Option<Sender<String>>> = Mutex::new(None);

/// Directs remarks to the screen from now on; `None`: to standard error again.
pub fn show_remarks(screen: Option<Sender<String>>) {
    *SCREEN.lock().unwrap_or_else(PoisonError::into_inner) = screen;
}

/// Prints a remark on standard error, or on the screen that covers it, with control characters escaped. If the output is
/// closed, the remark is dropped.
pub fn remark(text: &str) {
    let mut line = printable(text);
    if let Some(screen) = &*SCREEN.lock().unwrap_or_else(PoisonError::into_inner)
        && screen.send(line.clone()).is_ok()
    {
        return;
    }
    line.push('\n');
    if let Some([_, error]) = OUTLETS.get() {
        let _ = error.put(line.as_bytes());
        return;
    }
    beside_bar(|| {
        let _ = io::stderr().lock().write_all(line.as_bytes());
    });
}

/// Returns a number with its noun: `1 file`, `2 files`.
pub fn counted<N: Display + PartialEq + From<u8>>(number: N, what: &str) -> String {
    let plural = if number == N::from(1) { "" } else { "s" };
    format!("{number} {what}{plural}")
}

/// Returns a text in lines of at most this many columns, each indented by `indent` spaces. A longer word has a line of its
/// own.
pub fn wrapped(text: &str, width: usize, indent: usize) -> String {
    let (mut lines, mut line) = (String::new(), String::new());
    for word in text.split(' ') {
        if !line.is_empty() && indent + line.chars().count() + 1 + word.chars().count() > width {
            lines += &format!("{:indent$}{line}\n", "");
            line.clear();
        }
        if !line.is_empty() {
            line.push(' ');
        }
        line.push_str(word);
    }
    lines + &format!("{:indent$}{line}\n", "")
}

/// Returns a word of a command line, in the quotes of a POSIX shell if it needs them.
pub fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_=./,:+@%".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        return word.into();
    }
    format!("'{}'", word.replace('\'', "'\\''"))
}

/// Returns a text with its control characters escaped, except line ends and tabs, so that it cannot control a terminal.
pub fn printable(text: &str) -> String {
    let mut line = String::with_capacity(text.len() + 1);
    for c in text.chars() {
        if c.is_control() && c != '\n' && c != '\t' {
            line.extend(c.escape_unicode());
        } else {
            line.push(c);
        }
    }
    line
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_control_character_leaves_as_one() {
        let mut out = Vec::new();
        json::write(&json!({"a": "x\u{1b}[2J\u{7f}\u{9b}1mä\n\"y"}), &mut out).unwrap();
        assert_eq!(String::from_utf8(out.clone()).unwrap(), r#"{"a":"x\u001b[2J\u007f\u009b1mä\n\"y"}"#);
        let back: Value = serde_json::from_slice(&out).unwrap();
        assert_eq!(back["a"], "x\u{1b}[2J\u{7f}\u{9b}1mä\n\"y");
    }

    #[test]
    fn lines_are_indented_and_at_most_as_wide_as_they_may_be() {
        for (text, expected) in [
            ("aaa bbbb", "  aaa bbbb\n"),
            ("aaa bbbbb", "  aaa\n  bbbbb\n"),
            ("aaa bb c d", "  aaa bb c\n  d\n"),
            ("a bbbbbbbbbbbbb c", "  a\n  bbbbbbbbbbbbb\n  c\n"),
            ("ääää öö ü", "  ääää öö\n  ü\n"),
            ("", "  \n"),
        ] {
            assert_eq!(wrapped(text, 10, 2), expected);
        }
    }
}
