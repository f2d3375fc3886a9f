//! The common parts of clients that do each part of some work once.

use std::borrow::Cow;
use std::path::{Path, PathBuf};
use std::sync::mpsc::Receiver;

use anyhow::{Context as _, Result, ensure};
use indicatif::{ProgressBar, ProgressDrawTarget};
use serde_json::{Map, Value, json};

use crate::command::settings::SetArgs;
use crate::io::journal::{self, Head, Journal, JournalWriteError, Outcome, Record, Tally};
use crate::run::{END_WITHIN, ResumeChoice, STOP_WITHIN};
use cellwire_io::bar;
use cellwire_io::bell::Bell;
use cellwire_io::drive::ConnectionLost;
use cellwire_io::input::{self, OperatorInput};
use cellwire_io::output::{self, EventArgs, log, remark};
use cellwire_io::tcp::TimeoutArgs;
use cellwire_io::{files, interrupt};

#[derive(Debug, clap::Args)]
pub(super) struct WorkArgs {
    /// Check the file and print the plan and, with a journal, what is done and where a run goes on; send nothing
    #[arg(long)]
    pub(super) dry_run: bool,
    /// Draw the robot's path as SVG; in a dry run with a journal, marked by what is done, unknown and to do
    #[arg(long, value_name = "FILE")]
    pub(super) picture: Option<PathBuf>,
    /// Write what became of each job as CSV; in a dry run, what the journal has
    #[arg(long, value_name = "FILE")]
    outcomes: Option<PathBuf>,
    /// The journal of the jobs' outcomes [default: FILE.journal]
    #[arg(long, value_name = "FILE")]
    journal: Option<PathBuf>,
    /// Replace the journal, and repeat the jobs that are done
    #[arg(long)]
    again: bool,
    /// The answer for what an earlier run has left unknown, without a question: done, repeat, or the number of the last that
    /// is done; check the machine first
    #[arg(long, value_name = "ANSWER", conflicts_with = "again")]
    pub(super) unknown: Option<ResumeChoice>,
    #[command(flatten)]
    pub(super) connect: TimeoutArgs,
    #[command(flatten)]
    pub(super) set: SetArgs,
    #[command(flatten)]
    pub(super) events: EventArgs,
}

/// The input of a run: a file, and the parts in it.
pub(super) struct RunInput<'a> {
    /// The name of the robot in the command.
    pub(super) robot: &'a str,
    /// The file.
    pub(super) file: &'a Path,
    /// The name of the work for people.
    pub(super) what: &'a str,
    /// The value that distinguishes it from other work.
    pub(super) fingerprint: String,
    /// The number of the work's parts.
    pub(super) parts: usize,
    /// The line of the file of each part, as far as they have one.
    pub(super) lines: Vec<u64>,
    /// The unit of `lines`: `line`, or `outline` of a drawing.
    pub(super) unit: &'a str,
}

const NO_TABLE: files::FileWriteError =
    files::FileWriteError(Cow::Borrowed("the outcomes are in the journal alone"));

/// A run that has ended.
pub(super) struct FinishedRun<R, T> {
    /// The way in which it ended.
    pub(super) ended: T,
    /// The journal of the run.
    pub(super) journal: Journal<R>,
    /// Whether the table of `--outcomes` is written.
    table: Result<()>,
}

impl RunInput<'_> {
    /// Returns the head of the journal.
    fn head(&self) -> Head {
        Head { robot: self.robot.into(), work: self.fingerprint.clone(), parts: self.parts }
    }
}

impl WorkArgs {
    /// Returns the file of the journal.
    fn path(&self, work: &RunInput<'_>) -> PathBuf {
        self.journal.clone().unwrap_or_else(|| journal::beside(work.file))
    }

    /// Returns the journal for a dry run. `None` without one, and with --again; one that cannot be used is reported.
    pub(super) fn look<R: Record>(&self, work: &RunInput<'_>) -> Option<Journal<R>> {
        if !self.dry_run || self.again {
            return None;
        }
        Journal::look(&self.path(work), work.what, work.head()).unwrap_or_else(|error| {
            remark(&format!("warning: {error:#}"));
            None
        })
    }

    /// Prints and writes what the journal has, in a dry run.
    ///
    /// # Errors
    /// When `--unknown` does not answer what is unknown, or the output cannot be written.
    pub(super) fn tell<R: Record>(&self, work: &RunInput<'_>, journal: Option<&Journal<R>>) -> Result<()> {
        let Some(journal) = journal else {
            let is_asked = self.outcomes.is_some() || self.unknown.is_some();
            ensure!(!is_asked, "--outcomes and --unknown are about a journal, and there is none");
            return Ok(());
        };
        self.check_answer(journal)?;
        if let Some(path) = &self.outcomes {
            files::write(path, table(work, journal).as_bytes())?;
        }
        log(&standing(work, journal, self.unknown))
    }

