//! The last bytes that a session sent and received, with their times, written to a file when it ends.

use std::collections::VecDeque;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError, TryLockError};
use std::time::Duration;

use anyhow::{Context, Result};

use crate::output::remark;
use crate::{files, interrupt};

/// How many bytes of each direction the source keeps: "jeweils die letzten 1000 gesendeten und empfangenen Bytes" (VAL II
/// thesis, §9.1).
pub const DEFAULT_BYTES: usize = 1000;

/// Bytes of one direction closer together than this are printed on one line.
const GAP: Duration = Duration::from_millis(2);
/// With 16 bytes, a line and its time fit a terminal of 80 columns.
const BYTES_A_LINE: usize = 16;

/// `--trace`: whether bytes are kept, how many, and where they are written.
#[derive(Debug, Clone, clap::Args)]
pub struct TraceArgs {
    /// Keep the last N bytes (1000) of each direction with their times, and write them to a file when a session ends or is
    /// interrupted
    #[arg(long, value_name = "N", num_args = 0..=1, default_missing_value = "1000", value_parser = clap::value_parser!(u32).range(1..=10_000_000))]
    trace: Option<u32>,
    /// The folder of the trace files
    #[arg(long, value_name = "DIR", default_value = ".", value_parser = folder)]
    trace_dir: PathBuf,
}

impl TraceArgs {
    /// Starts a trace of the line called `name`. The trace records nothing without `--trace`.
    pub fn start(&self, name: &str) -> Trace {
        let trace = Trace::new(name, self.trace.map_or(0, |bytes| bytes as usize), Some(&self.trace_dir));
        let kept = trace.clone();
        interrupt::before_exit(move || kept.end_session("interrupted"));
        trace
    }

    /// Starts a trace that can be shown while it runs. The trace writes files only with `--trace`.
    pub fn start_kept(&self, name: &str) -> Trace {
        match self.trace {
            Some(_) => self.start(name),
            None => Trace::new(name, DEFAULT_BYTES, None),
        }
    }

    /// Returns options for traces of the last `bytes` bytes in each direction.
    pub fn keep(bytes: u32, dir: &Path) -> Self {
        Self { trace: Some(bytes), trace_dir: dir.to_owned() }
    }

    /// Returns options without traces.
    pub fn off() -> Self {
        Self { trace: None, trace_dir: PathBuf::from(".") }
    }
}

fn folder(path: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(path);
    if path.is_dir() { Ok(path) } else { Err("there is no such folder".into()) }
}

/// The direction of a byte, seen from the end that keeps the trace.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TraceDirection {
    /// The bytes that this end sent.
    Sent,
    /// The bytes that this end received.
    Received,
}

/// Keeps the last bytes of each direction. Clones share them.
///
/// The text of a trace is input for `cellwire decode`: hex with comments, which name the direction.
#[derive(Debug, Clone)]
pub struct Trace {
    name: String,
    dir: Option<PathBuf>,
    bytes: usize,
    kept: Arc<Mutex<RecentBytes>>,
}

#[derive(Debug, Default)]
struct RecentBytes {
    sent: VecDeque<Byte>,
    received: VecDeque<Byte>,
    /// The number of times that bytes were added.
    turn: u64,
}

/// A byte with its time and its turn, which gives the sequence of equal times: a request is before its answer.
#[derive(Debug, Clone, Copy)]
struct Byte {
    at: Duration,
    turn: u64,
    byte: u8,
}

impl RecentBytes {
    fn add(&mut self, now: Duration, direction: TraceDirection, bytes: &[u8], most: usize) {
        let ring = match direction {
            TraceDirection::Sent => &mut self.sent,
            TraceDirection::Received => &mut self.received,
        };
        let turn = self.turn;
        self.turn += 1;
        ring.extend(bytes.iter().map(|&byte| Byte { at: now, turn, byte }));
        let surplus = ring.len().saturating_sub(most);
        ring.drain(..surplus);
    }
}

