//! The contents of a document as entries, each with its place and findings.

use alloc::vec::Vec;
use core::ops::Range;

use crate::attribute::Attribute;
use crate::error::Reason;
use crate::finding::{Finding, Problem};
use crate::instruction::Instruction;
use crate::parts::{Parts, at, offset};
use crate::position::Position;
use crate::statement::Statement;
use crate::text::Fault;

/// A part of a file that is read in one piece: its head, an attribute, a statement, a position.
#[derive(Debug, Clone, PartialEq)]
pub struct Entry<'a> {
    /// The bytes of the entry in the text, without white space around it.
    pub place: Range<usize>,
    /// The contents as values. `None` if they are not understood.
    pub content: Option<Content<'a>>,
    /// If the contents are not understood, the reason; then the other findings.
    pub findings: Vec<Finding>,
}

/// The contents of an [`Entry`].
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum Content<'a> {
    /// The line of `/PROG`: the name of the program.
    Program {
        /// The name of the program.
        name: &'a str,
        /// The word after the name, such as `Macro`; `None` without one.
        kind: Option<&'a str>,
    },
    /// An attribute of `/ATTR`.
    Attribute(Attribute),
    /// A line of `/APPL` that is not blank.
    Application(&'a str),
    /// A line of `/MN`.
    Statement {
        /// The number of the line. `None` if it is left out, or the line belongs to the motion above it.
        number: Option<usize>,
        /// The instruction as a value.
        instruction: Instruction,
    },
    /// A position of `/POS`.
    Position(Position),
}

/// Finds all entries of a text, in sequence, with these findings.
pub(crate) fn find<'a>(text: &'a str, parts: &Parts, findings: Vec<Finding>) -> Vec<Entry<'a>> {
    let mut entries = Entries {
        text,
        found: Vec::new(),
        findings: findings.into_iter().map(|finding| (finding, false)).collect(),
    };
    let kind = Some(at(text, &parts.kind)).filter(|kind| !kind.is_empty());
    let end = if kind.is_some() { parts.kind.end } else { parts.name.end };
    let name = at(text, &parts.name);
    entries.push(parts.name.start..end, Ok(Content::Program { name, kind }));
    for (place, attribute) in parts.attributes(text) {
        entries.push(place, attribute.map(Content::Attribute));
    }
    for line in parts.application(text).into_iter().flatten() {
        if !line.trim().is_empty() {
            entries.push(trimmed(text, line), Ok(Content::Application(line)));
        }
    }
    for (place, nested) in &parts.statements {
        let statement = Statement::new(at(text, place), *nested);
        let number = statement.number().filter(|_| !nested);
        let content = statement.decode().map(|instruction| Content::Statement { number, instruction });
        entries.push(trimmed(text, statement.text()), content);
    }
    for block in &parts.blocks {
        let block = at(text, block);
        entries.push(trimmed(text, block), Position::decode_block(block).map(Content::Position));
    }
    entries.with_findings()
}

/// Returns the range of a part of a text, without white space around it.
fn trimmed(text: &str, part: &str) -> Range<usize> {
    let start = offset(text, part.trim_start());
    start..start + part.trim().len()
}

struct Entries<'a> {
    text: &'a str,
    found: Vec<Entry<'a>>,
    /// Each, and whether it is an entry's already.
    findings: Vec<(Finding, bool)>,
}

impl<'a> Entries<'a> {
    fn push(&mut self, place: Range<usize>, content: Result<Content<'a>, Fault<'a>>) {
        let mut findings = Vec::new();
        if let Err(fault) = &content {
            findings.extend(self.take(offset(self.text, fault.at), fault.reason));
        }
        self.found.push(Entry { place, content: content.ok(), findings });
    }

    /// Takes the finding of a fault. The fault's offset may be after its entry, at the beginning of the next one.
    fn take(&mut self, offset: usize, reason: Reason) -> Option<Finding> {
        let first = self.findings.partition_point(|(finding, _)| finding.offset < offset);
        let there = self.findings.get_mut(first..)?.iter_mut().take_while(|(f, _)| f.offset == offset);
        let problem = Problem::Error(reason);
        let (finding, is_taken) = { there }.find(|(finding, _)| finding.problem == problem)?;
        *is_taken = true;
        Some(*finding)
    }

    fn with_findings(self) -> Vec<Entry<'a>> {
        let mut entries = self.found;
        for (finding, _) in self.findings.into_iter().filter(|(_, is_taken)| !is_taken) {
            let behind = entries.partition_point(|entry| entry.place.start <= finding.offset);
            if let Some(entry) = entries.get_mut(behind.saturating_sub(1)) {
                entry.findings.push(finding);
            }
        }
        entries
    }
}