    /// Checks that the number of `--unknown` is an answer to the question about the unknown parts.
    fn check_answer<R: Record>(&self, journal: &Journal<R>) -> Result<()> {
        let Some(ResumeChoice::Last(last)) = self.unknown else { return Ok(()) };
        match journal.unknown() {
            Some((first, count)) => ensure!(
                (first..=first + count).contains(&last),
                "--unknown {last}: {} to {} are unknown; give the number of the last that is done, {first} if none is",
                first + 1,
                first + count
            ),
            // A machine shows when it connects whether it has lost its queue.
            None => ensure!(journal.tally().queued > 0, "--unknown {last}: nothing is unknown"),
        }
        Ok(())
    }

    /// Executes the parts that are not done in the journal. The table of all parts is written even if the run fails.
    ///
    /// # Errors
    /// When all are done, or the journal is not this work's; those of `run`.
    pub(super) fn run<R: Record, T>(
        &self,
        work: RunInput<'_>,
        run: impl FnOnce(&mut Journal<R>, &ProgressBar) -> Result<T>,
    ) -> Result<FinishedRun<R, T>> {
        let mut journal = Journal::open(&self.path(&work), work.what, work.head(), self.again)?;
        self.check_answer(&journal)?;
        let ended = self.go_on(work.what, work.parts, &mut journal, run);
        let table = match &self.outcomes {
            Some(path) => files::write(path, table(&work, &journal).as_bytes()).context(NO_TABLE),
            None => Ok(()),
        };
        match (ended, table) {
            (Ok(ended), table) => Ok(FinishedRun { ended, journal, table }),
            (Err(error), table) => {
                table.unwrap_or_else(|error| remark(&format!("warning: {error:#}")));
                Err(error)
            }
        }
    }

    /// Shows how much of the work is done, and sets the line for a program that has to end at once. `machine` is what the
    /// machine still does.
    pub(super) fn shown<R: Record, M: Fn(&Tally) -> String>(
        &self,
        progress: &ProgressBar,
        journal: &Journal<R>,
        machine: M,
    ) -> impl FnMut(Tally) + use<R, M> {
        let (progress, path) = (progress.clone(), journal.path().display().to_string());
        let is_asked = self.outcomes.is_some();
        let table =
            if is_asked { "; with --dry-run it writes the outcomes, which the journal has" } else { "" };
        let show = move |tally: Tally| {
            progress.set_position(tally.done as u64);
            let machine = machine(&tally);
            interrupt::account(format!("{tally}; {machine}; the same command continues from {path}{table}"));
        };
        show(journal.tally());
        show
    }

    fn go_on<R: Record, T>(
        &self,
        what: &str,
        parts: usize,
        journal: &mut Journal<R>,
        run: impl FnOnce(&mut Journal<R>, &ProgressBar) -> Result<T>,
    ) -> Result<T> {
        let is_done = journal.outcomes().iter().all(|outcome| *outcome == Outcome::Done);
        let path = journal.path().display();
        ensure!(!is_done, "the {what} is finished according to {path}; --again repeats it");
        let progress = ProgressBar::with_draw_target(Some(parts as u64), ProgressDrawTarget::stderr());
        progress.set_position(journal.count(Outcome::Done) as u64);
        bar::show_bar(&progress);
        let ended = run(journal, &progress);
        bar::clear_bar();
        ended.map_err(|error| {
            let (tally, path) = (journal.tally(), journal.path().display());
            match error.downcast_ref() {
                Some(ConnectionLost(why)) => {
                    ConnectionLost(format!("{why}; {tally}: the same command continues from {path}")).into()
                }
                None if error.is::<JournalWriteError>() => error.context(format!(
                    "the run has ended with {tally}: when the cause is removed, the same command continues"
                )),
                None => error,
            }
        })
    }
}

impl<R, T> FinishedRun<R, T> {
    /// Prints the last line, on standard error if standard output does not accept it.
    ///
    /// # Errors
    /// When neither standard output nor the table of `--outcomes` could be written.
    pub(super) fn say(self, line: &Value) -> Result<T> {
        log(line).map_err(|error| {
            remark(&line.to_string());
            // A run that stops because its output is not read is not done.
            if output::is_closed(&error) { output::OutputFailed.into() } else { error }
        })?;
        self.table?;
        Ok(self.ended)
    }
}

