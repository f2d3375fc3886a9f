use alloc::borrow::ToOwned;
use alloc::collections::{BTreeMap, BTreeSet};
use alloc::format;
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::fmt;

use crate::attribute::{Attribute, AttributeValue};
use crate::error::{DecodeError, EncodeError, Reason, Warning};
use crate::instruction::{Instruction, is_nested};
use crate::motion::{MotionKind, Target};
use crate::position::Position;
use crate::text::{Fault, Read, expect, fail, or_fail, space, word};

/// A TP program, as one LS file holds it.
///
/// [`decode`](Self::decode) keeps everything that it reads but blanks, empty lines of the file and the numbers of the
/// lines; [`encode`](Self::encode) writes it the way a controller does. What is written reads as the same program.
#[derive(Debug, Clone, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Program {
    /// The name, which is also the file's.
    pub name: String,
    /// What stands behind the name, such as `Macro`.
    pub kind: Option<String>,
    /// `/ATTR`, in its order. None when there is no such section.
    pub attributes: Option<Vec<Attribute>>,
    /// `/APPL`, its lines as they stand. None when there is no such section.
    pub application: Option<Vec<String>>,
    /// `/MN`, in its order.
    pub instructions: Vec<Instruction>,
    /// `/POS`, in its order.
    pub positions: Vec<Position>,
}

/// The characters of a COMMENT that a controller keeps.
pub const COMMENT_LENGTH: usize = 16;

/// What a written program must keep to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct Rules {
    /// The longest name that the controller takes: 36 by default, 8 on old ones. Nobody publishes which has which.
    pub name_limit: usize,
    /// What to do with a comment of more than [`COMMENT_LENGTH`] characters.
    pub comment: CommentRule,
}

impl Default for Rules {
    fn default() -> Self {
        Self { name_limit: 36, comment: CommentRule::Refuse }
    }
}

/// What to do with a comment that is too long.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum CommentRule {
    /// [`EncodeError::CommentLength`].
    #[default]
    Refuse,
    /// Keep what fits.
    Truncate,
}

impl Program {
    /// Reads an LS file. Tolerant in blanks, line ends, leading zeros and what controllers leave out.
    ///
    /// # Errors
    /// The first place that cannot be read, by line and column.
    pub fn decode(text: &str) -> Result<Self, DecodeError> {
        Self::decode_with(text, |_| ())
    }

    /// Like [`decode`](Self::decode), and tells what is suspicious: [`warnings`](Self::warnings), and what only the
    /// text shows, lines whose numbers do not count up.
    ///
    /// # Errors
    /// As [`decode`](Self::decode).
    pub fn decode_with(text: &str, mut warn: impl FnMut(Warning)) -> Result<Self, DecodeError> {
        match decode_program(text, &mut warn) {
            Ok(program) => {
                program.warnings().into_iter().for_each(warn);
                Ok(program)
            }
            Err(fault) => Err(DecodeError::new(text, fault.at, fault.reason)),
        }
    }

    /// Writes the program the way a controller does. Nothing is written when it cannot be written whole.
    ///
    /// # Errors
    /// As [`check`](Self::check), or when `out` fails.
    pub fn encode(&self, rules: &Rules, out: &mut impl fmt::Write) -> Result<(), EncodeError> {
        self.check(rules)?;
        write!(out, "/PROG  {}", self.name)?;
        if let Some(kind) = &self.kind {
            write!(out, "\t  {kind}")?;
        }
        out.write_str("\r\n")?;
        if let Some(attributes) = &self.attributes {
            out.write_str("/ATTR\r\n")?;
            for attribute in attributes {
                self.fitting(attribute).encode(out)?;
                out.write_str("\r\n")?;
            }
        }
        if let Some(application) = &self.application {
            out.write_str("/APPL\r\n")?;
            for line in application {
                write!(out, "{}\r\n", line.trim_end())?;
            }
        }
        out.write_str("/MN\r\n")?;
        let mut number = 0;
        for instruction in &self.instructions {
            if let Instruction::Nested(_) = instruction {
                instruction.encode(out)?;
                out.write_str("\r\n")?;
            } else {
                number += 1;
                write!(out, "{number:4}:")?;
                instruction.encode(out)?;
                out.write_str(" ;\r\n")?;
            }
        }
        out.write_str("/POS\r\n")?;
        for position in &self.positions {
            position.encode(out)?;
        }
        Ok(out.write_str("/END\r\n")?)
    }

    /// [`encode`](Self::encode) into a new string.
    ///
    /// # Errors
    /// As [`check`](Self::check).
    pub fn to_text(&self, rules: &Rules) -> Result<String, EncodeError> {
        let mut text = String::new();
        self.encode(rules, &mut text)?;
        Ok(text)
    }

