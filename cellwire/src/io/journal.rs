//! What became of the parts of some work, in a file that outlives the process: what was done is not done twice unasked.
//!
//! One JSON object a line: first the head, which says of what work the journal is, then the entries. Each is on the disk before
//! [`append`](Journal::append) returns. Who notes what is about to be sent before it is sent leaves that unknown when killed, and
//! nothing else.

use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use fs4::FileExt;
use serde::Serialize;
use serde::de::DeserializeOwned;

/// The file of the journal of the work that is in a file: beside it.
pub fn beside(work: &Path) -> PathBuf {
    let mut name = work.file_name().unwrap_or_default().to_owned();
    name.push(".journal");
    work.with_file_name(name)
}

/// A journal that no other process writes meanwhile.
#[derive(Debug)]
pub struct Journal {
    path: PathBuf,
    file: File,
}

impl Journal {
    /// Opens the journal of the work that `head` stands for, or begins it, and gives each entry to `take`, in order. With `again`,
    /// what it says of an earlier run is forgotten. `work` is what people call it.
    ///
    /// # Errors
    /// When another process has it open, or it is the journal of other work, or none.
    pub fn open<H, E>(path: &Path, work: &str, head: &H, again: bool, take: impl FnMut(E)) -> Result<Self>
    where
        H: Serialize + DeserializeOwned + PartialEq,
        E: DeserializeOwned,
    {
        let what = || format!("the journal {}", path.display());
        let file = OpenOptions::new().read(true).append(true).create(true).open(path).with_context(what)?;
        ensure!(
            file.metadata().with_context(what)?.is_file(),
            "{} is no file: a journal is read again",
            path.display()
        );
        if FileExt::try_lock(&file).is_err() {
            bail!("another process runs this {work}: it holds {}", path.display());
        }
        if again {
            file.set_len(0).with_context(what)?;
        }
        let mut journal = Self { path: path.to_owned(), file };
        if !journal.read(work, head, take).with_context(what)? {
            journal.append(head)?;
        }
        Ok(journal)
    }

    /// Its file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes an entry, safely on the disk.
    ///
    /// # Errors
    /// When the disk does not take it.
    pub fn append(&mut self, entry: &impl Serialize) -> Result<()> {
        let what = || format!("cannot write the journal {}", self.path.display());
        let mut line = serde_json::to_vec(entry)?;
        line.push(b'\n');
        self.file.write_all(&line).with_context(what)?;
        self.file.sync_data().with_context(what)
    }

    /// Reads what is there; false when there is nothing. A last line that was not written to its end is removed.
    fn read<H, E>(&mut self, work: &str, head: &H, mut take: impl FnMut(E)) -> Result<bool>
    where
        H: DeserializeOwned + PartialEq,
        E: DeserializeOwned,
    {
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
            let foreign = || format!("line {number} is none of a journal; remove the file to begin anew");
            if number > 1 {
                take(serde_json::from_slice(&line).ok().with_context(foreign)?);
                continue;
            }
            let found: H = serde_json::from_slice(&line).ok().with_context(foreign)?;
            ensure!(
                found == *head,
                "it is of another {work}: the file was changed since it was run. Finish the earlier {work}, or begin this one \
                 with --again"
            );
        }
        self.file.set_len(whole)?;
        Ok(number > 0)
    }
}
