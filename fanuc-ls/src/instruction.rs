use alloc::string::String;

use crate::error::EncodeError;
use crate::motion::{Motion, MotionKind};
use crate::text::{Fault, indent, is_nested, is_plain, join_lines, plain_number, push_number, trim};

/// One instruction of `/MN`. The writer numbers them; a TP program jumps to labels, never to numbers.
///
/// In texts, a line feed stands for a line end that the controller continues with `:`.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
#[non_exhaustive]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
pub enum Instruction {
    /// A line with nothing in it.
    Empty,
    /// `!` and the text after it, including a leading space.
    Comment(#[cfg_attr(feature = "arbitrary", arbitrary(with = crate::arbitrary::texts::comment))] String),
    /// `UFRAME_NUM=`: the user frame of the following motions.
    UserFrame(u16),
    /// `UTOOL_NUM=`: the tool frame of the following motions.
    UserTool(u16),
    /// A motion of the robot.
    Motion(Motion),
    /// Any other instruction as it stands, without the spaces around it.
    Other(#[cfg_attr(feature = "arbitrary", arbitrary(with = crate::arbitrary::texts::statement))] String),
    /// A line of the block that belongs to the motion above it (`TB`, `TA`), to the letter: it has a number of its own,
    /// or none, and at least five spaces before it.
    Nested(#[cfg_attr(feature = "arbitrary", arbitrary(with = crate::arbitrary::texts::nested))] String),
}

impl Instruction {
    /// Returns any instruction from its text after `1:`, such as `CALL WELD_ON` or `!comment`. `None` for a motion that cannot be
    /// read.
    pub fn from_text(text: &str) -> Option<Self> {
        Self::decode(text).ok()
    }

    /// Decodes the text between the line's `:` and its `;`.
    pub(crate) fn decode(input: &str) -> Result<Self, Fault<'_>> {
        let body = trim(input);
        if body.is_empty() {
            return Ok(Self::Empty);
        }
        if let Some(comment) = body.strip_prefix('!') {
            let leading: String = comment.chars().take_while(|c| matches!(c, ' ' | '\t')).collect();
            return Ok(Self::Comment(leading + &join_lines(comment)));
        }
        if is_motion(body) {
            return Motion::decode(body).map(|(_, motion)| Self::Motion(motion)).map_err(Fault::of);
        }
        let number = |name| body.strip_prefix(name).and_then(|rest: &str| plain_number(indent(rest)));
        Ok(match (number("UFRAME_NUM="), number("UTOOL_NUM=")) {
            (Some(frame), _) => Self::UserFrame(frame),
            (_, Some(tool)) => Self::UserTool(tool),
            _ => Self::Other(join_lines(body)),
        })
    }

    /// Writes the text between the line's `:` and its ` ;`.
    pub(crate) fn encode(&self, out: &mut String) {
        match self {
            Self::Empty => out.push_str("  "),
            Self::Comment(text) => encode_lines(out, "  !", text),
            Self::UserFrame(number) => encode_number(out, "  UFRAME_NUM=", *number),
            Self::UserTool(number) => encode_number(out, "  UTOOL_NUM=", *number),
            Self::Motion(motion) => motion.encode(out),
            // An alternative of the SELECT above it.
            Self::Other(text) if text.starts_with('=') => encode_lines(out, "         ", text),
            Self::Other(text) => encode_lines(out, "  ", text),
            Self::Nested(text) => out.push_str(text),
        }
    }

    /// Rejects an instruction whose text would be decoded differently. `line` is its number, or for a nested line the number
    /// of the line above it; `written` is its text by [`encode`](Self::encode).
    pub(crate) fn check(&self, line: usize, in_block: bool, written: &str) -> Result<(), EncodeError> {
        let readable = match self {
            Self::Motion(motion) => return motion.check(line, written),
            Self::Empty | Self::UserFrame(_) | Self::UserTool(_) => true,
            Self::Comment(text) | Self::Other(text) => {
                is_plain(text)
                    && Self::decode(written).is_ok_and(|again| again == *self || self.is_padded(&again))
            }
            Self::Nested(text) => {
                text.trim_end() == text && !text.contains(char::is_control) && is_nested(text, line, in_block)
            }
        };
        if readable { Ok(()) } else { Err(EncodeError::Instruction { line }) }
    }

    /// Blanks at the end are not written: `again` may differ in them.
    fn is_padded(&self, again: &Self) -> bool {
        match (self, again) {
            (Self::Comment(a), Self::Comment(b)) | (Self::Other(a), Self::Other(b)) => a.trim_end() == b,
            _ => false,
        }
    }
}

/// Returns whether a body is a motion: a motion letter, a space, and a target.
fn is_motion(body: &str) -> bool {
    let mut chars = body.chars();
    let letter = chars.next().is_some_and(|c| MotionKind::from_letter(c).is_some());
    letter && chars.next().is_some_and(|c| c == ' ' || c == '\t')
}

fn encode_number(out: &mut String, before: &str, number: u16) {
    out.push_str(before);
    push_number(out, number.into(), 0);
}

fn encode_lines(out: &mut String, before: &str, text: &str) {
    out.push_str(before);
    for (index, line) in text.trim_end().split('\n').enumerate() {
        if index > 0 {
            out.push_str("\r\n    :  ");
        }
        out.push_str(line);
    }
}
