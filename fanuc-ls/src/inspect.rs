//! Everything there is to find in a text.

use alloc::collections::{BTreeMap, BTreeSet};
use alloc::vec::Vec;

use crate::attribute::AttributeValue;
use crate::check::{self, CheckContext};
use crate::error::{Reason, Warning};
use crate::finding::{Finding, Problem, placed};
use crate::instruction::Instruction;
use crate::motion::{Motion, Speed, Target};
use crate::parts::{Parts, at, offset};
use crate::program::{COMMENT_LENGTH, Rules, check_name};
use crate::statement::Statement;
use crate::text::{is_letter_or_digit, line_number};

/// Returns all findings in a text, in sequence.
pub(crate) fn find(text: &str, parts: &Parts, rules: &Rules, around: &CheckContext) -> Vec<Finding> {
    let is_template =
        !parts.positions(text).any(|position| position.is_ok_and(|position| position.is_taught()));
    let is_copy = at(text, &parts.name).starts_with('-') && at(text, &parts.name).ends_with('-');
    let mut found = reading(text, parts, rules);
    // The editor's copy of a program, and a template whose positions are for others to teach.
    found.retain(|(offset, problem)| match problem {
        // A motion to a point of a pallet, `PAL_1[A_1]`, is not read as values. Controllers have it.
        Problem::Error(Reason::Target) => {
            let (before, after) = text.split_at_checked(*offset).unwrap_or((text, ""));
            !(before.ends_with("PAL") && after.starts_with('_'))
        }
        Problem::Warning(Warning::Name) => !is_copy,
        Problem::Warning(Warning::UntaughtPosition { .. }) => !is_template,
        _ => true,
    });
    let is_other = |file: &&str| !file.eq_ignore_ascii_case(at(text, &parts.name));
    if around.file.as_deref().filter(is_other).is_some() {
        found.push((parts.name.start, Problem::Warning(Warning::FileName)));
    }
    found.extend(check::find(text, parts, around));
    found.sort_by_key(|(offset, _)| *offset);
    placed(text, &found)
}

/// Returns the findings in the layout of a text, and in its names and numbers.
pub(crate) fn layout(text: &str, parts: &Parts, rules: &Rules) -> Vec<Finding> {
    placed(text, &reading(text, parts, rules))
}

fn reading(text: &str, parts: &Parts, rules: &Rules) -> Vec<(usize, Problem)> {
    let mut check = Check { text, parts, found: Vec::new() };
    check.name(rules);
    let line_count = check.attributes();
    let mut used = UsedPositions::default();
    check.statements(&mut used, line_count);
    check.positions(&used);
    check.found.sort_by_key(|(offset, _)| *offset);
    check.found
}

struct Check<'a> {
    text: &'a str,
    parts: &'a Parts,
    found: Vec<(usize, Problem)>,
}

/// The positions that instructions name.
#[derive(Default)]
struct UsedPositions<'a> {
    numbers: BTreeSet<u32>,
    /// One is chosen when the program runs, `P[R[1]]`: it may be any.
    any: bool,
    /// The first motion to each.
    motions: BTreeMap<u32, &'a str>,
}

impl<'a> Check<'a> {
    fn error(&mut self, at: &str, reason: Reason) {
        self.found.push((offset(self.text, at), Problem::Error(reason)));
    }

    fn warn(&mut self, offset: usize, warning: Warning) {
        self.found.push((offset, Problem::Warning(warning)));
    }

    fn name(&mut self, rules: &Rules) {
        let name = at(self.text, &self.parts.name);
        let (found, limit) = (name.chars().count(), rules.name_limit);
        if check_name(name, usize::MAX).is_err() {
            self.warn(self.parts.name.start, Warning::Name);
        } else if found > limit {
            self.error(name, Reason::NameLength { found, limit });
        }
    }

    /// Checks the attributes; returns the place of LINE_COUNT, and its value.
    fn attributes(&mut self) -> Option<(usize, usize)> {
        let mut line_count = None;
        for (place, attribute) in self.parts.attributes(self.text) {
            match attribute {
                Err(fault) => self.error(fault.at, fault.reason),
                Ok(attribute) => {
                    let found = attribute.comment().map_or(0, |comment| comment.chars().count());
                    if found > COMMENT_LENGTH {
                        self.warn(place.start, Warning::CommentLength { found });
                    }
                    if attribute.is_line_count()
                        && let AttributeValue::Text(count) = attribute.value
                    {
                        line_count = Some(place.start).zip(line_number(&count));
                    }
                }
            }
        }
        line_count
    }

