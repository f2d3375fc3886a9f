//! What became of every instruction, in a file that outlives the process: what was done is not done twice unasked.
//!
//! One JSON object a line. What is about to be sent is written and synced before it is sent: a process that is killed leaves
//! instructions whose outcome is unknown, and no others.

use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use fs4::FileExt;
use serde::{Deserialize, Serialize};

use super::program::Program;

/// What is known of an instruction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// Never sent, or proved not to have been taken.
    NotSent,
    /// The controller has queued it, or executed it if it is immediate.
    Done,
    /// Nobody knows.
    Unknown,
    /// The controller refuses it.
    Refused,
}

/// A line of the file.
#[derive(Debug, Serialize, Deserialize)]
#[serde(untagged)]
enum Entry {
    Program { program: String, instructions: usize },
    Span { outcome: Outcome, first: usize, count: usize },
}

/// The journal of a program, which nobody else writes meanwhile.
#[derive(Debug)]
pub struct Journal {
    path: PathBuf,
    file: File,
    outcomes: Vec<Outcome>,
}

impl Journal {
    /// The file of a program's journal: beside it.
    pub fn beside(program: &Path) -> PathBuf {
        let mut name = program.file_name().unwrap_or_default().to_owned();
        name.push(".journal");
        program.with_file_name(name)
    }

    /// Opens the journal of a program, or begins it. With `again`, what it says of an earlier run is forgotten.
    ///
    /// # Errors
    /// When another process runs the program, or the journal is that of another program, or none.
    pub fn open(path: &Path, program: &Program, again: bool) -> Result<Self> {
        let what = || format!("the journal {}", path.display());
        let open = OpenOptions::new().read(true).append(true).create(true).open(path);
        let file = open.with_context(what)?;
        if FileExt::try_lock(&file).is_err() {
            bail!("another process runs this program: it holds {}", path.display());
        }
        if again {
            file.set_len(0).with_context(what)?;
        }
        let outcomes = vec![Outcome::NotSent; program.instructions.len()];
        let mut journal = Self { path: path.to_owned(), file, outcomes };
        let found = journal.read(program).with_context(what)?;
        if !found {
            let (program, instructions) = (program.fingerprint(), program.instructions.len());
            journal.write(&Entry::Program { program, instructions })?;
        }
        Ok(journal)
    }

    /// Its file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What is known of each instruction.
    pub fn outcomes(&self) -> &[Outcome] {
        &self.outcomes
    }

    /// How many instructions have this outcome.
    pub fn count(&self, outcome: Outcome) -> usize {
        self.outcomes.iter().filter(|known| **known == outcome).count()
    }

    /// The first instructions whose outcome is unknown, and how many in a row.
    pub fn unknown(&self) -> Option<(usize, usize)> {
        let first = self.outcomes.iter().position(|known| *known == Outcome::Unknown)?;
        let rest = self.outcomes.get(first..).unwrap_or_default();
        Some((first, rest.iter().take_while(|known| **known == Outcome::Unknown).count()))
    }

    /// Notes the outcome of instructions, safely on the disk.
    ///
    /// # Errors
    /// When the disk does not take it.
    pub fn note(&mut self, outcome: Outcome, first: usize, count: usize) -> Result<()> {
        self.write(&Entry::Span { outcome, first, count })?;
        self.set(outcome, first, count);
        Ok(())
    }

    fn set(&mut self, outcome: Outcome, first: usize, count: usize) {
        for known in self.outcomes.iter_mut().skip(first).take(count) {
            *known = outcome;
        }
    }

    fn write(&mut self, entry: &Entry) -> Result<()> {
        let what = || format!("cannot write the journal {}", self.path.display());
        let mut line = serde_json::to_vec(entry)?;
        line.push(b'\n');
        self.file.write_all(&line).with_context(what)?;
        self.file.sync_data().with_context(what)
    }

    /// Reads what is there; false when there is nothing. A last line that was not written to its end is removed.
    fn read(&mut self, program: &Program) -> Result<bool> {
        self.file.seek(SeekFrom::Start(0))?;
        let mut reader = BufReader::new(self.file.try_clone()?);
        let (mut line, mut number, mut whole) = (Vec::new(), 0_u64, 0_u64);
        loop {
            line.clear();
            let length = reader.read_until(b'\n', &mut line)? as u64;
            if line.last() != Some(&b'\n') {
                break;
            }
            whole += length;
            number += 1;
            let entry: Entry = serde_json::from_slice(&line).ok().with_context(|| {
                format!("line {number} is none of a journal; remove the file to begin anew")
            })?;
            match entry {
                Entry::Program { program: found, instructions } if number == 1 => {
                    let same = found == program.fingerprint() && instructions == self.outcomes.len();
                    ensure!(
                        same,
                        "it is of another program: the file was changed since it was run. Finish the earlier program, or \
                         begin this one with --again"
                    );
                }
                Entry::Span { outcome, first, count } if number > 1 => self.set(outcome, first, count),
                _ => bail!("line {number} is out of place; remove the file to begin anew"),
            }
        }
        self.file.set_len(whole)?;
        Ok(number > 0)
    }
}
