//! The clients that run a piece of work on a machine, each part of it once; the operator, and the operator's input.

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

use crate::io::journal::{Outcome, Span, Tally};
use cellwire_io::input::OperatorInput;
use cellwire_io::output::{admits, remark};

/// After a signal, the longest wait for the machine to stop by itself.
pub const STOP_WITHIN: Duration = Duration::from_secs(30);
/// The longest wait after that, for a machine that received a command to stop at once, and for calls that block.
pub const END_WITHIN: Duration = Duration::from_secs(5);

/// The interval at which a question looks for its answer.
const ANSWER_CHECK_INTERVAL: Duration = Duration::from_millis(50);

/// The longest wait for the end of a standard input that is not a keyboard.
pub const KEYBOARD_WITHIN: Duration = Duration::from_millis(200);
/// The advice of an event `unanswered`.
const UNANSWERED: &str = "nobody can answer, since standard input has ended: check the machine, then run the same command with --unknown done, --unknown repeat, or the number of the last that is done";

/// The least and the greatest X and Y of a plan, in mm.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Bounds {
    least: [f64; 2],
    most: [f64; 2],
}

impl Bounds {
    /// Returns the bounds of these points; `None` without points.
    pub fn of(points: impl Iterator<Item = [f64; 2]>) -> Option<Self> {
        points.fold(None, |bounds: Option<Self>, point @ [x, y]| {
            let Self { least: [left, low], most: [right, high] } =
                bounds.unwrap_or(Self { least: point, most: point });
            Some(Self { least: [left.min(x), low.min(y)], most: [right.max(x), high.max(y)] })
        })
    }
}

/// The answer of the command line for parts that an earlier run has left unknown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ResumeChoice {
    /// All unknown parts are done.
    Done,
    /// No unknown part is done: all are repeated.
    Repeat,
    /// The unknown parts up to this number, counted from 1, are done.
    Last(usize),
}

impl ResumeChoice {
    /// Returns how many of `count` unknown parts, the first of which has the index `first`, are done; `None` for a number that is
    /// neither one of these parts nor the part before the first.
    pub fn done(self, first: usize, count: usize) -> Option<usize> {
        match self {
            Self::Done => Some(count),
            Self::Repeat => Some(0),
            Self::Last(last) => last.checked_sub(first).filter(|done| *done <= count),
        }
    }
}

impl FromStr for ResumeChoice {
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

/// An answer of the operator: of the parts in question, the first `done` are done.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ResumeAnswer {
    /// The index of the first part in question.
    pub first: usize,
    /// The number of parts in question.
    pub count: usize,
    /// The number of these that are done.
    pub done: usize,
}

impl ResumeAnswer {
    /// Returns the outcomes of the parts: those that are done, and those that are not.
    pub fn spans(self) -> impl Iterator<Item = Span> {
        let Self { first, count, done } = self;
        let done_parts = Span { outcome: Outcome::Done, first, count: done };
        let others = Span { outcome: Outcome::NotSent, first: first + done, count: count - done };
        [done_parts, others].into_iter().filter(|span| span.count > 0)
    }
}

/// Returns an event about `count` parts, the first of which has the index `first`: the number of the first, and the `unit`s of
/// the first and the last in the file, as `line` returns them.
pub fn span(
    event: &str,
    (first, count): (usize, usize),
    unit: &str,
    line: impl Fn(usize) -> Option<u64>,
) -> Value {
    let mut span = json!({"event": event, "first": first + 1, "count": count});
    if let (Some(fields), [Some(from), Some(to)]) =
        (span.as_object_mut(), [first, first + count.max(1) - 1].map(line))
    {
        fields.insert(format!("{unit}s"), json!([from, to]));
    }
    span
}

/// The dialogue with the operator of a run, and where the run is reported.
#[allow(missing_debug_implementations, reason = "it has closures")]
pub struct Console<'a> {
    /// Whether nothing new begins until `continue`.
    pub paused: bool,
    /// Whether the run ends after the current work.
    pub stopping: bool,
    /// Whether what is under way ends at once, if the machine can do that.
    pub aborting: bool,
    /// The parts that are asked about: the index of the first, and their number.
    question: Option<(usize, usize)>,
    typed: Receiver<Option<OperatorInput>>,
    notify: &'a mut dyn FnMut(Value) -> Result<()>,
    progress: &'a mut dyn FnMut(Tally),
    /// A line or stop that has been received and not returned.
    pending: Option<OperatorInput>,
    /// Standard input has ended: there is no operator.
    is_absent: bool,
    /// When the stop of a signal was asked for.
    stop_at: Option<Duration>,
    /// Whether a report could not be written: reports are dropped since then.
    is_deaf: bool,
    /// Whether the stop because of that is still to be returned by [`next`](Self::next).
    stops: bool,
}