    fn statements(&mut self, used: &mut UsedPositions<'a>, line_count: Option<(usize, usize)>) {
        let (mut last, mut count, mut numbered, mut is_off) = (0usize, 0, true, false);
        let before = self.found.len();
        for statement in self.parts.statements(self.text) {
            used.note(statement.text());
            if statement.is_nested() {
                continue;
            }
            count += 1;
            match statement.number() {
                Some(found) => {
                    let expected = last.saturating_add(1);
                    // Two in a row: the numbers do not count the lines, and the controller will.
                    numbered &= found == expected || !is_off;
                    is_off = found != expected;
                    if is_off && numbered {
                        let place = statement.text().trim_start();
                        self.warn(offset(self.text, place), Warning::LineNumber { expected, found });
                    }
                    last = found;
                }
                // A post-processor's file: the controller counts.
                None => numbered = false,
            }
            match statement.decode() {
                Err(fault) => self.error(fault.at, fault.reason),
                Ok(Instruction::Motion(motion)) => self.motion(&motion, statement, used),
                Ok(_) => {}
            }
        }
        // A line that is missing has shown already.
        if let Some((offset, expected)) = line_count.filter(|(_, expected)| ![0, count].contains(expected))
            && self.found.len() == before
        {
            self.warn(offset, Warning::LineCount { expected, found: count });
        }
    }

    fn motion(&mut self, motion: &Motion, statement: Statement<'a>, used: &mut UsedPositions<'a>) {
        let place = statement.body();
        if motion.speed.unit().is_some_and(|unit| !unit.fits(motion.kind)) {
            self.warn(offset(self.text, place), Warning::SpeedUnit);
        } else if matches!(motion.speed, Speed::Fixed { value, unit } if !unit.range().contains(&value)) {
            self.error(place, Reason::SpeedRange);
        }
        for target in [motion.via.as_ref(), Some(&motion.target)].into_iter().flatten() {
            if let Target::Position { number, .. } = target {
                used.motions.entry(*number).or_insert(place);
            }
        }
    }

    fn positions(&mut self, used: &UsedPositions<'a>) {
        let mut defined = BTreeMap::new();
        for (position, block) in self.parts.positions(self.text).zip(&self.parts.blocks) {
            let position = match position {
                Ok(position) => position,
                Err(fault) => {
                    self.error(fault.at, fault.reason);
                    // The position is defined, even if it is wrong.
                    let words = at(self.text, block).strip_prefix("P[").unwrap_or("");
                    if let Some(number) = leading_number(words) {
                        defined.entry(number).or_insert(1);
                    }
                    continue;
                }
            };
            let number = position.number;
            let times = defined.entry(number).or_insert(0);
            *times += 1;
            match *times {
                1 if !used.any && !used.numbers.contains(&number) => {
                    self.warn(block.start, Warning::UnusedPosition { number });
                }
                2 => self.warn(block.start, Warning::RepeatedPosition { number }),
                _ => {}
            }
            if position.groups.iter().flat_map(|group| &group.axes).any(|axis| axis.value.is_none()) {
                self.warn(block.start, Warning::UntaughtPosition { number });
            }
        }
        for (&number, place) in &used.motions {
            if !defined.contains_key(&number) {
                self.warn(offset(self.text, place), Warning::UndefinedPosition { number });
            }
        }
    }
}

impl UsedPositions<'_> {
    /// Notes every `P[n]` in an instruction's text: `PR[1]=P[3]` uses it as well.
    fn note(&mut self, text: &str) {
        for (at, _) in text.match_indices("P[") {
            let before = text.get(..at).and_then(|head| head.chars().next_back());
            // The motion letter may be right after a number and its colon.
            if before.is_some_and(|c| is_letter_or_digit(c) || c == '_') {
                continue;
            }
            match leading_number(text.get(at + 2..).unwrap_or("")) {
                Some(number) => _ = self.numbers.insert(number),
                None => self.any = true,
            }
        }
    }
}

fn leading_number(text: &str) -> Option<u32> {
    let text = text.trim_start();
    let digits = text.find(|c: char| !c.is_ascii_digit()).unwrap_or(text.len());
    text.get(..digits)?.parse().ok()
}