    /// Whether the program can be written by these rules; [`encode`](Self::encode) asks the same.
    ///
    /// # Errors
    /// The first thing that a controller would refuse, or that would be read again as something else.
    pub fn check(&self, rules: &Rules) -> Result<(), EncodeError> {
        check_name(&self.name, rules.name_limit)?;
        if self.kind.as_deref().is_some_and(|kind| kind.trim() != kind || kind.is_empty() || !is_line(kind)) {
            return Err(EncodeError::Name);
        }
        let found = self.comment().map_or(0, |comment| comment.chars().count());
        if found > COMMENT_LENGTH && rules.comment == CommentRule::Refuse {
            return Err(EncodeError::CommentLength { found });
        }
        for (index, attribute) in (1..).zip(self.attributes.iter().flatten()) {
            // A comment that was cut may have lost one of its quotes.
            let attribute = self.fitting(attribute);
            let mut text = String::new();
            attribute.encode(&mut text)?;
            let same =
                Attribute::decode(&text).is_ok_and(|(rest, again)| rest.is_empty() && again == attribute);
            if !same {
                return Err(EncodeError::Attribute { index });
            }
        }
        for (index, line) in (1..).zip(self.application.iter().flatten()) {
            if !is_line(line) || line.starts_with("/MN") {
                return Err(EncodeError::Application { index });
            }
        }
        let (mut number, mut in_block) = (0, false);
        for instruction in &self.instructions {
            let nested = matches!(instruction, Instruction::Nested(_));
            number += usize::from(!nested);
            instruction.check(number, in_block)?;
            in_block = nested;
        }
        self.positions.iter().try_for_each(Position::check)
    }

    /// What a controller accepts and the author probably did not mean.
    pub fn warnings(&self) -> Vec<Warning> {
        let mut warnings = Vec::new();
        let found = self.comment().map_or(0, |comment| comment.chars().count());
        if found > COMMENT_LENGTH {
            warnings.push(Warning::CommentLength { found });
        }
        let found = self.line_count();
        let counted = self.attribute("LINE_COUNT").and_then(|text| text.parse().ok());
        if let Some(expected) = counted.filter(|&count| count != 0 && count != found) {
            warnings.push(Warning::LineCount { expected, found });
        }
        let mut defined = BTreeMap::new();
        for position in &self.positions {
            let number = position.number;
            *defined.entry(number).or_insert(0) += 1;
            if defined.get(&number) == Some(&2) {
                warnings.push(Warning::RepeatedPosition { number });
            }
            if position.groups.iter().flat_map(|g| &g.axes).any(|axis| axis.value.is_none()) {
                warnings.push(Warning::UntaughtPosition { number });
            }
        }
        let mut used = BTreeSet::new();
        let mut indirect = false;
        let mut line = 0;
        for instruction in &self.instructions {
            line += usize::from(!matches!(instruction, Instruction::Nested(_)));
            match instruction {
                Instruction::Motion(motion) => {
                    if !motion.speed.unit().is_none_or(|unit| unit.fits(motion.kind)) {
                        warnings.push(Warning::SpeedUnit { line });
                    }
                    for target in [motion.via.as_ref(), Some(&motion.target)].into_iter().flatten() {
                        match target {
                            Target::Position { number, .. } => {
                                if !defined.contains_key(number) && used.insert(*number) {
                                    warnings.push(Warning::UndefinedPosition { line, number: *number });
                                }
                                used.insert(*number);
                            }
                            Target::Register { .. } => {}
                            Target::Other(text) => indirect |= text.starts_with("P["),
                        }
                    }
                }
                // `PR[1]=P[3]` uses it as well; `P[R[1]]` may use any.
                Instruction::Other(text) | Instruction::Nested(text) => {
                    indirect |= used_positions(text, &mut used);
                }
                _ => {}
            }
        }
        let unused = defined.keys().filter(|&number| !indirect && !used.contains(number));
        warnings.extend(unused.map(|&number| Warning::UnusedPosition { number }));
        warnings
    }

    /// The text of an attribute, as it stands. None when it is missing, or a list.
    pub fn attribute(&self, name: &str) -> Option<&str> {
        let found = self.attributes.iter().flatten().find(|attribute| attribute.name == name)?;
        match &found.value {
            AttributeValue::Text(text) => Some(text),
            AttributeValue::List(_) => None,
        }
    }

    /// Sets an attribute in its place, or adds it.
    pub fn set_attribute(&mut self, name: &str, text: &str) {
        let attributes = self.attributes.get_or_insert_default();
        let new = Attribute::text(name, text);
        match attributes.iter_mut().find(|attribute| attribute.name == name) {
            Some(attribute) => *attribute = new,
            None => attributes.push(new),
        }
    }

