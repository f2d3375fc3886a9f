//! The outcome of each part of some work, in a file that outlives the process: finished parts are not repeated unasked.
//!
//! One JSON object a line, and its checksum: first the head, which names the work, then the entries. Each is on the disk before
//! [`note`](Journal::note) returns. A run that notes parts as unknown before it sends them leaves these unknown when it is
//! killed, and no others. The head is written with the first entry: a run that sends nothing leaves the journal as it was,
//! with `again` too, and a journal without an entry is of no work.
//!
//! The checksum is the CRC-32 of all lines up to this one, in hex: a changed digit, a missing line and lines in another
//! sequence are damage.

use std::borrow::Cow;
use std::fmt;
use std::fs::{File, OpenOptions};
use std::io::{self, BufRead, BufReader, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use fs4::FileExt;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use cellwire_io::output::counted;

/// Returns the file of the journal of work in a file: next to that file.
pub fn beside(work: &Path) -> PathBuf {
    let mut name = work.file_name().unwrap_or_default().to_owned();
    name.push(".journal");
    work.with_file_name(name)
}

/// A number that distinguishes some work from other work: FNV-1a of its bytes. Its `Display` is for the journal.
#[derive(Debug, Clone, Copy)]
pub struct Fingerprint(u64);

impl Default for Fingerprint {
    fn default() -> Self {
        Self(0xCBF2_9CE4_8422_2325)
    }
}

impl Fingerprint {
    /// Adds bytes.
    pub fn add(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.0 = (self.0 ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01B3);
        }
    }
}

impl fmt::Display for Fingerprint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:016x}", self.0)
    }
}

/// The known outcome of a part of the work.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// The part was never sent, or is known not to have been taken.
    NotSent,
    /// The part was executed, and is not repeated.
    Done,
    /// The part was sent, and whether it was executed is unknown.
    Unknown,
    /// The machine has refused the part, which was not executed.
    Refused,
}

impl Outcome {
    /// Returns the name of the outcome in the output.
    pub fn name(self) -> &'static str {
        match self {
            Self::NotSent => "not_sent",
            Self::Done => "done",
            Self::Unknown => "unknown",
            Self::Refused => "refused",
        }
    }
}

/// The outcome of consecutive parts.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Span {
    /// The outcome of all parts of the span.
    pub outcome: Outcome,
    /// The index of the first part, from 0.
    pub first: usize,
    /// The number of parts of the span, from 1.
    pub count: usize,
}

/// The parts are counted from 1, as in the output.
impl fmt::Display for Span {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { outcome, first, count } = self;
        write!(f, "{} to {} {}", first + 1, first + count, outcome.name().replace('_', " "))
    }
}

/// The numbers of parts of the work with each outcome.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Tally {
    /// The number of all parts.
    pub parts: usize,
    /// The number of finished parts.
    pub done: usize,
    /// The number of parts whose outcome is unknown; sent parts without an outcome among them.
    pub unknown: usize,
    /// The number of unknown parts that the machine has in its queue, as far as is known.
    pub queued: usize,
}

impl fmt::Display for Tally {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { parts, done, unknown, .. } = self;
        write!(f, "{done} of {parts} done, {unknown} unknown")
    }
}

/// An entry could not be written: the disk is full, for example.
#[derive(Debug, thiserror::Error)]
#[error("cannot write the journal {}: {why}; it lacks: {entry}", .path.display())]
pub struct JournalWriteError {
    path: PathBuf,
    why: io::Error,
    entry: String,
}

/// The record of a journal's entries. `Vec<Outcome>` is that of work whose entries are outcomes alone.
pub trait Record {
    /// An entry. Its `Display` is for people.
    type Entry: Serialize + DeserializeOwned + fmt::Display;

    /// Creates outcomes that are all unknown yet.
    fn new(parts: usize) -> Self;

    /// Adds an entry. `None`, and nothing is added, if the entry does not fit the ones before.
    fn take(&mut self, entry: &Self::Entry) -> Option<()>;

    /// Returns the number of parts known to be in the machine's queue.
    fn queued(&self) -> usize {
        0
    }

    /// Returns the known outcome of each part; for a part in flight, the previous one.
    fn settled(&self) -> &[Outcome];

    /// Returns the known outcome of each part if nothing more is received.
    fn outcomes(&self) -> Cow<'_, [Outcome]> {
        self.settled().into()
    }
}

impl Record for Vec<Outcome> {
    type Entry = Span;

    fn new(parts: usize) -> Self {
        vec![Outcome::NotSent; parts]
    }

    fn take(&mut self, entry: &Span) -> Option<()> {
        let end = entry.first.checked_add(entry.count).filter(|_| entry.count > 0)?;
        self.get_mut(entry.first..end)?.fill(entry.outcome);
        Some(())
    }

    fn settled(&self) -> &[Outcome] {
        self
    }
}

