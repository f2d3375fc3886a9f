//! Edits of a [`Document`]: each changes only the part that it names.

use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;
use core::ops::Range;

use crate::attribute::Attribute;
use crate::document::Document;
use crate::error::EncodeError;
use crate::instruction::Instruction;
use crate::motion::Motion;
use crate::parts::{Parts, at, offset};
use crate::position::Position;
use crate::program::check_name;
use crate::statement::Statement;
use crate::text::{Fault, joint};

/// The range of a text, and its replacement.
pub(crate) type Edit = (Range<usize>, String);

/// Returns the instruction of the statement `index` as a controller prints it, from its text.
///
/// # Errors
/// If the text would be decoded as another instruction.
pub(crate) fn printed(index: usize, text: &str) -> Result<String, EncodeError> {
    let line = index.saturating_add(1);
    let new = Instruction::from_text(text).ok_or(EncodeError::Instruction { line })?;
    let mut written = String::new();
    new.encode(&mut written);
    new.check(line, false, &written)?;
    Ok(written)
}

impl Document {
    /// Sets the name; the file's must be the same.
    ///
    /// # Errors
    /// If it is not letters, digits and `_`, or begins with a digit.
    pub fn set_name(&mut self, name: &str) -> Result<(), EncodeError> {
        check_name(name, usize::MAX)?;
        self.replace(self.parts.name.clone(), name);
        Ok(())
    }

