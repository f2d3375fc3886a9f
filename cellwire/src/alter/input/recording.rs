//! A recording of an input: a line for each event, with its time since ALTER began to run.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;
use std::sync::mpsc::{Sender, channel};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use anyhow::{Context as _, Result, anyhow, bail, ensure};

use super::device::{Input, InputEvent};
use crate::alter::context::Context;
use crate::alter::sample::Sample;
use cellwire_io::clock::Clock;
use cellwire_io::{files, input};

const HEADER: &str =
    "# time_us x y z rx ry rz buttons fresh_us: thousandths of full deflection; or time_us old, time_us lost";

/// An event and its time since ALTER began to run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RecordedEvent {
    /// The time of the values.
    pub at: Duration,
    /// Axes, buttons, and how long they may be used from `at` on; `Err(true)`: the device is gone, `Err(false)`: old values.
    pub values: Result<([i16; 6], u32, Duration), bool>,
}

impl RecordedEvent {
    fn line(&self) -> String {
        let at = self.at.as_micros();
        match self.values {
            Ok(([x, y, z, rx, ry, rz], buttons, fresh)) => {
                format!("{at} {x} {y} {z} {rx} {ry} {rz} {buttons} {}", fresh.as_micros())
            }
            Err(lost) => format!("{at} {}", if lost { "lost" } else { "old" }),
        }
    }
}

/// Writes a recording; the disk blocks nothing.
#[derive(Debug)]
pub(super) struct Recorder {
    clock: Clock,
    begin: Option<Duration>,
    lines: Sender<String>,
    writer: JoinHandle<Result<()>>,
}

impl Recorder {
    /// Creates a new file, and never overwrites an existing one.
    pub(super) fn create(path: &Path, clock: Clock) -> Result<Self> {
        let (file, path) = files::create_new(path)?;
        let (lines, to_write) = channel::<String>();
        let writer = thread::spawn(move || {
            let mut file = BufWriter::new(file);
            let failed = || format!("cannot write the recording {}", path.display());
            writeln!(file, "{HEADER}").with_context(failed)?;
            while let Ok(line) = to_write.recv() {
                writeln!(file, "{line}").with_context(failed)?;
            }
            flush(file).with_context(failed)
        });
        Ok(Self { clock, begin: None, lines, writer })
    }

    pub(super) fn add(&mut self, event: InputEvent) {
        let now = self.clock.now();
        let at = now - *self.begin.get_or_insert(now);
        let values = match event {
            InputEvent::Sample(Sample { axes, buttons, fresh_until }) => {
                Ok((axes, buttons, fresh_until.saturating_sub(now)))
            }
            InputEvent::Old => Err(false),
            InputEvent::Lost => Err(true),
        };
        // A writer that has ended has the error.
        let _ = self.lines.send(RecordedEvent { at, values }.line());
    }

    pub(super) fn finish(self) -> Result<()> {
        drop(self.lines);
        self.writer.join().map_err(|_| anyhow!("writing the recording failed"))?
    }
}

fn flush(file: BufWriter<File>) -> Result<()> {
    file.into_inner().map_err(|error| error.into_error())?.sync_all()?;
    Ok(())
}

/// Reads a recording.
///
/// # Errors
/// If a line is not one of a recording, with its number, or if the time decreases.
pub fn read(text: &str) -> Result<Vec<RecordedEvent>> {
    let mut events: Vec<RecordedEvent> = Vec::new();
    for (number, line) in (1..).zip(text.lines()).filter(|(_, line)| !line.starts_with('#')) {
        let event = parse(line).with_context(|| format!("line {number}"))?;
        let before = events.last().map_or(Duration::ZERO, |last| last.at);
        ensure!(event.at >= before, "line {number}: the time decreases");
        events.push(event);
    }
    ensure!(!events.is_empty(), "the recording is empty");
    Ok(events)
}

