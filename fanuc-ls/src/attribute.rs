use alloc::string::{String, ToString};
use alloc::vec::Vec;

use crate::error::{EncodeError, Reason};
use crate::text::{ParseResult, expect, fail, is_letter};

/// One entry of `/ATTR`, as in the text: `OWNER = MNEDITOR;`.
#[derive(Debug, Clone, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
pub struct Attribute {
    /// The name of the attribute: `OWNER`; `SPEICHERGR.` on controllers set to German.
    #[cfg_attr(feature = "arbitrary", arbitrary(with = crate::arbitrary::texts::attribute_name))]
    pub name: String,
    /// The value of the attribute.
    pub value: AttributeValue,
}

/// The value of an attribute.
#[derive(Debug, Clone, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
pub enum AttributeValue {
    /// `= text;`, with its quotes, if it has them.
    Text(
        #[cfg_attr(feature = "arbitrary", arbitrary(with = crate::arbitrary::texts::attribute_text))] String,
    ),
    /// `: NAME = text, NAME = text;`, as `TCD` has it.
    List(
        #[cfg_attr(feature = "arbitrary", arbitrary(with = crate::arbitrary::texts::attribute_list))]
        Vec<(String, String)>,
    ),
}

impl Attribute {
    /// Creates `name = text;`
    pub fn text(name: &str, text: &str) -> Self {
        Self { name: name.to_string(), value: AttributeValue::Text(text.to_string()) }
    }

    /// Returns whether the attribute is LINE_COUNT, which a controller may call ZEILEN.
    pub(crate) fn is_line_count(&self) -> bool {
        matches!(self.name.as_str(), "LINE_COUNT" | "ZEILEN")
    }

    pub(crate) fn decode(input: &str) -> ParseResult<'_, Self> {
        let (rest, name) = decode_name(input, Reason::Attribute)?;
        let (rest, value) = if let Some(rest) = rest.strip_prefix(':') {
            let (rest, list) = decode_list(rest)?;
            (rest, AttributeValue::List(list))
        } else {
            let rest = expect(rest, "=", Reason::AttributeValue)?;
            let (rest, text) = decode_value(rest, &[';'])?;
            (rest, AttributeValue::Text(text))
        };
        let rest = expect(rest, ";", Reason::AttributeEnd)?;
        Ok((rest, Self { name: name.to_string(), value }))
    }

    /// Returns COMMENT (KOMMENTAR on controllers set to German) without its quotes and padding blanks.
    pub fn comment(&self) -> Option<&str> {
        match &self.value {
            AttributeValue::Text(text) if matches!(self.name.as_str(), "COMMENT" | "KOMMENTAR") => Some(
                text.strip_prefix('"').and_then(|text| text.strip_suffix('"')).unwrap_or(text).trim_end(),
            ),
            _ => None,
        }
    }

    /// Returns DEFAULT_GROUP as a mask: whether the program moves the first motion group, the second, and so on:
    /// `1,*,*,*,*`.
    pub fn groups(&self) -> Option<Vec<bool>> {
        let AttributeValue::Text(text) = &self.value else { return None };
        let group = |text: &str| match text.trim() {
            "1" => Some(true),
            "*" => Some(false),
            _ => None,
        };
        text.split(',').map(group).collect()
    }

    /// Returns the value of a text attribute as it is in the text.
    pub(crate) fn value_place(input: &str) -> Option<&str> {
        let (rest, attribute) = Self::decode(input).ok()?;
        let entry = input.get(..input.len() - rest.len())?.strip_suffix(';')?;
        match attribute.value {
            AttributeValue::Text(_) => entry.split_once('=').map(|(_, value)| value.trim()),
            AttributeValue::List(_) => None,
        }
    }

    /// Rejects an attribute whose text would be decoded differently. `index` is its position, from 1; `written` is its text
    /// by [`encode`](Self::encode).
    pub(crate) fn check(&self, index: usize, written: &str) -> Result<(), EncodeError> {
        let same = Self::decode(written).is_ok_and(|(rest, again)| rest.is_empty() && again == *self);
        if same { Ok(()) } else { Err(EncodeError::Attribute { index }) }
    }

    /// Writes one entry, with its value in the column of controllers.
    pub(crate) fn encode(&self, out: &mut String) {
        out.push_str(&self.name);
        match &self.value {
            AttributeValue::Text(text) => {
                out.push_str(if self.name.chars().count() < 8 { "\t\t" } else { "\t" });
                out.push_str("= ");
                out.push_str(text);
                out.push(';');
            }
            AttributeValue::List(list) => {
                out.push_str(":  ");
                for (index, (item, text)) in list.iter().enumerate() {
                    if index > 0 {
                        out.push_str(",\r\n      ");
                    }
                    out.push_str(item);
                    out.push_str("\t= ");
                    out.push_str(text);
                }
                out.push(';');
            }
        }
    }
}

/// Reads the text before the next `=` or `:`.
fn decode_name(input: &str, reason: Reason) -> ParseResult<'_, &str> {
    let length = input.find(['=', ':', ';', ',', '\r', '\n']).unwrap_or(input.len());
    let name = input.get(..length).unwrap_or(input).trim_end();
    if name.is_empty() || name.contains([' ', '\t', '"']) {
        return fail(input, reason);
    }
    Ok((input.get(length..).unwrap_or(""), name))
}

fn decode_list(input: &str) -> ParseResult<'_, Vec<(String, String)>> {
    let mut items = Vec::new();
    let mut rest = input;
    loop {
        let (after, name) = decode_name(rest.trim_start(), Reason::AttributeValue)?;
        let after = expect(after, "=", Reason::AttributeValue)?;
        let (after, text) = decode_value(after, &[';', ','])?;
        items.push((name.to_string(), text));
        match after.strip_prefix(',') {
            Some(next) => rest = next,
            None => return Ok((after, items)),
        }
    }
}

/// Decodes the text before one of `ends`, which may be between quotes; a line end in it becomes a space.
fn decode_value<'a>(input: &'a str, ends: &[char]) -> ParseResult<'a, String> {
    let (mut quoted, mut line_start) = (false, 0);
    let mut end = None;
    for (at, c) in input.char_indices() {
        match c {
            '"' => quoted = !quoted,
            '\r' | '\n' if quoted => {
                // A quote within the quotes: the last one is right before the end of the line.
                let line = input.get(line_start..at).unwrap_or("").trim_end();
                let closed = line
                    .strip_suffix(ends)
                    .filter(|text| text.ends_with('"') && text.matches('"').count() > 1);
                end = closed.map(|text| line_start + text.len());
                break;
            }
            _ if !quoted && ends.contains(&c) => {
                end = Some(at);
                break;
            }
            '\n' if begins_another(input.get(at + 1..).unwrap_or("")) => break,
            '\n' => line_start = at + 1,
            _ => {}
        }
    }
    let Some((value, rest)) = end.and_then(|at| input.split_at_checked(at)) else {
        return fail(input, Reason::AttributeEnd);
    };
    let mut text = String::new();
    for line in value.lines().map(str::trim).filter(|line| !line.is_empty()) {
        if !text.is_empty() {
            text.push(' ');
        }
        text.push_str(line);
    }
    Ok((rest, text))
}

/// Returns whether another attribute begins here: an attribute without its `;` ends at the next one.
fn begins_another(rest: &str) -> bool {
    rest.starts_with(is_letter) && rest.lines().next().is_some_and(|line| line.contains(['=', ':']))
}
