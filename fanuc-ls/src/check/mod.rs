//! Checks a program beyond the layout of its file: statements, values, blocks, labels, frames, positions.

mod flow;
mod motion;
mod positions;
mod values;

use alloc::collections::{BTreeMap, BTreeSet};
use alloc::string::String;
use alloc::vec::Vec;

use crate::attribute::AttributeValue;
use crate::finding::Problem;
use crate::grammar;
use crate::instruction::Instruction;
use crate::mistake::Mistake;
use crate::motion::Motion;
use crate::operation::Operation;
use crate::parts::{Parts, at, offset};
use crate::position::Position;

/// The known surroundings of a program.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct CheckContext {
    /// The names of the programs that it may call, in capitals. None: any may be there.
    pub programs: Option<BTreeSet<String>>,
    /// The names of the controller's macros, in capitals.
    pub macros: BTreeSet<String>,
    /// The first words of instructions, motion options and operands that the table does not have, such as those of an
    /// application: a text that begins with one of them, in capitals or not, is not a finding.
    pub instructions: BTreeSet<String>,
    /// The name of the program's file, without its extension. None: it has no file, or any name.
    pub file: Option<String>,
}

impl CheckContext {
    /// Returns whether a text begins with one of [`instructions`](Self::instructions).
    fn has_instruction(&self, text: &str) -> bool {
        self.instructions.iter().any(|head| {
            let begin = text.split_at_checked(head.len());
            // Digits may follow: `ACC50`.
            let ends = |rest: &str| !rest.starts_with(|c: char| c.is_alphabetic() || c == '_');
            begin.is_some_and(|(begin, rest)| {
                !head.is_empty() && begin.eq_ignore_ascii_case(head) && ends(rest)
            })
        })
    }

    fn has_macro(&self, name: &str) -> bool {
        self.macros.contains(&name.to_uppercase())
    }
}

/// A statement, and its meaning.
struct Line<'a> {
    /// The text of the instruction.
    place: &'a str,
    what: LineKind,
}

enum LineKind {
    /// Nothing: empty, a comment, a remark, a line of the block of a motion.
    Nothing,
    Motion(Motion),
    Operation(Operation),
    /// A line that is not understood, which is a finding already.
    Unknown,
}

/// The findings so far, each with its byte.
struct Findings<'a> {
    text: &'a str,
    around: &'a CheckContext,
    found: Vec<(usize, Problem)>,
}

impl Findings<'_> {
    fn add(&mut self, at: &str, mistake: Mistake) {
        self.found.push((offset(self.text, at), Problem::Mistake(mistake)));
    }

    /// Adds the mistake of the text `unknown`, unless it is one of the instructions that the caller has named.
    fn add_unknown(&mut self, at: &str, unknown: &str, mistake: Mistake) {
        let is_unknown = matches!(
            mistake,
            Mistake::Unknown
                | Mistake::UnknownItem
                | Mistake::UnknownOption
                | Mistake::Misspelled { .. }
                | Mistake::Similar { .. }
                | Mistake::Macro
        );
        if !(is_unknown && self.around.has_instruction(unknown)) {
            self.add(at, mistake);
        }
    }
}

/// Finds every mistake in a text.
pub(crate) fn find(text: &str, parts: &Parts, around: &CheckContext) -> Vec<(usize, Problem)> {
    let mut found = Findings { text, around, found: Vec::new() };
    let (mut open, mut is_block) = (None, false);
    let lines: Vec<Line<'_>> = { parts.statements(text) }
        .map(|statement| {
            let place = statement.body();
            open = open.filter(|_| statement.is_nested());
            let what = match statement.decode() {
                Ok(Instruction::Empty | Instruction::Comment(_)) => LineKind::Nothing,
                Ok(Instruction::Nested(_)) => {
                    let what = nested(statement.text(), &mut open, &mut found);
                    // A line that is only indented as one of a block: no motion is above it.
                    if is_block { LineKind::Nothing } else { what }
                }
                Ok(Instruction::Motion(motion)) => {
                    motion::check(&motion, place, &mut found);
                    LineKind::Motion(motion)
                }
                Ok(_) => read(place, &mut found),
                Err(_) => LineKind::Unknown,
            };
            if !statement.is_nested() {
                is_block = matches!(what, LineKind::Motion(_) | LineKind::Unknown);
            }
            Line { place, what }
        })
        .collect();
    let mask = mask(text, parts, &mut found);
    let positions: BTreeMap<u32, Position> =
        parts.positions(text).filter_map(Result::ok).map(|position| (position.number, position)).collect();
    flow::blocks(&lines, &mut found);
    flow::labels(&lines, &mut found);
    flow::unreachable(&lines, &mut found);
    flow::skips(&lines, &mut found);
    flow::frames(&lines, &positions, &mut found);
    let moves = lines.iter().find(|line| matches!(line.what, LineKind::Motion(_)));
    if let (Some(line), Some(mask)) = (moves, &mask)
        && !mask.contains(&true)
    {
        found.add(line.place, Mistake::NoGroup);
    }
    positions::check(text, parts, mask.as_deref(), &mut found);
    // A template has many untaught positions: report the first.
    let mut is_template = false;
    found.found.retain(|(_, problem)| {
        *problem != Problem::Mistake(Mistake::Untaught) || !core::mem::replace(&mut is_template, true)
    });
    found.found
}