impl<'a> Console<'a> {
    /// Creates the console of an operator whose input `typed` receives. `notify` prints an event, `progress` shows the
    /// completed part of the work.
    pub fn new(
        typed: Receiver<Option<OperatorInput>>,
        notify: &'a mut dyn FnMut(Value) -> Result<()>,
        progress: &'a mut dyn FnMut(Tally),
    ) -> Self {
        let (paused, stopping, aborting, question) = (false, false, false, None);
        let (pending, is_absent, stop_at, is_deaf, stops) = (None, false, None, false, false);
        Self {
            paused,
            stopping,
            aborting,
            question,
            typed,
            notify,
            progress,
            pending,
            is_absent,
            stop_at,
            is_deaf,
            stops,
        }
    }

    /// Asks the operator for the outcomes of `count` parts, the first of which has the index `first`, by an event about them
    /// without a name. False if standard input has ended, or ends within `wait`: nobody can answer, the option that answers is
    /// named, and the run is to stop.
    pub fn ask(&mut self, (first, count): (usize, usize), wait: Duration, mut event: Value) -> bool {
        let is_asked = !self.is_without_keyboard(wait);
        let (name, key, value) = if is_asked {
            self.question = Some((first, count));
            let answers = ["done", "repeat", "stop", "the number of the last that is done"];
            let possible = if count > 1 { answers.len() } else { answers.len() - 1 };
            ("question", "answers", answers.into_iter().take(possible).collect())
        } else {
            self.stopping = true;
            ("unanswered", "what", json!(UNANSWERED))
        };
        if let Some(event) = event.as_object_mut() {
            event.insert("event".into(), name.into());
            event.insert(key.into(), value);
        }
        self.notify(event);
        is_asked
    }

    /// Waits for the answer to the question that was asked; `None` if the operator stops instead.
    pub fn answer(&mut self) -> Option<ResumeAnswer> {
        // An earlier stop was for the work of that time.
        let was_stopping = core::mem::take(&mut self.stopping);
        let answered = loop {
            match self.listen(ANSWER_CHECK_INTERVAL) {
                None if !self.stopping => {}
                answered => break answered,
            }
        };
        self.stopping |= was_stopping;
        answered
    }

    /// Executes the operator's input within `wait` since the last call: pauses, continues, stops; returns an answer to the
    /// open question.
    pub fn listen(&mut self, wait: Duration) -> Option<ResumeAnswer> {
        loop {
            let (word, text) = match self.next(wait) {
                Some(OperatorInput::Line(text)) => (OperatorCommand::parse(&text), text),
                Some(OperatorInput::Stop) => (Some(OperatorCommand::Stop), String::new()),
                None => {
                    // There is no operator to continue it.
                    if self.is_absent {
                        self.stopping |= self.question.take().is_some() || self.paused;
                    }
                    return None;
                }
            };
            let number: Option<usize> = text.trim().parse().ok();
            let event = match (word, self.question) {
                (Some(word @ (OperatorCommand::Stop | OperatorCommand::Abort)), _) => {
                    self.stopping = true;
                    self.aborting |= word == OperatorCommand::Abort;
                    self.notify(json!({"event": "stopping"}));
                    if self.question.take().is_some() {
                        return None;
                    }
                    continue;
                }
                (Some(OperatorCommand::Pause | OperatorCommand::Continue), Some(_)) => {
                    self.hint("answer done, repeat or stop");
                    continue;
                }
                (Some(OperatorCommand::Pause), None) => {
                    self.paused = true;
                    json!({"event": "paused"})
                }
                (Some(OperatorCommand::Continue), None) => {
                    self.paused = false;
                    json!({"event": "continued"})
                }
                (Some(OperatorCommand::Done), Some((first, count))) => {
                    return self.answered(first, count, count);
                }
                (Some(OperatorCommand::Repeat), Some((first, count))) => {
                    return self.answered(first, count, 0);
                }
                (None, Some((first, count))) => {
                    let last = number.filter(|last| (first..=first + count).contains(last));
                    if let Some(last) = last {
                        return self.answered(first, count, last - first);
                    }
                    self.hint(&format!(
                        "answer done, repeat or stop, or the number of the last that is done: {first} to {}",
                        first + count
                    ));
                    continue;
                }
                // An early answer may not be meant for this question.
                (typed, None) if typed.is_some() || number.is_some() => {
                    let hint = "there is no open question: answers count only after a question";
                    json!({"event": "no_question", "typed": text.trim(), "hint": hint})
                }
                _ => {
                    self.hint(OperatorCommand::HINT);
                    continue;
                }
            };
            self.notify(event);
        }
    }