fn parse(line: &str) -> Result<RecordedEvent> {
    let fields: Vec<&str> = line.split_whitespace().collect();
    let time = |text: &str| {
        text.parse().map(Duration::from_micros).with_context(|| format!("`{text}` is not a time"))
    };
    match fields.as_slice() {
        [at, "old"] => Ok(RecordedEvent { at: time(at)?, values: Err(false) }),
        [at, "lost"] => Ok(RecordedEvent { at: time(at)?, values: Err(true) }),
        [at, axes @ .., buttons, fresh] if axes.len() == 6 => {
            let mut values = [0; 6];
            for (value, text) in values.iter_mut().zip(axes) {
                let axis: i16 = text.parse().with_context(|| format!("`{text}` is not an axis"))?;
                ensure!((-1100..=1100).contains(&axis), "{axis} is not in -1100..=1100");
                *value = axis;
            }
            let buttons = buttons.parse().with_context(|| format!("`{buttons}` is not a button mask"))?;
            Ok(RecordedEvent { at: time(at)?, values: Ok((values, buttons, time(fresh)?)) })
        }
        _ => bail!("expected nine numbers, or a time with `old` or `lost`"),
    }
}

/// Plays a recording, from the moment on at which ALTER runs.
pub(super) struct Playback {
    context: Context,
    events: std::vec::IntoIter<RecordedEvent>,
    next: Option<RecordedEvent>,
    begin: Option<Duration>,
}

impl Playback {
    pub(super) fn open(path: &Path, context: Context) -> Result<Self> {
        let read = || read(&input::text(path)?);
        let mut events = read().with_context(|| format!("cannot play {}", path.display()))?.into_iter();
        let next = events.next();
        Ok(Self { context, events, next, begin: None })
    }
}

impl Input for Playback {
    fn poll(&mut self, wait: Duration, events: &mut Vec<InputEvent>) {
        let now = self.context.clock.now();
        let (Some(next), true) = (self.next, self.begin.is_some() || self.context.runs()) else {
            // Before it begins, and after its end: no values.
            return thread::sleep(wait.min(Duration::from_millis(5)));
        };
        let at = *self.begin.get_or_insert(now) + next.at;
        if at > now {
            thread::sleep(wait.min(at - now));
        }
        let now = self.context.clock.now();
        if at > now {
            return;
        }
        events.push(match next.values {
            Ok((axes, buttons, fresh)) => {
                InputEvent::Sample(Sample { axes, buttons, fresh_until: at + fresh })
            }
            Err(false) => InputEvent::Old,
            Err(true) => InputEvent::Lost,
        });
        self.next = self.events.next();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_written_is_read() {
        let values = Ok(([1, -2, 3, -1000, 1000, 0], 5, Duration::from_micros(72_000)));
        let events = [
            RecordedEvent { at: Duration::ZERO, values },
            RecordedEvent { at: Duration::from_micros(28_001), values: Err(false) },
            RecordedEvent { at: Duration::from_micros(28_001), values: Err(true) },
        ];
        let text: Vec<String> = events.iter().map(RecordedEvent::line).collect();
        assert_eq!(text[0], "0 1 -2 3 -1000 1000 0 5 72000");
        assert_eq!(read(&format!("{HEADER}\n{}\n", text.join("\n"))).unwrap(), events);
    }

    #[test]
    fn what_is_no_recording_is_refused_with_its_line() {
        let error = |text: &str| format!("{:#}", read(text).unwrap_err());
        assert_eq!(error("# x\n"), "the recording is empty");
        assert_eq!(error("5 old\n4 old\n"), "line 2: the time decreases");
        assert_eq!(error("0 1 2 3 4 5 2000 0 9"), "line 1: 2000 is not in -1100..=1100");
        assert!(error("0 1 2 3").starts_with("line 1: expected"), "{}", error("0 1 2 3"));
        assert!(error("x old").starts_with("line 1: `x` is not a time"));
    }
}
