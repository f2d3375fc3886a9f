use alloc::vec::Vec;
use core::fmt;

use crate::error::{Reason, Warning};
use crate::mistake::{Level, Mistake};

/// A construct in a file that its author should check, and its position.
///
/// Lines and columns count from 1, columns in characters (a tab is one).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Finding {
    /// The problem that was found.
    #[cfg_attr(feature = "serde", serde(flatten))]
    pub problem: Problem,
    /// The line of the text, from 1.
    pub line: usize,
    /// The column in that line, from 1, in characters.
    pub column: usize,
    /// The byte in the text, from 0.
    pub offset: usize,
}

/// The problem of a [`Finding`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(untagged))]
pub enum Problem {
    /// Text that is not understood, and that a controller would not take. It stays as it is spelled.
    #[error(transparent)]
    Error(Reason),
    /// Text that a controller takes, but its author probably did not intend.
    #[error(transparent)]
    Warning(Warning),
    /// A mistake in a statement, or in the relation between statements and positions; its level is its severity.
    #[error(transparent)]
    Mistake(Mistake),
}

impl Problem {
    /// Returns the severity of the finding.
    pub fn level(self) -> Level {
        match self {
            Self::Error(_) | Self::Warning(Warning::SpeedUnit) => Level::Error,
            Self::Warning(_) => Level::Warning,
            Self::Mistake(mistake) => mistake.level(),
        }
    }

    /// Returns whether a controller would reject the program.
    pub fn is_error(self) -> bool {
        self.level() == Level::Error
    }

    /// Returns the advice for the reader of the finding.
    pub fn advice(self) -> &'static str {
        match self {
            Self::Error(_) => "correct it: a controller would not take it",
            Self::Warning(warning) => warning.advice(),
            Self::Mistake(mistake) => mistake.advice(),
        }
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "line {}, column {}: {}", self.line, self.column, self.problem)
    }
}

/// Returns findings with the lines and columns of ascending offsets, in one pass over the text.
pub(crate) fn placed(text: &str, found: &[(usize, Problem)]) -> Vec<Finding> {
    let (mut line, mut line_start, mut passed) = (1, 0, 0);
    let place = |&(offset, problem): &(usize, Problem)| {
        let skipped = text.get(passed..offset).unwrap_or("");
        if let Some(last) = skipped.rfind('\n') {
            line += skipped.matches('\n').count();
            line_start = passed + last + 1;
        }
        passed = offset;
        let column = text.get(line_start..offset).map_or(0, |head| head.chars().count()) + 1;
        Finding { problem, line, column, offset }
    };
    found.iter().map(place).collect()
}
