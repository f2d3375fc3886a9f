//! Tables of comma-separated values.

use std::fs::{File, OpenOptions};
use std::io::{Cursor, Write as _};
use std::path::Path;

use anyhow::{Context as _, Result};
use cellwire_io::output::remark;

/// Returns the rows of a table, each with its line. Lines that begin with `#` are comments.
pub fn rows(text: &str) -> impl Iterator<Item = Result<(u64, csv::StringRecord)>> {
    let mut reader = csv::ReaderBuilder::new();
    reader.has_headers(false).flexible(true).comment(Some(b'#')).trim(csv::Trim::All);
    // The reader counts CR LF one record late.
    let text = text.replace("\r\n", "\n") + "\n";
    let mut records = reader.from_reader(Cursor::new(text)).into_records();
    core::iter::from_fn(move || {
        let record = records.next()?.context("no table");
        // The line before the one that is read next: a record's own position is that of the remarks before it.
        let line = records.reader().position().line() - 1;
        Some(record.map(|record| (line, record)))
    })
}

/// A table to which rows are appended.
#[derive(Debug)]
pub struct AppendedTable {
    file: File,
    /// The contents of the rows, in a word.
    what: &'static str,
}

impl AppendedTable {
    /// Opens the table at `path`. A new one begins with `names`, unless that list is empty.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn open(path: &Path, what: &'static str, names: &[&str]) -> Result<Self> {
        let context = || format!("cannot write {}", path.display());
        let file = OpenOptions::new().append(true).create(true).open(path).with_context(context)?;
        let mut table = Self { file, what };
        if !names.is_empty() && table.file.metadata()?.len() == 0 {
            table.write(names).with_context(context)?;
        }
        Ok(table)
    }

    /// Appends a row. A failure is a warning on standard error.
    pub fn add(&mut self, row: impl IntoIterator<Item = String>) {
        if let Err(error) = self.write(row) {
            remark(&format!("warning: cannot write the record of {}: {error:#}", self.what));
        }
    }

    fn write(&mut self, row: impl IntoIterator<Item: AsRef<[u8]>>) -> Result<()> {
        let mut line = csv::Writer::from_writer(Vec::new());
        line.write_record(row)?;
        Ok(self.file.write_all(&line.into_inner().unwrap_or_default())?)
    }
}
