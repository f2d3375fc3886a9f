use alloc::borrow::{Cow, ToOwned};
use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;
use core::fmt;

use crate::attribute::{Attribute, AttributeValue};
use crate::error::{DecodeError, EncodeError};
use crate::instruction::Instruction;
use crate::motion::MotionKind;
use crate::parts::{Parts, at, ends_application, offset};
use crate::position::Position;
use crate::text::{Fault, push_number, word};

/// A TP program as values: the contents of an LS file, without its spelling.
///
/// [`encode`](Self::encode) writes it the way a controller does. The written file reads as the same program. To change a
/// file and leave the rest of it unchanged, use a [`Document`](crate::Document).
#[derive(Debug, Clone, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
pub struct Program {
    /// The name, which is also the file's.
    #[cfg_attr(feature = "arbitrary", arbitrary(with = crate::arbitrary::texts::word))]
    pub name: String,
    /// The word after the name, such as `Macro`; `None` without one.
    #[cfg_attr(feature = "arbitrary", arbitrary(with = crate::arbitrary::texts::name))]
    pub kind: Option<String>,
    /// `/ATTR`, in its sequence. `None` without such a section.
    pub attributes: Option<Vec<Attribute>>,
    /// `/APPL`, its lines as they stand. `None` without such a section.
    #[cfg_attr(feature = "arbitrary", arbitrary(with = crate::arbitrary::texts::application))]
    pub application: Option<Vec<String>>,
    /// `/MN`: the instructions, in their sequence.
    #[cfg_attr(feature = "arbitrary", arbitrary(with = crate::arbitrary::instructions))]
    pub instructions: Vec<Instruction>,
    /// `/POS`: the positions, in their sequence.
    #[cfg_attr(feature = "arbitrary", arbitrary(with = crate::arbitrary::texts::list::<0, 8, _>))]
    pub positions: Vec<Position>,
}

/// The number of characters of a COMMENT that a controller stores.
pub const COMMENT_LENGTH: usize = 16;

/// The rules for a written program.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct Rules {
    /// The longest program name in characters: 36 by default, 8 on old controllers. The limit of each model is not published.
    pub name_limit: usize,
    /// The treatment of a comment of more than [`COMMENT_LENGTH`] characters.
    pub comment: CommentRule,
}

impl Default for Rules {
    fn default() -> Self {
        Self { name_limit: 36, comment: CommentRule::Refuse }
    }
}

/// The treatment of a comment that is too long.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum CommentRule {
    /// The program is refused with [`EncodeError::CommentLength`].
    #[default]
    Refuse,
    /// The comment is truncated to [`COMMENT_LENGTH`] characters.
    Truncate,
}

impl Program {
    /// Decodes an LS file, which must be understood completely. Tolerates differences in blanks, line ends and leading
    /// zeros, and parts that controllers omit.
    ///
    /// # Errors
    /// The first place that cannot be read, by line and column.
    pub fn decode(text: &str) -> Result<Self, DecodeError> {
        Self::from_parts(text, &Parts::find(text)?)
    }

    pub(crate) fn from_parts(text: &str, parts: &Parts) -> Result<Self, DecodeError> {
        let fault = |fault: Fault<'_>| DecodeError::new(text, offset(text, fault.at), fault.reason);
        let attributes = parts.attributes(text).map(|(_, attribute)| attribute);
        let attributes = attributes.collect::<Result<_, _>>().map_err(fault)?;
        Ok(Self {
            name: at(text, &parts.name).to_owned(),
            kind: Some(at(text, &parts.kind)).filter(|kind| !kind.is_empty()).map(ToOwned::to_owned),
            attributes: parts.attributes.is_some().then_some(attributes),
            application: parts.application(text).map(|lines| lines.map(ToOwned::to_owned).collect()),
            instructions: all(parts.statements(text).map(|statement| statement.decode())).map_err(fault)?,
            positions: all(parts.positions(text)).map_err(fault)?,
        })
    }

    /// Writes the program the way a controller does. Nothing is written when it cannot be written whole.
    ///
    /// # Errors
    /// As [`check`](Self::check), or when `out` fails.
    pub fn encode(&self, rules: &Rules, out: &mut impl fmt::Write) -> Result<(), EncodeError> {
        Ok(out.write_str(&self.to_text(rules)?)?)
    }

    /// Checks that the program can be encoded by these rules; [`encode`](Self::encode) checks the same.
    ///
    /// # Errors
    /// The first element that a controller would reject, or that would be decoded differently.
    pub fn check(&self, rules: &Rules) -> Result<(), EncodeError> {
        self.to_text(rules).map(drop)
    }