impl Trace {
    /// Creates a trace of `bytes` bytes in each direction. With 0 the trace records nothing; without a folder it writes no
    /// files.
    pub fn new(name: &str, bytes: usize, dir: Option<&Path>) -> Self {
        Self { name: name.into(), dir: dir.map(Path::to_owned), bytes, kept: Arc::default() }
    }

    /// Adds bytes of one direction.
    pub fn add(&self, now: Duration, direction: TraceDirection, bytes: &[u8]) {
        if self.bytes > 0 {
            self.kept.lock().unwrap_or_else(PoisonError::into_inner).add(now, direction, bytes, self.bytes);
        }
    }

    /// Adds bytes for a caller that cannot wait: returns false, and adds nothing, while the trace is being read.
    pub fn try_add(&self, now: Duration, direction: TraceDirection, bytes: &[u8]) -> bool {
        if self.bytes == 0 {
            return true;
        }
        let mut kept = match self.kept.try_lock() {
            Ok(kept) => kept,
            Err(TryLockError::Poisoned(poisoned)) => poisoned.into_inner(),
            Err(TryLockError::WouldBlock) => return false,
        };
        kept.add(now, direction, bytes, self.bytes);
        true
    }

    /// Writes the kept bytes to a new file, whose name no earlier trace has, clears the trace, and returns the path. `None`
    /// when there is nothing to write.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn session_ended(&self, why: &str) -> Result<Option<PathBuf>> {
        let Some(dir) = &self.dir else { return Ok(None) };
        let (sent, received) = {
            let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
            if kept.sent.is_empty() && kept.received.is_empty() {
                return Ok(None);
            }
            (std::mem::take(&mut kept.sent), std::mem::take(&mut kept.received))
        };
        let mut text = Vec::new();
        writeln!(text, "# {}: {why}", self.name)?;
        write_lines(&mut text, &sent, &received)?;
        // Traces of earlier runs are unchanged: the next free number is taken.
        let (mut file, path) = files::create_new(&dir.join(format!("{}.trace", self.name)))?;
        if let Err(error) = file.write_all(&text) {
            // A part of a trace would be taken for the whole.
            let _ = std::fs::remove_file(&path);
            return Err(error).with_context(|| format!("cannot write the trace {}", path.display()));
        }
        Ok(Some(path))
    }

    /// Finishes the trace as [`session_ended`](Self::session_ended) does; an error is a warning on standard error, and the
    /// tool continues.
    pub fn finish(&self, why: &str) -> Option<PathBuf> {
        self.session_ended(why).unwrap_or_else(|error| {
            remark(&format!("warning: {error:#}"));
            None
        })
    }

    /// Finishes the trace as [`finish`](Self::finish) does, and prints the path on standard error.
    pub fn end_session(&self, why: &str) {
        if let Some(path) = self.finish(why) {
            remark(&format!("trace: {}", path.display()));
        }
    }

    /// Returns the recorded bytes as lines of text, the oldest first.
    pub fn lines(&self) -> Vec<String> {
        let (sent, received) = {
            let kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
            (kept.sent.clone(), kept.received.clone())
        };
        let mut text = Vec::new();
        // Writing to memory cannot fail.
        let _ = write_lines(&mut text, &sent, &received);
        String::from_utf8_lossy(&text).lines().map(str::to_owned).collect()
    }
}

fn write_lines(out: &mut impl Write, sent: &VecDeque<Byte>, received: &VecDeque<Byte>) -> io::Result<()> {
    let sent = sent.iter().map(|byte| (TraceDirection::Sent, *byte));
    let mut bytes: Vec<(TraceDirection, Byte)> =
        sent.chain(received.iter().map(|byte| (TraceDirection::Received, *byte))).collect();
    bytes.sort_by_key(|(_, byte)| (byte.at, byte.turn));
    let together =
        |a: &(TraceDirection, Byte), b: &(TraceDirection, Byte)| a.0 == b.0 && b.1.at - a.1.at < GAP;
    for run in bytes.chunk_by(together) {
        for line in run.chunks(BYTES_A_LINE) {
            for (_, Byte { byte, .. }) in line {
                write!(out, "{byte:02X} ")?;
            }
            if let Some((direction, Byte { at, .. })) = line.first() {
                let direction = match direction {
                    TraceDirection::Sent => "sent",
                    TraceDirection::Received => "received",
                };
                writeln!(out, "# {:.6} s {direction}", at.as_secs_f64())?;
            }
        }
    }
    Ok(())
}

