//! What the clients have in common that do each part of some work once.

use std::path::{Path, PathBuf};

use anyhow::{Result, ensure};
use indicatif::{ProgressBar, ProgressDrawTarget};
use serde_json::json;

use super::settings::SetArgs;
use crate::io::drive::Lost;
use crate::io::files;
use crate::io::journal::{self, Journal, Outcome, Record};
use crate::io::output::log;
use crate::io::tcp::ConnectArgs;

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
    ) -> Result<(T, Journal<R>)> {
        let Work { file, what, fingerprint, parts } = work;
        let path = self.journal.clone().unwrap_or_else(|| journal::beside(file));
        let mut journal = Journal::open(&path, what, fingerprint, parts, self.again)?;
        let ended = self.go_on(what, parts, &mut journal, run);
        if let Some(out) = &self.out {
            files::write(out, table(&journal).as_bytes())?;
        }
        Ok((ended?, journal))
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
        ended.map_err(|error| match error.downcast_ref() {
            Some(Lost(why)) => {
                let (done, path) = (journal.count(Outcome::Done), journal.path().display());
                Lost(format!("{why}; {done} of {parts} done: the same command continues from {path}")).into()
            }
            None => error,
        })
    }
}

/// Says that the work was begun before.
pub(super) fn say_resumed<R: Record>(journal: &Journal<R>) -> Result<()> {
    match (journal.count(Outcome::Done), journal.outcomes().len()) {
        (0, _) => Ok(()),
        (done, of) => log(&json!({"event": "resumed", "done": done, "of": of})),
    }
}
