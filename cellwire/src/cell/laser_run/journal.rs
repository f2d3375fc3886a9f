//! What became of every instruction of a program.

use std::path::Path;

use anyhow::Result;
use serde::{Deserialize, Serialize};

use super::program::Program;
use crate::io::journal;

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

/// Of which program the journal is.
#[derive(Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Head {
    program: String,
    instructions: usize,
}

#[derive(Debug, Serialize, Deserialize)]
struct Span {
    outcome: Outcome,
    first: usize,
    count: usize,
}

/// The journal of a program. What is about to be sent is noted as unknown before it is sent.
#[derive(Debug)]
pub struct Journal {
    file: journal::Journal,
    outcomes: Vec<Outcome>,
}

impl Journal {
    /// Opens the journal of a program, or begins it. With `again`, what it says of an earlier run is forgotten.
    ///
    /// # Errors
    /// When another process runs the program, or the journal is that of another program, or none.
    pub fn open(path: &Path, program: &Program, again: bool) -> Result<Self> {
        let head = Head { program: program.fingerprint(), instructions: program.instructions.len() };
        let mut outcomes = vec![Outcome::NotSent; head.instructions];
        let file = journal::Journal::open(path, "program", &head, again, |span| set(&mut outcomes, &span))?;
        Ok(Self { file, outcomes })
    }

    /// Its file.
    pub fn path(&self) -> &Path {
        self.file.path()
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
        let span = Span { outcome, first, count };
        self.file.append(&span)?;
        set(&mut self.outcomes, &span);
        Ok(())
    }
}

fn set(outcomes: &mut [Outcome], span: &Span) {
    for known in outcomes.iter_mut().skip(span.first).take(span.count) {
        *known = span.outcome;
    }
}
