//! One `.PROGRAM`: its lines, and their parsed form.

use crate::statement::Statement;

/// One `.PROGRAM`.
#[derive(Debug, Clone)]
pub(crate) struct Routine {
    pub(crate) name: String,
    pub(crate) parameters: Vec<usize>,
    pub(crate) locals: usize,
    pub(crate) statements: Vec<Statement>,
}

/// The lines of a program before they are read.
#[derive(Debug)]
pub(crate) struct Body<'a> {
    /// The text after `.PROGRAM`.
    pub(crate) head: &'a str,
    pub(crate) line: usize,
    pub(crate) lines: Vec<(usize, &'a str)>,
    pub(crate) closed: bool,
}