    /// COMMENT without its quotes and the blanks that fill it up.
    pub fn comment(&self) -> Option<&str> {
        let text = self.attribute("COMMENT")?;
        Some(text.strip_prefix('"').and_then(|text| text.strip_suffix('"')).unwrap_or(text).trim_end())
    }

    /// Sets COMMENT.
    pub fn set_comment(&mut self, comment: &str) {
        self.set_attribute("COMMENT", &format!("\"{comment}\""));
    }

    /// The numbered lines of `/MN`: every instruction but the nested ones.
    pub fn line_count(&self) -> usize {
        self.instructions.iter().filter(|i| !matches!(i, Instruction::Nested(_))).count()
    }

    /// How many motions there are of a kind.
    pub fn motions(&self, kind: MotionKind) -> usize {
        self.instructions.iter().filter(|i| matches!(i, Instruction::Motion(m) if m.kind == kind)).count()
    }

    /// The position with this number.
    pub fn position(&self, number: u32) -> Option<&Position> {
        self.positions.iter().find(|position| position.number == number)
    }

    /// The comment cut to its length; `check` has refused it where it must not be cut.
    fn fitting(&self, attribute: &Attribute) -> Attribute {
        let comment = self.comment().unwrap_or_default();
        if attribute.name == "COMMENT" && comment.chars().count() > COMMENT_LENGTH {
            let cut: String = comment.chars().take(COMMENT_LENGTH).collect();
            return Attribute::text("COMMENT", &format!("\"{}\"", cut.trim_end()));
        }
        attribute.clone()
    }
}

impl core::str::FromStr for Program {
    type Err = DecodeError;

    fn from_str(text: &str) -> Result<Self, DecodeError> {
        Self::decode(text)
    }
}

/// A line of the file, without its end, and what follows it.
fn line(input: &str) -> (&str, &str) {
    match input.split_once('\n') {
        Some((line, rest)) => (line.trim_end_matches('\r'), rest),
        None => (input, ""),
    }
}

fn decode_program<'a>(text: &'a str, warn: &mut impl FnMut(Warning)) -> Result<Program, Fault<'a>> {
    match decode_sections(text, warn) {
        Ok((_, program)) => Ok(program),
        Err(nom::Err::Error(fault) | nom::Err::Failure(fault)) => Err(fault),
        Err(nom::Err::Incomplete(_)) => Err(Fault { at: text, reason: Reason::End }),
    }
}

fn decode_sections<'a>(text: &'a str, warn: &mut impl FnMut(Warning)) -> Read<'a, Program> {
    let mut program = Program::default();
    let rest = decode_head(&mut program, text)?;
    let rest = decode_attributes(&mut program, rest)?;
    let rest = decode_application(&mut program, rest)?;
    let (rest, _) = expect(space(rest), "/MN", Reason::Main)?;
    let (tail, rest) = line(rest);
    if !tail.trim().is_empty() {
        return fail(tail, Reason::Main);
    }
    let rest = decode_instructions(&mut program, rest, warn)?;
    let rest = decode_positions(&mut program, rest)?;
    let (rest, _) = expect(rest, "/END", Reason::End)?;
    // CP/M's end-of-file mark still stands at the end of some exports.
    let rest = rest.trim_start_matches([' ', '\t', '\r', '\n', '\u{1a}']);
    if rest.is_empty() { Ok((rest, program)) } else { fail(rest, Reason::Trailing) }
}

type Rest<'a> = Result<&'a str, nom::Err<Fault<'a>>>;

fn decode_head<'a>(program: &mut Program, text: &'a str) -> Rest<'a> {
    let start = space(text.strip_prefix('\u{feff}').unwrap_or(text));
    let (rest, _) = expect(start, "/PROG", Reason::Program)?;
    let (head, rest) = line(rest);
    let (kind, name) = or_fail(head.trim_start(), Reason::Program, name_word)?;
    program.name = name.to_owned();
    program.kind = Some(kind.trim()).filter(|kind| !kind.is_empty()).map(ToString::to_string);
    Ok(rest)
}

/// A name as it may be read: whatever is not blank.
fn name_word(input: &str) -> Read<'_, &str> {
    nom::Parser::parse(&mut nom::bytes::complete::take_while1(|c: char| !c.is_whitespace()), input)
}

fn decode_attributes<'a>(program: &mut Program, input: &'a str) -> Rest<'a> {
    let Some(mut rest) = space(input).strip_prefix("/ATTR") else { return Ok(input) };
    let mut attributes = Vec::new();
    loop {
        rest = space(rest);
        if rest.starts_with('/') || rest.is_empty() {
            program.attributes = Some(attributes);
            return Ok(rest);
        }
        let (after, attribute) = Attribute::decode(rest)?;
        attributes.push(attribute);
        rest = after;
    }
}

