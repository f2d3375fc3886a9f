//! The clients that run a piece of work on a machine, each part of it once; its operator, and what they type.

pub mod kawasaki;
pub mod laser;
pub mod mma;

use std::str::FromStr;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::Duration;

use anyhow::Result;
use robot_session::now;
use serde::Serialize;
use serde_json::{Value, json};

use crate::io::journal::Tally;
use cellwire_io::input::Typed;
use cellwire_io::output::{admits, remark};

/// After a signal, the longest wait for the machine to stop by itself.
pub const STOP_WITHIN: Duration = Duration::from_secs(30);
/// The longest wait after that, for a machine that was told to stop at once, and for whatever blocks.
pub const END_WITHIN: Duration = Duration::from_secs(5);

/// The longest wait for the end of a standard input that is not a keyboard.
pub const KEYBOARD_WITHIN: Duration = Duration::from_millis(200);
/// The advice of an event `unanswered`.
pub const UNANSWERED: &str = "nobody can answer, since standard input has ended: check the machine, then run the same command with --unknown done, --unknown repeat, or the number of the last that is done";

/// The answer of the command line for parts that an earlier run has left unknown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Answer {
    /// All are done.
    Done,
    /// None is done.
    Repeat,
    /// The parts up to this number, counted from 1, are done.
    Last(usize),
}

impl Answer {
    /// Returns how many of `count` unknown parts, the first of which has the index `first`, are done; `None` for a number that is neither
    /// one of them nor the one before them.
    pub fn done(self, first: usize, count: usize) -> Option<usize> {
        match self {
            Self::Done => Some(count),
            Self::Repeat => Some(0),
            Self::Last(last) => last.checked_sub(first).filter(|done| *done <= count),
        }
    }
}

impl FromStr for Answer {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match (text, text.parse()) {
            ("done", _) => Ok(Self::Done),
            ("repeat", _) => Ok(Self::Repeat),
            (_, Ok(last)) => Ok(Self::Last(last)),
            _ => Err("give done, repeat, or the number of the last part that is done".into()),
        }
    }
}

/// The operator of a run, and where the run is reported.
#[allow(missing_debug_implementations, reason = "it has closures")]
pub struct Operator<'a> {
    typed: Receiver<Option<Typed>>,
    notify: &'a mut dyn FnMut(Value) -> Result<()>,
    progress: &'a mut dyn FnMut(Tally),
    /// A line or stop that has been received and not returned.
    pending: Option<Typed>,
    /// Whether nobody types any more.
    is_absent: bool,
    /// When the stop of a signal was asked for.
    stop_at: Option<Duration>,
    /// Whether a report could not be written: reports are dropped since then.
    is_deaf: bool,
    /// Whether the stop because of that is still to be returned by [`next`](Self::next).
    stops: bool,
}

impl<'a> Operator<'a> {
    /// An operator who does what `typed` receives. `notify` prints an event, `progress` shows how much of the work is done.
    pub fn new(
        typed: Receiver<Option<Typed>>,
        notify: &'a mut dyn FnMut(Value) -> Result<()>,
        progress: &'a mut dyn FnMut(Tally),
    ) -> Self {
        let (pending, is_absent, stop_at, is_deaf, stops) = (None, false, None, false, false);
        Self { typed, notify, progress, pending, is_absent, stop_at, is_deaf, stops }
    }

    /// The next line or stop of the operator, within `wait`; without one, however long that takes. `None` if there is none, and when
    /// nobody types any more.
    pub fn next(&mut self, wait: Option<Duration>) -> Option<Typed> {
        if core::mem::take(&mut self.stops) {
            return Some(self.stop());
        }
        if let Some(typed) = self.pending.take() {
            return Some(typed);
        }
        let typed = match wait {
            None if self.is_absent => return None,
            None => self.typed.recv().map_err(|_| RecvTimeoutError::Disconnected),
            Some(wait) => self.typed.recv_timeout(wait),
        };
        match typed {
            Ok(Some(Typed::Line(line))) => Some(Typed::Line(line)),
            Ok(Some(Typed::Stop)) => Some(self.stop()),
            Ok(None) | Err(RecvTimeoutError::Disconnected) => {
                self.is_absent = true;
                None
            }
            Err(RecvTimeoutError::Timeout) => None,
        }
    }

    fn stop(&mut self) -> Typed {
        self.stop_at.get_or_insert_with(now);
        Typed::Stop
    }

    /// Returns whether standard input has ended, or ends within this time, without a line or a stop before that.
    pub fn is_without_keyboard(&mut self, wait: Duration) -> bool {
        if self.pending.is_none() {
            self.pending = self.next(Some(wait));
        }
        self.pending.is_none() && self.is_absent
    }

    /// Whether nobody types any more.
    pub fn is_absent(&self) -> bool {
        self.is_absent
    }

    /// Whether the stop of a signal has taken this long.
    pub fn has_waited(&self, limit: Duration) -> bool {
        self.stop_at.is_some_and(|at| now() >= at.saturating_add(limit))
    }

    /// When the stop of a signal has taken this long; at once if the operator has not been asked for a stop that is due.
    pub fn due(&self, limit: Duration) -> Option<Duration> {
        if self.stops {
            return Some(Duration::ZERO);
        }
        self.stop_at.map(|at| at.saturating_add(limit))
    }

    /// Reports an event. If it cannot be written, the run is to stop: nobody sees what happens.
    pub fn notify(&mut self, event: Value) {
        if self.is_deaf {
            return;
        }
        if let Err(error) = (self.notify)(event) {
            remark(&format!("{error:#}: the run stops"));
            (self.is_deaf, self.stops) = (true, true);
        }
    }

    /// As [`notify`](Self::notify), for an event that the machine can cause at any rate and that is not an outcome: most are left out, and
    /// counted.
    pub fn notice(&mut self, event: Value) {
        if event.get("event").and_then(Value::as_str).is_some_and(admits) {
            self.notify(event);
        }
    }

    /// Says what can be typed.
    pub fn hint(&mut self, hint: &str) {
        self.notify(json!({"event": "hint", "hint": hint}));
    }

    /// Shows how much of the work is done.
    pub fn progress(&mut self, tally: Tally) {
        (self.progress)(tally);
    }
}

/// A word on standard input.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Word {
    /// Begin nothing new until `continue`.
    Pause,
    /// Go on.
    Continue,
    /// End after what is under way.
    Stop,
    /// Stop everything now.
    Abort,
    /// To a question: it was done, go on after it.
    Done,
    /// To a question: it was not done, do it again.
    Repeat,
}

impl Word {
    /// The words, for a hint.
    pub const HINT: &str = "type pause, continue or stop; answer questions with done, repeat or stop";

    /// The word that a line is, also by its first letter.
    pub fn parse(line: &str) -> Option<Self> {
        Some(match line.trim() {
            "pause" | "p" => Self::Pause,
            "continue" | "c" => Self::Continue,
            "stop" | "s" => Self::Stop,
            "abort" | "a" => Self::Abort,
            "done" | "d" => Self::Done,
            "repeat" | "r" => Self::Repeat,
            _ => return None,
        })
    }
}