    /// Sets the text of an attribute in its place, or adds the attribute to `/ATTR`.
    ///
    /// # Errors
    /// If the value would be decoded differently, if the attribute is a list, or if there is no `/ATTR`.
    pub fn set_attribute(&mut self, name: &str, value: &str) -> Result<(), EncodeError> {
        let new = Attribute::text(name, value);
        let read =
            self.parts.attributes(&self.text).map(|(place, old)| Ok::<_, Fault<'_>>((place.start, old?)));
        let found = read.flatten().zip(1..).find(|((_, old), _)| old.name == name);
        let index = found.as_ref().map_or(0, |(_, index)| *index);
        let mut line = String::new();
        new.encode(&mut line);
        new.check(index, &line)?;
        let Some(section) = self.parts.attributes.clone() else {
            return Err(EncodeError::Attribute { index });
        };
        let Some(((start, _), _)) = found else {
            let end = section.start + at(&self.text, &section).trim_end().len();
            self.replace(end..end, &format!("{}{line}", self.line_end()));
            return Ok(());
        };
        let old = Attribute::value_place(at(&self.text, &(start..section.end)));
        let Some(old) = old else { return Err(EncodeError::Attribute { index }) };
        let start = offset(&self.text, old);
        self.replace(start..start + old.len(), value);
        Ok(())
    }

    /// Sets the motion of a statement; `index` counts from 0. Unchanged values stay as they are spelled.
    ///
    /// # Errors
    /// If there is no such statement, if it is nested or has no number, or if the motion cannot be encoded.
    pub fn set_motion(&mut self, index: usize, motion: &Motion) -> Result<(), EncodeError> {
        if let Some((place, text)) = self.motion_edit(index, motion)? {
            self.replace(place, &text);
        }
        Ok(())
    }

    /// Returns the place of a statement's motion and its new text; `None` if they are equal.
    pub(crate) fn motion_edit(&self, index: usize, motion: &Motion) -> Result<Option<Edit>, EncodeError> {
        let text = |motion: &Motion| {
            let mut text = String::new();
            motion.encode(&mut text);
            text.truncate(text.trim_end().len());
            text
        };
        let new = text(motion);
        motion.check(index.saturating_add(1), &new)?;
        let old = self.body(index)?;
        let merged = match Instruction::decode(at(&self.text, &old)) {
            Ok(Instruction::Motion(before)) if before == *motion => return Ok(None),
            Ok(Instruction::Motion(before)) => merge(at(&self.text, &old), &text(&before), &new, false),
            _ => None,
        };
        let reads = |text: &String| Instruction::from_text(text) == Some(Instruction::Motion(motion.clone()));
        Ok(Some(self.lines_edit(old, &merged.filter(reads).unwrap_or(new))))
    }

    /// Sets the instruction of a statement by its text, such as `CALL WELD_ON`; `index` counts from 0.
    ///
    /// # Errors
    /// If there is no such statement, if it is nested or has no number, or if the text would be decoded as another
    /// instruction.
    pub fn set_instruction(&mut self, index: usize, text: &str) -> Result<(), EncodeError> {
        let written = printed(index, text)?;
        let old = self.body(index)?;
        // A motion's letter follows the colon directly, any other text after two blanks; existing blanks stay.
        let blanks = self.text.get(..old.start).is_some_and(|before| before.ends_with([' ', '\t']));
        let written = if blanks { written.trim() } else { written.trim_end() };
        let (place, text) = self.lines_edit(old, written);
        self.replace(place, &text);
        Ok(())
    }

    /// Sets the position with this number. Unchanged values stay as they are spelled.
    ///
    /// # Errors
    /// If there is no such position, or if it cannot be encoded.
    pub fn set_position(&mut self, position: &Position) -> Result<(), EncodeError> {
        if let Some((place, text)) = self.position_edit(position)? {
            self.replace(place, &text);
        }
        Ok(())
    }

    /// Returns the place of the position with this number and its new text; `None` if they are equal.
    pub(crate) fn position_edit(&self, position: &Position) -> Result<Option<Edit>, EncodeError> {
        position.check()?;
        let number = position.number;
        let blocks = self.parts.positions(&self.text).zip(&self.parts.blocks);
        let found =
            blocks.filter_map(|(old, block)| Some((old.ok()?, block))).find(|(old, _)| old.number == number);
        let Some((old, block)) = found else { return Err(EncodeError::Position { number }) };
        let text = |position: &Position| {
            let mut text = String::new();
            position.encode(&mut text);
            text.truncate(text.trim_end().len());
            text
        };
        if old == *position {
            return Ok(None);
        }
        let block = block.start..block.start + at(&self.text, block).trim_end().len();
        let (before, new) = (text(&old), text(position));
        let merged = merge(at(&self.text, &block), &before, &new, true);
        let reads = |text: &String| Position::decode_block(text).as_ref() == Ok(position);
        Ok(Some(self.lines_edit(block, &merged.filter(reads).unwrap_or(new))))
    }

    /// Returns the range of the instruction of a statement, without the blanks around it.
    fn body(&self, index: usize) -> Result<Range<usize>, EncodeError> {
        let line = index.saturating_add(1);
        let (range, nested) = self.parts.statements.get(index).ok_or(EncodeError::Instruction { line })?;
        let statement = Statement::new(at(&self.text, range), *nested);
        let body = statement.place().filter(|_| !nested).ok_or(EncodeError::Instruction { line })?;
        let start = offset(&self.text, body);
        Ok(start..start + body.len())
    }

    /// Returns an edit with the line ends of this text.
    pub(crate) fn lines_edit(&self, old: Range<usize>, new: &str) -> Edit {
        (old, new.replace("\r\n", self.line_end()))
    }

    /// Applies edits that do not overlap, all or none; returns the number of edits that have an effect.
    pub(crate) fn apply(&mut self, mut edits: Vec<Edit>) -> Result<usize, EncodeError> {
        edits.retain(|(place, new)| at(&self.text, place) != new);
        if edits.is_empty() {
            return Ok(0);
        }
        edits.sort_by_key(|(place, _)| place.start);
        let (mut text, mut copied) = (String::with_capacity(self.text.len()), 0);
        for (place, new) in &edits {
            text.push_str(self.text.get(copied..place.start).ok_or(EncodeError::Edit)?);
            text.push_str(new);
            copied = place.end;
        }
        text.push_str(at(&self.text, &(copied..self.text.len())));
        self.parts = Parts::find(&text).map_err(|_| EncodeError::Edit)?;
        self.text = text;
        Ok(edits.len())
    }

    fn replace(&mut self, old: Range<usize>, new: &str) {
        self.parts.replaced(old.end, new.len(), old.len());
        self.text.replace_range(old, new);
    }

    pub(crate) fn line_end(&self) -> &'static str {
        let first = self.text.find('\n').and_then(|at| self.text.get(..at));
        if first.is_some_and(|line| line.ends_with('\r')) { "\r\n" } else { "\n" }
    }
}