    /// Returns whether a question is open.
    pub fn asks(&self) -> bool {
        self.question.is_some()
    }

    fn answered(&mut self, first: usize, count: usize, done: usize) -> Option<ResumeAnswer> {
        self.question = None;
        Some(ResumeAnswer { first, count, done })
    }

    /// Reports an answer.
    pub fn notify_answered(&mut self, ResumeAnswer { first, count, done }: ResumeAnswer) {
        let answer = match done {
            0 => json!("repeat"),
            done if done == count => json!("done"),
            done => json!(first + done),
        };
        self.notify(json!({"event": "answered", "first": first + 1, "count": count, "answer": answer}));
    }

    /// Returns the next line or stop of the operator, within `wait`. `None` after that time, or when standard input has ended.
    fn next(&mut self, wait: Duration) -> Option<OperatorInput> {
        if core::mem::take(&mut self.stops) {
            return Some(self.stop());
        }
        if let Some(typed) = self.pending.take() {
            return Some(typed);
        }
        match self.typed.recv_timeout(wait) {
            Ok(Some(OperatorInput::Line(line))) => Some(OperatorInput::Line(line)),
            Ok(Some(OperatorInput::Stop)) => Some(self.stop()),
            Ok(None) | Err(RecvTimeoutError::Disconnected) => {
                self.is_absent = true;
                None
            }
            Err(RecvTimeoutError::Timeout) => None,
        }
    }

    fn stop(&mut self) -> OperatorInput {
        self.stop_at.get_or_insert_with(now);
        OperatorInput::Stop
    }

    /// Returns whether standard input has ended, or ends within this time, without a line or a stop before that.
    pub fn is_without_keyboard(&mut self, wait: Duration) -> bool {
        if self.pending.is_none() {
            self.pending = self.next(wait);
        }
        self.pending.is_none() && self.is_absent
    }

    /// Returns whether the stop of a signal has taken this long.
    pub fn has_waited(&self, limit: Duration) -> bool {
        self.stop_at.is_some_and(|at| now() >= at.saturating_add(limit))
    }

    /// Returns the time at which the stop of a signal has taken this long; zero if a stop that is due was not reported to
    /// the operator.
    pub fn due(&self, limit: Duration) -> Option<Duration> {
        if self.stops {
            return Some(Duration::ZERO);
        }
        self.stop_at.map(|at| at.saturating_add(limit))
    }

    /// Reports an event. If it cannot be written, the run must stop, because its events are not visible.
    pub fn notify(&mut self, event: Value) {
        if self.is_deaf {
            return;
        }
        if let Err(error) = (self.notify)(event) {
            remark(&format!("{error:#}: the run stops"));
            (self.is_deaf, self.stops) = (true, true);
        }
    }

    /// Prints as [`notify`](Self::notify) does an event that the machine can cause at any rate and that is not an outcome:
    /// most are omitted, and counted.
    pub fn notice(&mut self, event: Value) {
        if event.get("event").and_then(Value::as_str).is_some_and(admits) {
            self.notify(event);
        }
    }

    /// Prints the possible inputs.
    pub fn hint(&mut self, hint: &str) {
        self.notify(json!({"event": "hint", "hint": hint}));
    }

    /// Shows how much of the work is done.
    pub fn progress(&mut self, tally: Tally) {
        (self.progress)(tally);
    }
}

/// A word on standard input.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum OperatorCommand {
    /// Begin nothing new until `continue`.
    Pause,
    /// Go on after a pause.
    Continue,
    /// End after the current work.
    Stop,
    /// Stop the machine and the run now.
    Abort,
    /// To a question: it was done, continue after it.
    Done,
    /// To a question: it was not done, do it again.
    Repeat,
}

impl OperatorCommand {
    /// The words, for a hint.
    const HINT: &str = "type pause, continue or stop; answer questions with done, repeat or stop";

    /// Parses a word, or its first letter.
    fn parse(line: &str) -> Option<Self> {
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
