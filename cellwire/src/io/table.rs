//! Tables of comma-separated values.

use std::io::Cursor;

use anyhow::{Context as _, Result};

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