fn decode_application<'a>(program: &mut Program, input: &'a str) -> Rest<'a> {
    let start = space(input);
    if !start.starts_with("/APPL") {
        return Ok(input);
    }
    let mut lines = Vec::new();
    let (_, mut rest) = line(start);
    loop {
        if rest.starts_with("/MN") {
            program.application = Some(lines);
            return Ok(rest);
        }
        if rest.is_empty() || rest.starts_with("/POS") || rest.starts_with("/END") {
            return Err(nom::Err::Failure(Fault { at: rest, reason: Reason::Main }));
        }
        let (text, after) = line(rest);
        lines.push(text.trim_end().to_owned());
        rest = after;
    }
}

fn decode_instructions<'a>(
    program: &mut Program,
    input: &'a str,
    warn: &mut impl FnMut(Warning),
) -> Rest<'a> {
    let mut rest = input;
    let mut number = 0usize;
    let mut last = 0;
    let mut in_block = false;
    loop {
        let (text, after) = line(rest);
        if text.starts_with('/') || (text.is_empty() && after.is_empty()) {
            return Ok(rest);
        }
        if text.trim().is_empty() {
            rest = after;
            continue;
        }
        if is_nested(text, last, in_block) {
            in_block = true;
            program.instructions.push(Instruction::Nested(text.trim_end().to_owned()));
            rest = after;
            continue;
        }
        in_block = false;
        let (body, after) = decode_numbered(rest, &mut last)?;
        number += 1;
        if last != number {
            warn(Warning::LineNumber { expected: number, found: last });
        }
        program.instructions.push(Instruction::decode(body).map_err(nom::Err::Failure)?);
        rest = after;
    }
}

/// The number of an instruction's line, what stands between `:` and `;`, and what follows its last line.
fn decode_numbered<'a>(
    input: &'a str,
    number: &mut usize,
) -> Result<(&'a str, &'a str), nom::Err<Fault<'a>>> {
    let start = input.trim_start_matches([' ', '\t']);
    let (body, found) = or_fail(start, Reason::LineNumber, crate::text::unsigned::<usize>)?;
    let (body, _) = expect(body.trim_start_matches([' ', '\t']), ":", Reason::LineNumber)?;
    *number = found;
    let mut rest = body;
    loop {
        let (text, after) = line(rest);
        if let Some(closed) = text.trim_end().strip_suffix(';') {
            let length = body.len() - rest.len() + closed.len();
            return Ok((body.get(..length).unwrap_or(body), after));
        }
        if !after.trim_start_matches([' ', '\t']).starts_with(':') {
            let end = text.get(text.trim_end().len()..).unwrap_or(text);
            return Err(nom::Err::Failure(Fault { at: end, reason: Reason::InstructionEnd }));
        }
        rest = after;
    }
}

fn decode_positions<'a>(program: &mut Program, input: &'a str) -> Rest<'a> {
    let Some(mut rest) = input.strip_prefix("/POS") else { return Ok(input) };
    loop {
        rest = space(rest);
        if rest.starts_with('/') || rest.is_empty() {
            return Ok(rest);
        }
        let (after, position) = Position::decode(rest)?;
        program.positions.push(position);
        rest = after;
    }
}

/// Notes every `P[n]` in an instruction's text; true when one is chosen when the program runs, `P[R[1]]`.
fn used_positions(text: &str, used: &mut BTreeSet<u32>) -> bool {
    let mut indirect = false;
    for (at, _) in text.match_indices("P[") {
        let before = text.get(..at).and_then(|head| head.chars().next_back());
        if before.is_some_and(|c| c.is_alphanumeric() || c == '_') {
            continue;
        }
        let inside = text.get(at + 2..).unwrap_or("");
        let digits: String = inside.trim_start().chars().take_while(char::is_ascii_digit).collect();
        match digits.parse() {
            Ok(number) => _ = used.insert(number),
            Err(_) => indirect = true,
        }
    }
    indirect
}

fn check_name(name: &str, limit: usize) -> Result<(), EncodeError> {
    let letters = word(name).is_ok_and(|(rest, _)| rest.is_empty()) && name.is_ascii();
    if !letters || name.starts_with(|c: char| c.is_ascii_digit()) {
        return Err(EncodeError::Name);
    }
    match name.len() {
        found if found > limit => Err(EncodeError::NameLength { found, limit }),
        _ => Ok(()),
    }
}

fn is_line(text: &str) -> bool {
    !text.contains(|c: char| c.is_control() && c != '\t')
}
