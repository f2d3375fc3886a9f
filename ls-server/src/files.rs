//! The files in and below a folder.

use std::io;
use std::path::{Path, PathBuf};

/// The files in and below a folder whose names end in one of some endings, in order; a file that is named is itself. Links
/// are not followed, except one that is named.
#[derive(Debug)]
pub struct Walk {
    rest: Vec<(PathBuf, bool)>,
    endings: &'static [&'static str],
    budget: usize,
}

impl Walk {
    /// Walks from `path`. Endings are without the dot, in capitals or not.
    pub fn new(path: &Path, endings: &'static [&'static str]) -> Self {
        Self { rest: vec![(path.to_path_buf(), true)], endings, budget: usize::MAX }
    }

    /// Looks at this many files and folders at most.
    #[must_use]
    pub fn at_most(mut self, entries: usize) -> Self {
        self.budget = entries;
        self
    }

    /// Returns whether a walk has ended because of [`at_most`](Self::at_most).
    pub fn is_cut(&self) -> bool {
        !self.rest.is_empty() && self.budget == 0
    }
}

impl Iterator for Walk {
    type Item = Result<PathBuf, (PathBuf, io::Error)>;

    fn next(&mut self) -> Option<Self::Item> {
        while self.budget > 0
            && let Some((path, named)) = self.rest.pop()
        {
            self.budget -= 1;
            // A link may lead back.
            if path.is_dir() && (named || !path.is_symlink()) {
                let entries = std::fs::read_dir(&path).and_then(|entries| {
                    entries.map(|entry| Ok((entry?.path(), false))).collect::<io::Result<Vec<_>>>()
                });
                match entries {
                    Ok(mut entries) => {
                        entries.sort_by(|a, b| b.cmp(a));
                        self.rest.append(&mut entries);
                    }
                    Err(error) => return Some(Err((path, error))),
                }
            } else if named || has_ending(&path, self.endings) {
                return Some(Ok(path));
            }
        }
        None
    }
}

/// Returns whether a file's name has one of these endings.
pub(crate) fn has_ending(path: &Path, endings: &[&str]) -> bool {
    path.extension().is_some_and(|end| endings.iter().any(|ending| end.eq_ignore_ascii_case(ending)))
}

/// Returns the name of a file without its ending.
pub(crate) fn stem(path: &Path) -> Option<String> {
    path.file_stem().map(|stem| stem.to_string_lossy().into_owned())
}
