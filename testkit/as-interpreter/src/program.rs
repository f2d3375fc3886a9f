//! A file as it is loaded.

use std::collections::HashMap;

use crate::error::ParseError;
use crate::names::Names;
use crate::parser::routine;
use crate::routine::{Body, Routine};

/// All programs of a file.
#[derive(Debug, Clone)]
pub struct Program {
    pub(crate) routines: Vec<Routine>,
    pub(crate) globals: HashMap<String, usize>,
}

impl Program {
    /// Loads a file.
    ///
    /// # Errors
    /// The first line that is not of the subset, or that breaks a limit of the language.
    pub fn parse(source: &str) -> Result<Self, ParseError> {
        let mut names = Names::default();
        let mut bodies = Vec::new();
        for (i, line) in source.lines().enumerate() {
            let (number, text) = (i + 1, line.trim());
            let fail = |why: &str| ParseError { line: number, why: why.into() };
            if let Some(head) = text.strip_prefix(".PROGRAM") {
                let name = head.split('(').next().unwrap_or_default().trim();
                let (next, open) =
                    (names.programs.len(), bodies.last().is_some_and(|body: &Body<'_>| !body.closed));
                if open || names.programs.insert(name.into(), next).is_some() {
                    return Err(fail("a program inside of another, or with the name of another"));
                }
                bodies.push(Body { head, line: number, lines: Vec::new(), closed: false });
            } else if let Some(body) = bodies.last_mut().filter(|body| !body.closed) {
                body.closed = text == ".END";
                body.lines.push((number, text));
            } else if !text.is_empty() && !text.starts_with(';') {
                return Err(fail("a statement outside of a program"));
            }
        }
        let routines = bodies.iter().map(|body| routine(body, &mut names)).collect::<Result<_, _>>()?;
        Ok(Self { routines, globals: names.globals })
    }

    /// Returns the number of programs, and the number of all statements.
    pub fn size(&self) -> (usize, usize) {
        (self.routines.len(), self.routines.iter().map(|routine| routine.statements.len()).sum())
    }
}
