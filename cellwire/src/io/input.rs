//! What comes from the command line: times, and the input of a command.

use core::ops::RangeInclusive;
use std::fs::File;
use std::io::{self, BufRead, BufReader};
use std::path::Path;
use std::sync::mpsc::{self, Receiver, Sender};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Duration;

use anyhow::{Context, Result};

use crate::io::bell::Bell;
use crate::io::interrupt;

/// The parser of a time in seconds, within a range.
pub fn seconds(range: RangeInclusive<f64>) -> impl Fn(&str) -> Result<Duration, String> + Clone {
    move |text| {
        let seconds: f64 = text.parse().map_err(|_| format!("`{text}` is not a number of seconds"))?;
        if !range.contains(&seconds) {
            return Err(format!("give between {} and {} seconds", range.start(), range.end()));
        }
        Ok(Duration::from_secs_f64(seconds))
    }
}

/// A file, or standard input where none is named, or `-`.
///
/// # Errors
/// When the file cannot be read.
pub fn open(path: Option<&Path>) -> Result<Box<dyn BufRead>> {
    Ok(match path {
        Some(path) if path != Path::new("-") => {
            let file = File::open(path).with_context(|| format!("cannot read {}", path.display()))?;
            Box::new(BufReader::new(file))
        }
        _ => Box::new(BufReader::new(io::stdin())),
    })
}

/// The rows of a table, each with its line. Lines that begin with `#` are remarks.
pub fn rows(text: &str) -> impl Iterator<Item = Result<(u64, csv::StringRecord)>> {
    let mut reader = csv::ReaderBuilder::new();
    reader.has_headers(false).flexible(true).comment(Some(b'#')).trim(csv::Trim::All);
    // The reader counts CR LF one record late.
    let text = text.replace("\r\n", "\n") + "\n";
    let mut records = reader.from_reader(io::Cursor::new(text)).into_records();
    core::iter::from_fn(move || {
        let record = records.next()?.context("no table");
        // The line before the one that is read next: a record's own position is that of the remarks before it.
        let line = records.reader().position().line() - 1;
        Some(record.map(|record| (line, record)))
    })
}

/// The text of a file, without the mark that editors of Windows begin one with.
///
/// # Errors
/// When the file cannot be read, or is no UTF-8.
pub fn text(path: &Path) -> Result<String> {
    decode(path, bytes(path)?)
}

/// As [`text`], of a file that was read.
///
/// # Errors
/// When it is no UTF-8.
pub fn decode(path: &Path, bytes: Vec<u8>) -> Result<String> {
    let text = String::from_utf8(bytes).with_context(|| format!("cannot read {}", path.display()))?;
    Ok(text.strip_prefix('\u{feff}').map(str::to_owned).unwrap_or(text))
}

/// The bytes of a file.
///
/// # Errors
/// When the file cannot be read.
pub fn bytes(path: &Path) -> Result<Vec<u8>> {
    std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))
}

/// What is typed on standard input, line by line, until it ends. The bell is rung for each line, and at the end.
pub fn lines(bell: Bell) -> Receiver<String> {
    let (typed, lines) = Typed::new(bell);
    thread::spawn(move || typed.read());
    lines
}

/// As [`lines`]; the first interrupt is the line `stop`. Another one ends the program, as does the first after the end of the input.
///
/// # Errors
/// When interrupts have another handler already.
pub fn lines_or_stop(bell: Bell) -> Result<Receiver<String>> {
    let (typed, lines) = Typed::new(bell);
    let stop = typed.clone();
    interrupt::watch(move |count| {
        if count > 1 || !stop.take("stop".into()) {
            std::process::exit(interrupt::INTERRUPTED);
        }
    })?;
    thread::spawn(move || typed.read());
    Ok(lines)
}

/// Where lines go until standard input ends.
#[derive(Clone)]
struct Typed {
    lines: Arc<Mutex<Option<Sender<String>>>>,
    bell: Bell,
}

impl Typed {
    fn new(bell: Bell) -> (Self, Receiver<String>) {
        let (sender, lines) = mpsc::channel();
        (Self { lines: Arc::new(Mutex::new(Some(sender))), bell }, lines)
    }

    /// False when nobody takes it any more.
    fn take(&self, line: String) -> bool {
        let is_taken = self.lines().as_ref().is_some_and(|lines| lines.send(line).is_ok());
        self.bell.ring();
        is_taken
    }

    fn read(&self) {
        for line in io::stdin().lines() {
            let Ok(line) = line else { break };
            if !self.take(line) {
                break;
            }
        }
        *self.lines() = None;
        self.bell.ring();
    }

    fn lines(&self) -> MutexGuard<'_, Option<Sender<String>>> {
        self.lines.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
