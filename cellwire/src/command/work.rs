//! What the clients have in common that do each part of some work once.

use std::path::{Path, PathBuf};
use std::sync::mpsc::Receiver;

use anyhow::{Context as _, Result, ensure};
use indicatif::{ProgressBar, ProgressDrawTarget};
use serde_json::{Value, json};

use super::settings::SetArgs;
use crate::cell::run::{END_WITHIN, STOP_WITHIN};
use crate::io::bell::Bell;
use crate::io::drive::Lost;
use crate::io::input::{self, Typed};
use crate::io::journal::{self, Journal, Outcome, Record, Tally, Unwritten};
use crate::io::output::{log, remark};
use crate::io::tcp::ConnectArgs;
use crate::io::{files, interrupt};

#[derive(Debug, clap::Args)]
pub(super) struct WorkArgs {
    /// Print what would be done, without sending anything
    #[arg(long, display_order = 3)]
    pub(super) dry_run: bool,
    /// Draw the robot's path as this SVG file
    #[arg(long, value_name = "FILE", display_order = 4)]
    pub(super) draw: Option<PathBuf>,
    /// The journal [default: the file's name with .journal]
    #[arg(long, value_name = "FILE")]
    journal: Option<PathBuf>,
    /// Ignore the journal and begin at the first part: finished parts are repeated
    #[arg(long)]
    again: bool,
    /// Write the outcome of every part into this CSV file at the end
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    #[command(flatten)]
    pub(super) connect: ConnectArgs,
    #[command(flatten)]
    pub(super) set: SetArgs,
}

/// A piece of work in a file.
pub(super) struct Work<'a> {
    /// The file.
    pub(super) file: &'a Path,
    /// What people call it.
    pub(super) what: &'a str,
    /// What tells it from other work.
    pub(super) fingerprint: String,
    /// How many parts it has.
    pub(super) parts: usize,
}

const NO_TABLE: files::Unwritten = files::Unwritten("the outcomes are in the journal alone");

/// A run that has ended.
pub(super) struct Ran<R, T> {
    /// How.
    pub(super) ended: T,
    /// Its journal.
    pub(super) journal: Journal<R>,
    /// Whether the table of `--out` is written.
    table: Result<()>,
}

impl WorkArgs {
    /// Does the parts that the journal does not have as done. The table of all parts is written however that ends.
    ///
    /// # Errors
    /// When all are done, or the journal is not this work's; those of `run`.
    pub(super) fn run<R: Record, T>(
        &self,
        work: Work<'_>,
        run: impl FnOnce(&mut Journal<R>, &ProgressBar) -> Result<T>,
        table: impl FnOnce(&Journal<R>) -> String,
    ) -> Result<Ran<R, T>> {
        let Work { file, what, fingerprint, parts } = work;
        let path = self.journal.clone().unwrap_or_else(|| journal::beside(file));
        let mut journal = Journal::open(&path, what, fingerprint, parts, self.again)?;
        let ended = self.go_on(what, parts, &mut journal, run);
        let table = match &self.out {
            Some(out) => files::write(out, table(&journal).as_bytes()).context(NO_TABLE),
            None => Ok(()),
        };
        match (ended, table) {
            (Ok(ended), table) => Ok(Ran { ended, journal, table }),
            (Err(error), table) => {
                table.unwrap_or_else(|error| remark(&format!("warning: {error:#}")));
                Err(error)
            }
        }
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
        let ended = run(journal, &progress);
        progress.finish_and_clear();
        ended.map_err(|error| {
            let (tally, path) = (journal.tally(), journal.path().display());
            match error.downcast_ref() {
                Some(Lost(why)) => {
                    Lost(format!("{why}; {tally}: the same command continues from {path}")).into()
                }
                None if error.is::<Unwritten>() => error.context(format!(
                    "the run has ended with {tally}: when the cause is removed, the same command continues"
                )),
                None => error,
            }
        })
    }
}

impl<R, T> Ran<R, T> {
    /// Prints the last line, on standard error if standard output does not accept it.
    ///
    /// # Errors
    /// When neither standard output nor the table of `--out` could be written.
    pub(super) fn say(self, line: &Value) -> Result<T> {
        log(line).inspect_err(|_| remark(&line.to_string()))?;
        self.table?;
        Ok(self.ended)
    }
}

/// The lines and the signals of an operator: the first signal is a stop, the second one ends the program, which prints `account` then.
pub(super) fn operator(bell: Bell) -> Result<Receiver<Option<Typed>>> {
    // A run that waits for its machine ends by itself before that.
    input::operator(bell, STOP_WITHIN + 2 * END_WITHIN)
}

/// Shows how much of the work is done, and sets the line for a program that has to end at once. `machine` is what the machine still
/// does.
pub(super) fn shown<R: Record, M: Fn(&Tally) -> String>(
    progress: &ProgressBar,
    journal: &Journal<R>,
    machine: M,
) -> impl FnMut(Tally) + use<R, M> {
    let (progress, path) = (progress.clone(), journal.path().display().to_string());
    let show = move |tally: Tally| {
        progress.set_position(tally.done as u64);
        interrupt::account(format!("{tally}; {}; the same command continues from {path}", machine(&tally)));
    };
    show(journal.tally());
    show
}

/// Says that the work was begun before.
pub(super) fn say_resumed<R: Record>(journal: &Journal<R>) -> Result<()> {
    match (journal.count(Outcome::Done), journal.outcomes().len()) {
        (0, _) => Ok(()),
        (done, of) => log(&json!({"event": "resumed", "done": done, "of": of})),
    }
}