/// Parses the name in the first line of a trace's file.
pub fn parse_name(line: &str) -> Option<&str> {
    line.strip_prefix("# ")?.split_once(": ").map(|(name, _)| name)
}

/// Parses a line of a trace: the time of its first byte, its direction, and its bytes.
pub fn parse_line(line: &str) -> Option<(f64, TraceDirection, Vec<u8>)> {
    let (hex, comment) = line.split_once('#')?;
    let (at, direction) = comment.trim().split_once(" s ")?;
    let direction = match direction {
        "sent" => TraceDirection::Sent,
        "received" => TraceDirection::Received,
        _ => return None,
    };
    let byte = |digits: &str| u8::from_str_radix(digits, 16).ok().filter(|_| digits.len() == 2);
    let bytes = hex.split_ascii_whitespace().map(byte).collect::<Option<Vec<u8>>>()?;
    Some((at.parse().ok()?, direction, bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Duration = Duration::from_millis(1);

    #[test]
    fn what_has_the_same_time_keeps_its_order() {
        let trace = Trace::new("server", 8, None);
        for (direction, byte) in [
            (TraceDirection::Received, 1),
            (TraceDirection::Sent, 2),
            (TraceDirection::Received, 3),
            (TraceDirection::Sent, 4),
        ] {
            trace.add(MS, direction, &[byte]);
        }
        let lines = trace.lines();
        let bytes: Vec<&str> = lines.iter().map(|line| &line[..2]).collect();
        assert_eq!(bytes, ["01", "02", "03", "04"]);
    }

    #[test]
    fn the_last_bytes_of_each_direction_are_in_order() {
        let trace = Trace::new("x", 3, None);
        trace.add(MS, TraceDirection::Sent, &[1, 2]);
        trace.add(MS * 5, TraceDirection::Received, &[0xA0]);
        trace.add(MS * 6, TraceDirection::Sent, &[3, 4]);
        trace.add(MS * 20, TraceDirection::Received, &[0xA1]);
        trace.add(MS * 20 + GAP, TraceDirection::Received, &[0xA2]);
        assert_eq!(
            trace.lines(),
            [
                "02 # 0.001000 s sent",
                "A0 # 0.005000 s received",
                "03 04 # 0.006000 s sent",
                "A1 # 0.020000 s received",
                "A2 # 0.022000 s received"
            ]
        );
    }

    #[test]
    fn each_session_that_ends_writes_a_file() {
        let dir = std::env::temp_dir().join(format!("cellwire-trace-{}", std::process::id()));
        std::fs::create_dir_all(&dir).unwrap();
        let trace = Trace::new("robot", DEFAULT_BYTES, Some(&dir));
        assert_eq!(trace.session_ended("nothing").unwrap(), None);
        trace.add(MS, TraceDirection::Sent, &[0x10]);
        trace.session_ended("a timeout").unwrap().unwrap();
        trace.add(MS, TraceDirection::Received, &[0x11]);
        let second = trace.session_ended("the end").unwrap().unwrap();
        assert_eq!(second, dir.join("robot-2.trace"));
        let again = Trace::new("robot", DEFAULT_BYTES, Some(&dir));
        again.add(MS, TraceDirection::Sent, &[0x12]);
        assert_eq!(again.session_ended("another run").unwrap().unwrap(), dir.join("robot-3.trace"));
        let text = std::fs::read_to_string(second).unwrap();
        assert_eq!(text, "# robot: the end\n11 # 0.001000 s received\n");
        std::fs::remove_dir_all(dir).unwrap();
    }

    #[test]
    fn a_trace_that_is_off_keeps_nothing() {
        let trace = TraceArgs::off().start("x");
        trace.add(MS, TraceDirection::Sent, &[1]);
        assert_eq!(trace.lines(), [""; 0]);
    }
}