/// Checks a line of the block of a motion, if it ends an instruction; `open` is the offset at which that has begun, if it is
/// not in this line. Returns the instruction.
fn nested(line: &str, open: &mut Option<usize>, found: &mut Findings<'_>) -> LineKind {
    let begin = open.take().unwrap_or(offset(found.text, line));
    let end = offset(found.text, line) + line.trim_end().len();
    let instruction = found.text.get(begin..end).unwrap_or("");
    let Some(instruction) = instruction.strip_suffix(';') else {
        *open = Some(begin);
        return LineKind::Nothing;
    };
    let body = instruction.trim_start().trim_start_matches(|c: char| c.is_ascii_digit());
    match body.strip_prefix(':').map(str::trim) {
        Some(body) if !body.is_empty() && !body.starts_with('!') => read(body, found),
        _ => LineKind::Nothing,
    }
}

fn read(place: &str, found: &mut Findings<'_>) -> LineKind {
    let name = place.split('(').next().unwrap_or("").trim();
    match grammar::operation(place) {
        // A name that the caller knows, even if it is similar to another one. Only the labels in its text are checked.
        Err(_) if found.around.has_instruction(place) || found.around.has_macro(name) => {
            LineKind::Operation(Operation::Command { name: "", operands: Vec::new(), text: place.into() })
        }
        Ok(operation) => {
            values::check(&operation, place, found);
            if !matches!(operation, Operation::Macro { .. })
                && let Some(word) = grammar::in_capitals(place)
            {
                found.add(place, Mistake::Capitals { word });
            }
            match operation.action() {
                Operation::Macro { name, .. } if !found.around.has_macro(name) => {
                    found.add_unknown(place, name, Mistake::Macro);
                }
                Operation::Call { program, .. } | Operation::Run(program) | Operation::Monitor(program) => {
                    // A register may have the name.
                    let programs = found.around.programs.as_ref();
                    let is_missing =
                        programs.is_some_and(|programs| !programs.contains(&program.to_uppercase()));
                    if is_missing && !program.contains(['[', '.']) {
                        found.add(place, Mistake::MissingProgram);
                    }
                }
                _ => {}
            }
            match operation {
                Operation::Remark(_) | Operation::Disabled(_) => LineKind::Nothing,
                operation => LineKind::Operation(operation),
            }
        }
        Err(trouble) => {
            // Report a missing word at the end of the statement.
            let missing =
                if trouble.at.is_empty() { place.get(place.len()..).unwrap_or("") } else { trouble.at };
            found.add_unknown(missing, trouble.at, trouble.mistake);
            LineKind::Unknown
        }
    }
}

/// Returns the motion groups that the program has, from its attributes.
fn mask(text: &str, parts: &Parts, found: &mut Findings<'_>) -> Option<Vec<bool>> {
    let mut mask = None;
    for (place, attribute) in parts.attributes(text) {
        let Ok(attribute) = attribute else { continue };
        let AttributeValue::Text(value) = &attribute.value else { continue };
        let is_taken = match attribute.name.as_str() {
            "DEFAULT_GROUP" => {
                mask = attribute.groups();
                mask.is_some()
            }
            "PROTECT" => ["READ_WRITE", "READ"].contains(&value.as_str()),
            _ => true,
        };
        if !is_taken {
            found.add(at(text, &place), Mistake::Attribute);
        }
    }
    mask
}
