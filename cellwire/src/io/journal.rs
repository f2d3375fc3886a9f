//! What became of the parts of some work, in a file that outlives the process: what was done is not done twice unasked.
//!
//! One JSON object a line: first the head, which says of what work the journal is, then the entries. Each is on the disk before
//! [`note`](Journal::note) returns. Who notes what is about to be sent as unknown before it is sent leaves that unknown when
//! killed, and nothing else.

use std::borrow::Cow;
use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use fs4::FileExt;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

/// The file of the journal of the work that is in a file: beside it.
pub fn beside(work: &Path) -> PathBuf {
    let mut name = work.file_name().unwrap_or_default().to_owned();
    name.push(".journal");
    work.with_file_name(name)
}

/// What is known of a part of the work.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// Never sent, or known not to have been taken.
    NotSent,
    /// It is not to be done again.
    Done,
    /// Nobody knows.
    Unknown,
    /// The machine refuses it.
    Refused,
}

impl Outcome {
    /// Its name in what is printed.
    pub fn name(self) -> &'static str {
        match self {
            Self::NotSent => "not_sent",
            Self::Done => "done",
            Self::Unknown => "unknown",
            Self::Refused => "refused",
        }
    }
}

/// What is known of parts that follow one another.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub struct Span {
    /// It is the same of all of them.
    pub outcome: Outcome,
    /// The first, from 0.
    pub first: usize,
    /// How many they are.
    pub count: usize,
}

/// What the entries of a journal say together. `Vec<Outcome>` is that of work whose entries are outcomes and nothing else.
pub trait Record {
    /// What is noted.
    type Entry: Serialize + DeserializeOwned;

    /// Nothing is known of any part.
    fn new(parts: usize) -> Self;

    /// Takes what was noted.
    fn take(&mut self, entry: &Self::Entry);

    /// What is known of each part; of what is in flight, as it was before.
    fn settled(&self) -> &[Outcome];

    /// What is known of each part if nothing more is heard.
    fn outcomes(&self) -> Cow<'_, [Outcome]> {
        self.settled().into()
    }
}

impl Record for Vec<Outcome> {
    type Entry = Span;

    fn new(parts: usize) -> Self {
        vec![Outcome::NotSent; parts]
    }

    fn take(&mut self, entry: &Span) {
        for known in self.iter_mut().skip(entry.first).take(entry.count) {
            *known = entry.outcome;
        }
    }

    fn settled(&self) -> &[Outcome] {
        self
    }
}

/// Of which work a journal is.
#[derive(Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Head {
    work: String,
    parts: usize,
}

/// A journal that no other process writes meanwhile.
#[derive(Debug)]
pub struct Journal<R> {
    path: PathBuf,
    file: File,
    record: R,
}

impl<R: Record> Journal<R> {
    /// Opens the journal of the work of this fingerprint, or begins it. With `again`, what it says of an earlier run is forgotten.
    /// `work` is what people call it.
    ///
    /// # Errors
    /// When another process has it open, or it is the journal of other work, or none.
    pub fn open(path: &Path, work: &str, fingerprint: String, parts: usize, again: bool) -> Result<Self> {
        let what = || format!("the journal {}", path.display());
        // Not in append mode: on Windows such a file cannot be truncated.
        let mut options = OpenOptions::new();
        options.read(true).write(true).create(true).truncate(false);
        let file = options.open(path).with_context(what)?;
        ensure!(
            file.metadata().with_context(what)?.is_file(),
            "{} is not a regular file, which a journal must be",
            path.display()
        );
        if FileExt::try_lock(&file).is_err() {
            bail!("another process is running this {work}: it has locked {}", path.display());
        }
        if again {
            file.set_len(0).with_context(what)?;
        }
        let head = Head { work: fingerprint, parts };
        let mut journal = Self { path: path.to_owned(), file, record: R::new(parts) };
        if !journal.read(work, &head).with_context(what)? {
            journal.append(&head)?;
        }
        Ok(journal)
    }

