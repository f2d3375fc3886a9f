//! What became of every part, in a file that outlives the process.

use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use fs4::FileExt;
use serde::{Deserialize, Serialize};

/// What is known of a part.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum State {
    /// Nobody has touched it.
    Waiting,
    /// The robot was sent to it.
    Begun,
    /// It is in its place, or the operator has said so.
    Placed,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(untagged)]
enum Entry {
    Task { task: String, parts: usize },
    Part { part: usize, state: State },
}

/// The journal of a task, which nobody else writes meanwhile. One JSON object a line; each is on the disk before the robot moves.
#[derive(Debug)]
pub struct Journal {
    path: PathBuf,
    file: File,
    parts: Vec<State>,
}

impl Journal {
    /// Opens the journal of a task, or begins it. With `again`, what it says of an earlier run is forgotten.
    ///
    /// # Errors
    /// When another process runs the task, or the journal is that of another task, or none.
    pub fn open(path: &Path, task: &str, parts: usize, again: bool) -> Result<Self> {
        let what = || format!("the journal {}", path.display());
        let file = OpenOptions::new().read(true).append(true).create(true).open(path).with_context(what)?;
        if FileExt::try_lock(&file).is_err() {
            bail!("another process runs this task: it holds {}", path.display());
        }
        if again {
            file.set_len(0).with_context(what)?;
        }
        let mut journal = Self { path: path.to_owned(), file, parts: vec![State::Waiting; parts] };
        if !journal.read(task).with_context(what)? {
            journal.write(&Entry::Task { task: task.into(), parts })?;
        }
        Ok(journal)
    }

    /// Its file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// How many parts are in this state.
    pub fn count(&self, state: State) -> usize {
        self.parts.iter().filter(|found| **found == state).count()
    }

    /// The first part in this state.
    pub fn first(&self, state: State) -> Option<usize> {
        self.parts.iter().position(|found| *found == state)
    }

    /// What is known of each part.
    pub fn parts(&self) -> &[State] {
        &self.parts
    }

    /// Notes the state of a part, safely on the disk.
    ///
    /// # Errors
    /// When the disk does not take it.
    pub fn note(&mut self, part: usize, state: State) -> Result<()> {
        self.write(&Entry::Part { part, state })?;
        self.set(part, state);
        Ok(())
    }

    fn set(&mut self, part: usize, state: State) {
        if let Some(known) = self.parts.get_mut(part) {
            *known = state;
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
    fn read(&mut self, task: &str) -> Result<bool> {
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
            match (serde_json::from_slice(&line), number) {
                (Ok(Entry::Task { task: found, parts }), 1) => ensure!(
                    found == task && parts == self.parts.len(),
                    "it is of another task: the parts were changed since it was run. Begin this one with --again"
                ),
                (Ok(Entry::Part { part, state }), 2..) => self.set(part, state),
                _ => bail!("line {number} is none of a journal; remove the file to begin anew"),
            }
        }
        self.file.set_len(whole)?;
        Ok(number > 0)
    }
}