/// The work of a journal.
#[derive(Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Head {
    /// The command `run` of this robot.
    pub robot: String,
    /// The fingerprint of the file and of the settings on which the parts depend.
    pub work: String,
    /// The number of parts of the work.
    pub parts: usize,
}

/// A journal that no other process writes meanwhile.
#[derive(Debug)]
pub struct Journal<R> {
    path: PathBuf,
    /// The file; `None` for a journal that is not written.
    file: Option<File>,
    record: R,
    head: Head,
    /// The file has the head and an entry of this work.
    is_begun: bool,
    /// The bytes of its whole lines, and their checksum.
    length: u64,
    sum: u32,
}

impl<R: Record> Journal<R> {
    /// Opens the journal of this work; the file may not exist yet. With `again`, the first entry replaces the entries of an
    /// earlier run of the same robot. `work` is its name for people.
    ///
    /// # Errors
    /// If another process has it open, it is the journal of another robot, or of other work and not `again`, or it is not a
    /// journal.
    pub fn open(path: &Path, work: &str, head: Head, again: bool) -> Result<Self> {
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
        let (record, is_begun) = (R::new(head.parts), false);
        let (path, file) = (path.to_owned(), Some(file));
        let mut journal = Self { path, file, record, head, is_begun, length: 0, sum: 0 };
        journal.check_robot().with_context(what)?;
        if !again {
            journal.read(work).with_context(what)?;
        }
        Ok(journal)
    }

    /// Creates a journal that is not written: its outcomes end with the process.
    pub fn unwritten(parts: usize) -> Self {
        let (record, head) = (R::new(parts), Head { robot: String::new(), work: String::new(), parts });
        Self { path: PathBuf::new(), file: None, record, head, is_begun: true, length: 0, sum: 0 }
    }

    /// Reads the journal of this work, and leaves the file as it is; `None` if it has no entry.
    ///
    /// # Errors
    /// As [`open`](Self::open), but for another process that has it open.
    pub fn look(path: &Path, work: &str, head: Head) -> Result<Option<Self>> {
        let what = || format!("the journal {}", path.display());
        let file = match File::open(path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            file => file.with_context(what)?,
        };
        let (record, is_begun) = (R::new(head.parts), false);
        let (path, file) = (path.to_owned(), Some(file));
        let mut journal = Self { path, file, record, head, is_begun, length: 0, sum: 0 };
        journal.check_robot().and_then(|()| journal.read_lines(work)).with_context(what)?;
        Ok(journal.is_begun.then_some(journal))
    }

    /// Fails if the file has entries of another robot.
    fn check_robot(&mut self) -> Result<()> {
        let Some(file) = &mut self.file else { return Ok(()) };
        file.seek(SeekFrom::Start(0))?;
        let mut lines = BufReader::new(file).split(b'\n').map_while(Result::ok);
        let head = lines.next().and_then(|line| first(&line)).filter(|head| head.robot != self.head.robot);
        let Some(Head { robot, .. }) = head else { return Ok(()) };
        ensure!(
            lines.next().is_none(),
            "it has the outcomes of `run {robot}`: name another file with --journal"
        );
        Ok(())
    }

    /// Returns the path of the journal.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns the contents of the journal.
    pub fn record(&self) -> &R {
        &self.record
    }