/// Writes `number,line,outcome` of each part; for a drawing, `outline` replaces `line`.
fn table<R: Record>(RunInput { lines, unit, .. }: &RunInput<'_>, journal: &Journal<R>) -> String {
    let mut text = format!("number,{unit},outcome\n");
    for (number, outcome) in journal.outcomes().iter().enumerate() {
        let line = lines.get(number).map(u64::to_string).unwrap_or_default();
        text.push_str(&format!("{},{line},{}\n", number + 1, outcome.name()));
    }
    text
}

/// The most runs of equal outcomes that a dry run prints.
const MAX_SPANS: usize = 100;

/// Returns the last line of a run, with the number of parts for each outcome; `machine` describes the work that the machine
/// still has.
pub(super) fn ended<R: Record>(journal: &Journal<R>, why: &str, machine: &str) -> Value {
    let count = |outcome| journal.count(outcome);
    json!({
        "event": "ended", "why": why,
        "done": count(Outcome::Done), "unknown": count(Outcome::Unknown), "refused": count(Outcome::Refused),
        "not_sent": count(Outcome::NotSent), "machine": machine, "journal": journal.path(),
    })
}

/// Returns the lines and the signals of an operator: the first signal is a stop; the second one prints `account` and ends
/// the program.
pub(super) fn operator(bell: Bell) -> Result<Receiver<Option<OperatorInput>>> {
    // A run that waits for its machine ends by itself before that.
    input::operator(bell, STOP_WITHIN + 2 * END_WITHIN)
}

/// Says that the work was begun before.
pub(super) fn say_resumed<R: Record>(journal: &Journal<R>) -> Result<()> {
    match (journal.count(Outcome::Done), journal.outcomes().len()) {
        (0, _) => Ok(()),
        (done, of) => log(&json!({"event": "resumed", "done": done, "of": of})),
    }
}

/// Returns the line of a dry run about its journal: the number of parts for each outcome, their numbers, and the next action
/// of a run.
fn standing<R: Record>(work: &RunInput<'_>, journal: &Journal<R>, answer: Option<ResumeChoice>) -> Value {
    let (count, outcomes) = (|outcome| journal.count(outcome), journal.outcomes());
    let mut first = 0;
    let mut spans = Vec::new();
    for span in outcomes.chunk_by(|a, b| a == b) {
        let last = first + span.len() - 1;
        let mut line = Map::new();
        line.insert("outcome".into(), json!(span.first()));
        line.extend([("first".into(), json!(first + 1)), ("count".into(), json!(span.len()))]);
        if let [Some(from), Some(to)] = [first, last].map(|at| work.lines.get(at)) {
            line.insert(format!("{}s", work.unit), json!([from, to]));
        }
        spans.push(Value::from(line));
        first = last + 1;
    }
    let left_out = spans.len().saturating_sub(MAX_SPANS);
    spans.truncate(MAX_SPANS);
    let open = outcomes.iter().position(|it| matches!(it, Outcome::NotSent | Outcome::Refused));
    let answered = journal.unknown().and_then(|(first, count)| Some(first + answer?.done(first, count)?));
    let left = |next: usize| open.into_iter().chain(Some(next).filter(|next| *next < outcomes.len())).min();
    let next = match (answered.map(left), journal.unknown(), journal.tally().queued, open) {
        (Some(Some(next)), ..) => format!("a run goes on at {}", next + 1),
        (Some(None), ..) => format!("a run only records the answer: the {} is finished then", work.what),
        (None, Some((first, count)), ..) => format!(
            "a run asks whether {} to {} are done, unless --unknown answers",
            first + 1,
            first + count
        ),
        (None, None, 1.., _) => {
            "a run takes over what the machine has queued, and asks if the machine has lost it".into()
        }
        (None, None, 0, Some(open)) => format!("a run goes on at {}", open + 1),
        (None, None, 0, None) => format!("the {} is finished; --again repeats it", work.what),
    };
    let mut line = json!({
        "event": "journal", "journal": journal.path(), "of": outcomes.len(),
        "done": count(Outcome::Done), "unknown": count(Outcome::Unknown), "refused": count(Outcome::Refused),
        "not_sent": count(Outcome::NotSent), "outcomes": spans, "next": next,
    });
    if let (Some(line), 1..) = (line.as_object_mut(), left_out) {
        line.insert("left_out".into(), left_out.into());
    }
    line
}
