//! What is wrong with a program beyond how its file is laid out: statements, values, blocks, labels, frames, positions.

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

/// What is around a program, as far as it is known.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Surroundings {
    /// The names of the programs that it may call, in capitals. None: any may be there.
    pub programs: Option<BTreeSet<String>>,
    /// The names of the controller's macros, in capitals.
    pub macros: BTreeSet<String>,
}

/// A statement, and what it does.
struct Line<'a> {
    /// Its instruction.
    place: &'a str,
    what: What,
}

enum What {
    /// Nothing: empty, a comment, a remark, a line of the block of a motion.
    Nothing,
    Motion(Motion),
    Operation(Operation),
    /// It is not understood, which is a finding already.
    Unknown,
}

/// What is found, each with its byte.
struct Found<'a> {
    text: &'a str,
    around: &'a Surroundings,
    found: Vec<(usize, Problem)>,
}

impl Found<'_> {
    fn add(&mut self, at: &str, mistake: Mistake) {
        self.found.push((offset(self.text, at), Problem::Mistake(mistake)));
    }
}

/// Every mistake in a text.
pub(crate) fn find(text: &str, parts: &Parts, around: &Surroundings) -> Vec<(usize, Problem)> {
    let mut found = Found { text, around, found: Vec::new() };
    let mut open = None;
    let lines: Vec<Line<'_>> = { parts.statements(text) }
        .map(|statement| {
            let place = statement.body();
            open = open.filter(|_| statement.is_nested());
            let what = match statement.decode() {
                Ok(Instruction::Empty | Instruction::Comment(_)) => What::Nothing,
                Ok(Instruction::Nested(_)) => {
                    nested(statement.text(), &mut open, &mut found);
                    What::Nothing
                }
                Ok(Instruction::Motion(motion)) => {
                    motion::check(&motion, place, &mut found);
                    What::Motion(motion)
                }
                Ok(_) => read(place, &mut found),
                Err(_) => What::Unknown,
            };
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
    let moves = lines.iter().find(|line| matches!(line.what, What::Motion(_)));
    if let (Some(line), Some(mask)) = (moves, &mask)
        && !mask.contains(&true)
    {
        found.add(line.place, Mistake::NoGroup);
    }
    positions::check(text, parts, mask.as_deref(), &mut found);
    // What is a template is one in many places.
    let mut is_template = false;
    found.found.retain(|(_, problem)| {
        *problem != Problem::Mistake(Mistake::Untaught) || !core::mem::replace(&mut is_template, true)
    });
    found.found
}

/// A line of the block of a motion, if it ends an instruction; `open` is where that has begun, if not in this line.
fn nested(line: &str, open: &mut Option<usize>, found: &mut Found<'_>) {
    let begin = open.take().unwrap_or(offset(found.text, line));
    let end = offset(found.text, line) + line.trim_end().len();
    let instruction = found.text.get(begin..end).unwrap_or("");
    let Some(instruction) = instruction.strip_suffix(';') else {
        *open = Some(begin);
        return;
    };
    let body = instruction.trim_start().trim_start_matches(|c: char| c.is_ascii_digit());
    let Some(body) = body.strip_prefix(':').map(str::trim) else { return };
    if !body.is_empty() && !body.starts_with('!') {
        read(body, found);
    }
}

fn read(place: &str, found: &mut Found<'_>) -> What {
    match grammar::operation(place) {
        Ok(operation) => {
            values::check(&operation, place, found);
            if !matches!(operation, Operation::Macro { .. })
                && let Some(word) = grammar::in_capitals(place)
            {
                found.add(place, Mistake::Capitals { word });
            }
            let is_known = |names: &BTreeSet<String>, name: &str| names.contains(&name.to_uppercase());
            match operation.action() {
                Operation::Macro { name, .. } if !is_known(&found.around.macros, name) => {
                    found.add(place, Mistake::Macro);
                }
                Operation::Call { program, .. } | Operation::Run(program) | Operation::Monitor(program) => {
                    // A register may have the name.
                    let programs = found.around.programs.as_ref();
                    let is_missing = programs.is_some_and(|programs| !is_known(programs, program));
                    if is_missing && !program.contains(['[', '.']) {
                        found.add(place, Mistake::MissingProgram);
                    }
                }
                _ => {}
            }
            match operation {
                Operation::Remark(_) | Operation::Disabled(_) => What::Nothing,
                operation => What::Operation(operation),
            }
        }
        Err(trouble) => {
            // What is missing is missing behind the last word.
            let missing =
                if trouble.at.is_empty() { place.get(place.len()..).unwrap_or("") } else { trouble.at };
            found.add(missing, trouble.mistake);
            What::Unknown
        }
    }
}

/// Which motion groups the program has.
fn mask(text: &str, parts: &Parts, found: &mut Found<'_>) -> Option<Vec<bool>> {
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