    /// Returns the known outcome of each part.
    pub fn outcomes(&self) -> Cow<'_, [Outcome]> {
        self.record.outcomes()
    }

    /// Returns the number of parts with this outcome.
    pub fn count(&self, outcome: Outcome) -> usize {
        self.outcomes().iter().filter(|known| **known == outcome).count()
    }

    /// Returns the numbers of parts with each outcome.
    pub fn tally(&self) -> Tally {
        let (outcomes, queued) = (self.outcomes(), self.record.queued());
        let (mut done, mut unknown) = (0, 0);
        for outcome in &*outcomes {
            done += usize::from(*outcome == Outcome::Done);
            unknown += usize::from(*outcome == Outcome::Unknown);
        }
        Tally { parts: outcomes.len(), done, unknown, queued }
    }

    /// Returns the first part with this outcome that is not in flight.
    pub fn first(&self, outcome: Outcome) -> Option<usize> {
        self.record.settled().iter().position(|known| *known == outcome)
    }

    /// Returns the first parts whose outcome is unknown and that are not in flight, and the number of consecutive ones.
    pub fn unknown(&self) -> Option<(usize, usize)> {
        let first = self.first(Outcome::Unknown)?;
        let rest = self.record.settled().get(first..).unwrap_or_default();
        Some((first, rest.iter().take_while(|known| **known == Outcome::Unknown).count()))
    }

    /// Writes an entry, safely on the disk.
    ///
    /// # Errors
    /// [`JournalWriteError`] if the disk does not accept it.
    pub fn note(&mut self, entry: &R::Entry) -> Result<()> {
        self.write_head().and_then(|()| self.append(entry)).map_err(|why| {
            let path = self.path.clone();
            JournalWriteError { path, why, entry: entry.to_string() }
        })?;
        self.record.take(entry).context("the journal's entries do not fit: please report this as a bug")
    }

    /// Writes the head, before the first entry.
    fn write_head(&mut self) -> io::Result<()> {
        let Some(file) = self.file.as_mut().filter(|_| !self.is_begun) else { return Ok(()) };
        let head = serde_json::to_value(&self.head)?;
        file.set_len(0)?;
        file.seek(SeekFrom::Start(0))?;
        (self.length, self.sum) = (0, 0);
        self.append(&head)?;
        self.is_begun = true;
        Ok(())
    }

    /// Appends a line; after an error the file is unchanged, as far as the disk permits.
    fn append(&mut self, line: &impl Serialize) -> io::Result<()> {
        let Some(file) = &mut self.file else { return Ok(()) };
        let mut line = serde_json::to_vec(line)?;
        let sum = checksum(self.sum, &line);
        writeln!(line, " {sum:08x}")?;
        let written = file.write_all(&line).and_then(|()| file.sync_data());
        if written.is_err() {
            file.set_len(self.length)?;
            file.seek(SeekFrom::Start(self.length))?;
            return written;
        }
        (self.sum, self.length) = (sum, self.length + line.len() as u64);
        Ok(())
    }

    /// Reads the file. A last line without a line feed was not written completely, and is removed.
    fn read(&mut self, work: &str) -> Result<()> {
        self.read_lines(work)?;
        if let Some(file) = self.file.as_mut().filter(|_| self.is_begun) {
            file.set_len(self.length)?;
            file.seek(SeekFrom::Start(self.length))?;
        }
        Ok(())
    }

    /// Reads the whole lines of the file.
    fn read_lines(&mut self, work: &str) -> Result<()> {
        let Some(file) = &mut self.file else { return Ok(()) };
        file.seek(SeekFrom::Start(0))?;
        let mut reader = BufReader::new(file.try_clone()?);
        let (mut line, mut number, mut is_this, mut is_counted) = (Vec::new(), 0_u64, true, true);
        loop {
            line.clear();
            let length = reader.read_until(b'\n', &mut line)? as u64;
            let Some(line) = line.strip_suffix(b"\n") else { break };
            number += 1;
            let (text, sum) = split(line);
            self.sum = checksum(self.sum, text);
            let is_whole = sum == Some(self.sum);
            if number > 1 {
                let entry =
                    Some(text).filter(|_| is_whole).and_then(|text| serde_json::from_slice(text).ok());
                let taken = entry.and_then(|entry| self.record.take(&entry));
                // The parts of other work may be more.
                is_counted &= taken.is_some();
                taken.or((!is_this).then_some(())).with_context(|| self.damage(work, number))?;
            } else {
                is_this = first(line).with_context(|| self.damage(work, number))? == self.head;
            }
            self.length += length;
        }
        ensure!(
            is_this || number <= 1,
            "it belongs to another {work}, of which it has {} as done: the file has changed, or a setting on which its parts depend. \
             Finish the earlier {work}, give the rest as a {work} of its own with another --journal, or do every part of this one with \
             --again, also what is done",
            if is_counted { counted(self.tally().done, "part") } else { "parts".into() }
        );
        self.is_begun = number > 1;
        Ok(())
    }

    /// Returns the error of a damaged line: with the outcomes that are still known, and the next steps.
    fn damage(&self, work: &str, number: u64) -> String {
        let Tally { parts, done, .. } = self.tally();
        let known = match number {
            1 => "nothing is known of what was done".to_owned(),
            _ => format!(
                "the lines before it have {done} of {parts} parts as done, and the machine may have executed more"
            ),
        };
        format!(
            "line {number} is damaged, or not a line of a journal: {known}. Check the machine. To do the rest alone, give it as a {work} of its own; --again does every part of this {work}, finished parts too"
        )
    }
}

/// Returns the head in the first line, if it is whole.
fn first(line: &[u8]) -> Option<Head> {
    let (text, sum) = split(line);
    serde_json::from_slice(text).ok().filter(|_| sum == Some(checksum(0, text)))
}

/// Returns a line without its line feed, and its checksum if it has one.
fn split(line: &[u8]) -> (&[u8], Option<u32>) {
    let sum = line.split_last_chunk::<9>().and_then(|(text, sum)| {
        let sum = sum.strip_prefix(b" ").and_then(|sum| core::str::from_utf8(sum).ok())?;
        Some((text, u32::from_str_radix(sum, 16).ok()?))
    });
    sum.map_or((line, None), |(text, sum)| (text, Some(sum)))
}

/// Returns the checksum of a line after lines with the checksum `before`.
fn checksum(before: u32, line: &[u8]) -> u32 {
    let mut hasher = crc32fast::Hasher::new_with_initial(before);
    hasher.update(line);
    hasher.finalize()
}

#[cfg(test)]
mod tests;
