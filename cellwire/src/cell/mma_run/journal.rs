//! What became of every part of a task.

use std::path::Path;

use anyhow::Result;
use serde::{Deserialize, Serialize};

use crate::io::journal;

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

/// Of which task the journal is.
#[derive(Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Head {
    task: String,
    parts: usize,
}

#[derive(Debug, Serialize, Deserialize)]
struct Part {
    part: usize,
    state: State,
}

/// The journal of a task. A part is noted as begun before the robot moves.
#[derive(Debug)]
pub struct Journal {
    file: journal::Journal,
    parts: Vec<State>,
}

impl Journal {
    /// Opens the journal of a task, or begins it. With `again`, what it says of an earlier run is forgotten.
    ///
    /// # Errors
    /// When another process runs the task, or the journal is that of another task, or none.
    pub fn open(path: &Path, task: &str, parts: usize, again: bool) -> Result<Self> {
        let head = Head { task: task.into(), parts };
        let mut parts = vec![State::Waiting; parts];
        let file = journal::Journal::open(path, "task", &head, again, |part| set(&mut parts, &part))?;
        Ok(Self { file, parts })
    }

    /// Its file.
    pub fn path(&self) -> &Path {
        self.file.path()
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
        let part = Part { part, state };
        self.file.append(&part)?;
        set(&mut self.parts, &part);
        Ok(())
    }
}

fn set(parts: &mut [State], part: &Part) {
    if let Some(known) = parts.get_mut(part.part) {
        *known = part.state;
    }
}