    /// Encodes as [`encode`](Self::encode) does into a new string.
    ///
    /// # Errors
    /// As [`check`](Self::check).
    pub fn to_text(&self, rules: &Rules) -> Result<String, EncodeError> {
        let mut out = String::with_capacity(self.length());
        self.encode_head(rules, &mut out)?;
        out.push_str("/MN\r\n");
        let (mut number, mut in_block) = (0u32, false);
        for instruction in &self.instructions {
            let nested = matches!(instruction, Instruction::Nested(_));
            if !nested {
                number += 1;
                push_number(&mut out, number, 4);
                out.push(':');
            }
            let start = out.len();
            instruction.encode(&mut out);
            instruction.check(number as usize, in_block, out.get(start..).unwrap_or(""))?;
            out.push_str(if nested { "\r\n" } else { " ;\r\n" });
            in_block = nested;
        }
        out.push_str("/POS\r\n");
        for position in &self.positions {
            position.check()?;
            position.encode(&mut out);
        }
        out.push_str("/END\r\n");
        Ok(out)
    }

    /// Writes the text before `/MN`.
    fn encode_head(&self, rules: &Rules, out: &mut String) -> Result<(), EncodeError> {
        check_name(&self.name, rules.name_limit)?;
        if self.kind.as_deref().is_some_and(|kind| kind.trim() != kind || kind.is_empty() || !is_line(kind)) {
            return Err(EncodeError::Name);
        }
        let comments = self.attributes.iter().flatten().filter_map(Attribute::comment);
        let too_long = comments.map(|comment| comment.chars().count()).find(|found| *found > COMMENT_LENGTH);
        if let Some(found) = too_long.filter(|_| rules.comment == CommentRule::Refuse) {
            return Err(EncodeError::CommentLength { found });
        }
        out.push_str("/PROG  ");
        out.push_str(&self.name);
        if let Some(kind) = &self.kind {
            out.push_str("\t  ");
            out.push_str(kind);
        }
        out.push_str("\r\n");
        if let Some(attributes) = &self.attributes {
            out.push_str("/ATTR\r\n");
            for (index, attribute) in (1..).zip(attributes) {
                // A comment that was cut may have lost one of its quotes.
                let attribute = fitting(attribute);
                let start = out.len();
                attribute.encode(out);
                attribute.check(index, out.get(start..).unwrap_or(""))?;
                out.push_str("\r\n");
            }
        }
        if let Some(application) = &self.application {
            out.push_str("/APPL\r\n");
            for (index, line) in (1..).zip(application) {
                if !is_line(line) || ends_application(line) {
                    return Err(EncodeError::Application { index });
                }
                out.push_str(line.trim_end());
                out.push_str("\r\n");
            }
        }
        Ok(())
    }

    /// Returns the approximate length of the text: a position of six axes has 200 bytes.
    fn length(&self) -> usize {
        256 + 40 * self.instructions.len() + 200 * self.positions.len()
    }

    /// Returns the text of an attribute, unchanged. `None` if the attribute is missing, or a list.
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

    /// Returns COMMENT without its quotes and padding blanks.
    pub fn comment(&self) -> Option<&str> {
        self.attributes.iter().flatten().find_map(Attribute::comment)
    }

    /// Sets COMMENT.
    pub fn set_comment(&mut self, comment: &str) {
        self.set_attribute("COMMENT", &format!("\"{comment}\""));
    }

    /// Returns the number of numbered lines of `/MN`: every instruction except the nested ones.
    pub fn line_count(&self) -> usize {
        self.instructions.iter().filter(|i| !matches!(i, Instruction::Nested(_))).count()
    }

    /// Returns the number of motions of a kind.
    pub fn motions(&self, kind: MotionKind) -> usize {
        self.instructions.iter().filter(|i| matches!(i, Instruction::Motion(m) if m.kind == kind)).count()
    }

    /// Returns the position with this number.
    pub fn position(&self, number: u32) -> Option<&Position> {
        self.positions.iter().find(|position| position.number == number)
    }
}

impl core::str::FromStr for Program {
    type Err = DecodeError;

    fn from_str(text: &str) -> Result<Self, DecodeError> {
        Self::decode(text)
    }
}

/// Returns an attribute whose comment is truncated to the allowed length; a comment that must not be truncated was rejected
/// before.
fn fitting(attribute: &Attribute) -> Cow<'_, Attribute> {
    let comment = attribute.comment().unwrap_or_default();
    let Some((end, _)) = comment.char_indices().nth(COMMENT_LENGTH) else { return Cow::Borrowed(attribute) };
    let cut = comment.get(..end).unwrap_or(comment).trim_end();
    Cow::Owned(Attribute::text(&attribute.name, &format!("\"{cut}\"")))
}

/// Collects results, with a capacity that `collect` would not know.
fn all<T, E>(results: impl Iterator<Item = Result<T, E>>) -> Result<Vec<T>, E> {
    let mut values = Vec::with_capacity(results.size_hint().0);
    for result in results {
        values.push(result?);
    }
    Ok(values)
}

pub(crate) fn check_name(name: &str, limit: usize) -> Result<(), EncodeError> {
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
