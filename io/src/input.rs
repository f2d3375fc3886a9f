//! Inputs from the command line: times, and the standard input of a command.

use core::ops::RangeInclusive;
use std::fs::File;
use std::io::{self, BufRead, BufReader, IsTerminal as _, Read as _};
use std::path::Path;
use std::sync::mpsc::{self, Receiver};
use std::thread;
use std::time::Duration;

use anyhow::{Context, Result, anyhow, ensure};

use crate::bell::Bell;
use crate::interrupt::{Policy, on_interrupt};

/// Returns the parser for a time within a range, such as `5s` or `250ms`; `never` is the maximum of a range without an end.
pub fn time(range: RangeInclusive<Duration>) -> impl Fn(&str) -> Result<Duration, String> + Clone {
    move |text| {
        let time = match text {
            "0" => Ok(Duration::ZERO),
            "never" => Ok(Duration::MAX),
            _ => humantime::parse_duration(text),
        };
        let time = time.map_err(|_| "it is not a time with its unit, such as 250ms or 1.5s".to_owned())?;
        if range.contains(&time) {
            return Ok(time);
        }
        let show = |time: &Duration| humantime::format_duration(*time).to_string().replace(' ', "");
        let (least, most) = (show(range.start()), show(range.end()));
        Err(match *range.end() {
            Duration::MAX => format!("give {least} at least, or `never`"),
            _ => format!("give between {least} and {most}"),
        })
    }
}

/// Returns the extension of a file in lower case; empty for a file without an extension.
pub fn extension(path: &Path) -> String {
    path.extension().and_then(|it| it.to_str()).unwrap_or_default().to_ascii_lowercase()
}

/// Opens a file, or standard input if the path is missing or `-`.
///
/// # Errors
/// If the file cannot be read.
pub fn open(path: Option<&Path>) -> Result<Box<dyn BufRead>> {
    Ok(match path {
        Some(path) if path != Path::new("-") => {
            let file = File::open(path).with_context(|| format!("cannot read {}", path.display()))?;
            Box::new(BufReader::new(file))
        }
        _ => Box::new(BufReader::new(io::stdin())),
    })
}

/// Parses one line of JSON. Errors have the column alone: the caller counts the lines.
///
/// # Errors
/// If the line is not a value of this type.
pub fn json<T: serde::de::DeserializeOwned>(line: &str) -> Result<T> {
    serde_json::from_str(line).map_err(|error| {
        let (text, column) = (error.to_string(), error.column());
        match text.strip_suffix(&format!(" at line {} column {column}", error.line())) {
            Some(what) => anyhow!("column {column}: {what}"),
            None => error.into(),
        }
    })
}

/// Reads the text of a file, without the byte order mark that editors of Windows write.
///
/// # Errors
/// If the file cannot be read, or is not UTF-8.
pub fn text(path: &Path) -> Result<String> {
    decode(path, bytes(path)?)
}

/// Decodes as [`text`] does the bytes of a file that was read.
///
/// # Errors
/// If the text is not UTF-8.
pub fn decode(path: &Path, bytes: Vec<u8>) -> Result<String> {
    ensure!(
        !matches!(
            bytes.as_slice(),
            [0xFF, 0xFE, ..] | [0xFE, 0xFF, ..] | [0, _, 0, _, ..] | [_, 0, _, 0, ..]
        ),
        "{} is UTF-16: save it as UTF-8",
        path.display()
    );
    let text = String::from_utf8(bytes).with_context(|| format!("cannot read {}", path.display()))?;
    Ok(text.strip_prefix('\u{feff}').map(str::to_owned).unwrap_or(text))
}

/// Reads the bytes of a file.
///
/// # Errors
/// If the file cannot be read.
pub fn bytes(path: &Path) -> Result<Vec<u8>> {
    std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))
}

/// A line or a signal of an operator.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum OperatorInput {
    /// A line of standard input.
    Line(String),
    /// A stop is asked for: the first signal, or a terminal that was closed.
    Stop,
}

/// A longer line is read as several.
const MAX_LINE_LEN: u64 = 4096;

/// Reads the operator's input until the program ends; the bell is rung for each item. `None` is the end of standard input. A
/// first signal is [`OperatorInput::Stop`]. A second one ends the program, and so does a stop that has not ended the program
/// after `limit`.
///
/// # Errors
/// If the system has no room for a thread.
pub fn operator(bell: Bell, limit: Duration) -> Result<Receiver<Option<OperatorInput>>> {
    let (sender, typed) = mpsc::channel();
    // When the receiver is gone, the run is over.
    let put = move |what| {
        let _ = sender.send(what);
        bell.ring();
    };
    let stop = put.clone();
    let mut late = Policy::NoteWithin(limit, "the command did not stop in time, and was ended").handler();
    on_interrupt(Policy::Call(Box::new(move |count| {
        if count == 1 {
            stop(Some(OperatorInput::Stop));
        }
        late(count);
    })))?;
    thread::spawn(move || {
        let was_terminal = io::stdin().is_terminal();
        let (mut input, mut line) = (io::stdin().lock().take(0), Vec::new());
        loop {
            line.clear();
            input.set_limit(MAX_LINE_LEN);
            if !matches!(input.read_until(b'\n', &mut line), Ok(1..)) {
                break;
            }
            // A line that is not valid UTF-8 counts as empty.
            let text = String::from_utf8(core::mem::take(&mut line)).unwrap_or_default();
            put(Some(OperatorInput::Line(text.trim_end_matches(['\n', '\r']).to_owned())));
            // Nobody types faster. The pause prevents that a program's output fills the memory.
            thread::sleep(Duration::from_millis(5));
        }
        drop(input);
        // Without a session of its own the process gets no SIGHUP. After Ctrl-D the terminal is still there.
        if was_terminal && !io::stdin().is_terminal() {
            put(Some(OperatorInput::Stop));
        }
        put(None);
    });
    Ok(typed)
}