/// Returns `old` with the differences between `before`, which has the same value, and `after`. `None` if `old` is spelled
/// with other words than `before`. With `in_columns`, a number ends in the column in which it ended.
fn merge(old: &str, before: &str, after: &str, in_columns: bool) -> Option<String> {
    let places = words(old);
    let (before, after) = (SpelledText::new(before), SpelledText::new(after));
    if places.len() != before.words.len() {
        return None;
    }
    let mut text = String::new();
    let mut copied = 0;
    if before.words.len() == after.words.len() {
        for ((place, before), after) in places.iter().zip(before.iter()).zip(after.iter()) {
            if before != after {
                let blanks = old.get(copied..place.start)?;
                let length = if in_columns { place.len() } else { after.len() };
                text.push_str(&aligned(blanks, length, after.len()));
                text.push_str(after);
                copied = place.end;
            }
        }
    } else {
        let head = before.iter().zip(after.iter()).take_while(|(before, after)| before == after).count();
        let most = before.words.len().min(after.words.len()) - head;
        let tail = before.iter().rev().zip(after.iter().rev()).take(most);
        let tail = tail.take_while(|(before, after)| before == after).count();
        let end =
            |places: &[Range<usize>], skip: usize| places.iter().rev().nth(skip).map_or(0, |place| place.end);
        text.push_str(old.get(..end(&places, places.len() - head))?);
        let new = end(&after.words, after.words.len() - head)..end(&after.words, tail);
        text.push_str(after.text.get(new)?);
        copied = end(&places, tail);
    }
    text.push_str(old.get(copied..)?);
    Some(text)
}

/// A text and the places of its words.
struct SpelledText<'a> {
    text: &'a str,
    words: Vec<Range<usize>>,
}

impl<'a> SpelledText<'a> {
    fn new(text: &'a str) -> Self {
        Self { text, words: words(text) }
    }

    fn iter(&self) -> impl DoubleEndedIterator<Item = &'a str> + ExactSizeIterator {
        self.words.iter().map(|place| at(self.text, place))
    }
}

/// Returns the text before a word, with more or fewer blanks before a longer or shorter one, so that columns remain aligned.
fn aligned(before: &str, old: usize, new: usize) -> String {
    let text = before.trim_end_matches(' ');
    let blanks = before.len() - text.len();
    let wanted = if blanks < 2 { blanks } else { (blanks + old).saturating_sub(new).max(1) };
    format!("{text}{:wanted$}", "")
}

/// Returns the ranges of the words of a text: numbers with their sign, letters, or a sign alone. Blanks, line ends and the
/// `:` that continues a line separate words.
pub(crate) fn words(text: &str) -> Vec<Range<usize>> {
    let mut places: Vec<Range<usize>> = Vec::new();
    let mut rest = text;
    loop {
        rest = joint(rest).trim_start();
        let Some(first) = rest.chars().next() else { return places };
        let signed = rest.starts_with(['-', '+']);
        let number = rest.get(usize::from(signed)..).unwrap_or(rest);
        let digits = run(number, |c| c.is_ascii_digit() || c == '.');
        let length = match first {
            _ if digits > 0 => digits + usize::from(signed),
            '*' => run(rest, |c| c == '*'),
            _ => run(rest, |c| c.is_alphabetic() || c == '_').max(first.len_utf8()),
        };
        let start = text.len() - rest.len();
        places.push(start..start + length);
        rest = rest.get(length..).unwrap_or("");
    }
}

/// Returns the number of bytes at the beginning for which `is` is true.
fn run(text: &str, is: impl Fn(char) -> bool) -> usize {
    text.find(|c| !is(c)).unwrap_or(text.len())
}
