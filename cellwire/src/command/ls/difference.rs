//! A file before and after an edit, and the difference between them.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use fanuc_ls::Document;
use similar::TextDiff;

use cellwire_io::files;
use cellwire_io::output::printable;

/// A file as it is, and as it shall be.
pub(super) struct Change {
    path: PathBuf,
    bytes: Vec<u8>,
    before: String,
    pub(super) document: Document,
}

impl Change {
    /// Reads a file without changes yet.
    pub(super) fn read(path: &Path) -> Result<Self> {
        let bytes = std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
        let document = Document::decode_bytes(&bytes)
            .with_context(|| format!("{}: `cellwire ls check` shows more", path.display()))?;
        Ok(Self { path: path.to_path_buf(), bytes, before: document.to_string(), document })
    }

    pub(super) fn is_none(&self) -> bool {
        self.document.as_str() == self.before
    }

    /// Returns the changed lines and those around them, as `diff -u` prints them.
    pub(super) fn shown(&self) -> String {
        // Line ends stay as they are, and a carriage return is not one for a terminal.
        let (before, after) =
            (self.before.replace("\r\n", "\n"), self.document.as_str().replace("\r\n", "\n"));
        let name = self.path.display().to_string();
        let difference = TextDiff::from_lines(&before, &after);
        printable(&difference.unified_diff().context_radius(1).header(&name, &name).to_string())
    }

    /// Writes the file, whole or not at all.
    pub(super) fn write(&self) -> Result<()> {
        let bytes = self.document.to_bytes();
        if bytes == self.bytes { Ok(()) } else { files::write(&self.path, &bytes) }
    }
}