    /// Its file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What it says.
    pub fn record(&self) -> &R {
        &self.record
    }

    /// What is known of each part.
    pub fn outcomes(&self) -> Cow<'_, [Outcome]> {
        self.record.outcomes()
    }

    /// How many parts have this outcome.
    pub fn count(&self, outcome: Outcome) -> usize {
        self.outcomes().iter().filter(|known| **known == outcome).count()
    }

    /// The first part with this outcome that is not in flight.
    pub fn first(&self, outcome: Outcome) -> Option<usize> {
        self.record.settled().iter().position(|known| *known == outcome)
    }

    /// The first parts whose outcome is unknown and that are not in flight, and how many in a row.
    pub fn unknown(&self) -> Option<(usize, usize)> {
        let first = self.first(Outcome::Unknown)?;
        let rest = self.record.settled().get(first..).unwrap_or_default();
        Some((first, rest.iter().take_while(|known| **known == Outcome::Unknown).count()))
    }

    /// Writes an entry, safely on the disk.
    ///
    /// # Errors
    /// When the disk does not take it.
    pub fn note(&mut self, entry: &R::Entry) -> Result<()> {
        self.append(entry)?;
        self.record.take(entry);
        Ok(())
    }

    fn append(&mut self, line: &impl Serialize) -> Result<()> {
        let what = || format!("cannot write the journal {}", self.path.display());
        let mut line = serde_json::to_vec(line)?;
        line.push(b'\n');
        self.file.write_all(&line).with_context(what)?;
        self.file.sync_data().with_context(what)
    }

    /// Reads what is there; false when there is nothing. A last line that was not written to its end is removed.
    fn read(&mut self, work: &str, head: &Head) -> Result<bool> {
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
            let foreign = || format!("line {number} is not a journal line; remove the file to start over");
            if number > 1 {
                self.record.take(&serde_json::from_slice(&line).ok().with_context(foreign)?);
                continue;
            }
            let found: Head = serde_json::from_slice(&line).ok().with_context(foreign)?;
            ensure!(
                found == *head,
                "it belongs to another {work}: the file has changed. Finish the earlier {work}, or start this one with --again"
            );
        }
        self.file.set_len(whole)?;
        self.file.seek(SeekFrom::Start(whole))?;
        Ok(number > 0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_journal_is_read_again_but_for_a_torn_line_and_by_one_process_alone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("plate.journal");
        let open = |parts, again| Journal::<Vec<Outcome>>::open(&path, "plate", "5a".into(), parts, again);
        let span = |outcome, first, count| Span { outcome, first, count };
        let mut journal = open(4, false).unwrap();
        journal.note(&span(Outcome::Unknown, 0, 3)).unwrap();
        journal.note(&span(Outcome::Done, 0, 1)).unwrap();
        let error = open(4, false).unwrap_err().to_string();
        assert_eq!(error, format!("another process is running this plate: it has locked {}", path.display()));
        drop(journal);

        let whole = std::fs::read(&path).unwrap();
        std::fs::write(&path, [&whole, &b"{\"outcome\":\"done\",\"fir"[..]].concat()).unwrap();
        let journal = open(4, false).unwrap();
        assert_eq!(
            *journal.outcomes(),
            [Outcome::Done, Outcome::Unknown, Outcome::Unknown, Outcome::NotSent]
        );
        assert_eq!((journal.unknown(), journal.count(Outcome::Unknown)), (Some((1, 2)), 2));
        assert_eq!(std::fs::read(&path).unwrap(), whole);
        drop(journal);

        let error = format!("{:#}", open(5, false).unwrap_err());
        assert!(error.contains("it belongs to another plate"), "{error}");
        assert_eq!(*open(5, true).unwrap().outcomes(), [Outcome::NotSent; 5]);
        std::fs::write(&path, "none\n").unwrap();
        let error = format!("{:#}", open(5, false).unwrap_err());
        assert!(error.ends_with("line 1 is not a journal line; remove the file to start over"), "{error}");
    }
}
