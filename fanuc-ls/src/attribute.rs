use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::fmt;

use crate::error::Reason;
use crate::text::{Read, expect, fail, or_fail, space, word};

/// One entry of `/ATTR`, kept as it stands: `OWNER = MNEDITOR;`.
#[derive(Debug, Clone, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Attribute {
    /// Its name: letters, digits and `_`.
    pub name: String,
    /// Its value.
    pub value: AttributeValue,
}

/// What an attribute says.
#[derive(Debug, Clone, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
pub enum AttributeValue {
    /// `= text;`, with its quotes where it has them.
    Text(String),
    /// `: NAME = text, NAME = text;`, as `TCD` has it.
    List(Vec<(String, String)>),
}

impl Attribute {
    /// `name = text;`
    pub fn text(name: &str, text: &str) -> Self {
        Self { name: name.to_string(), value: AttributeValue::Text(text.to_string()) }
    }

    pub(crate) fn decode(input: &str) -> Read<'_, Self> {
        let (rest, name) = or_fail(input, Reason::Attribute, word)?;
        let rest = space(rest);
        let (rest, value) = if let Some(rest) = rest.strip_prefix(':') {
            let (rest, list) = decode_list(rest)?;
            (rest, AttributeValue::List(list))
        } else {
            let (rest, _) = expect(rest, "=", Reason::AttributeValue)?;
            let (rest, text) = decode_value(rest, &[';'])?;
            (rest, AttributeValue::Text(text))
        };
        let (rest, _) = expect(rest, ";", Reason::AttributeEnd)?;
        Ok((rest, Self { name: name.to_string(), value }))
    }

    /// Writes one entry, its value in the column where controllers put it.
    pub(crate) fn encode(&self, out: &mut impl fmt::Write) -> fmt::Result {
        let name = &self.name;
        match &self.value {
            AttributeValue::Text(text) => {
                let tabs = if name.len() < 8 { "\t\t" } else { "\t" };
                let gap = if text.is_empty() { "" } else { " " };
                write!(out, "{name}{tabs}={gap}{text}{}", if text.is_empty() { " ;" } else { ";" })
            }
            AttributeValue::List(list) => {
                write!(out, "{name}:  ")?;
                for (index, (item, text)) in list.iter().enumerate() {
                    let before = if index > 0 { ",\r\n      " } else { "" };
                    write!(out, "{before}{item}\t= {text}")?;
                }
                write!(out, ";")
            }
        }
    }
}

fn decode_list(input: &str) -> Read<'_, Vec<(String, String)>> {
    let mut items = Vec::new();
    let mut rest = input;
    loop {
        let (after, name) = or_fail(space(rest), Reason::AttributeValue, word)?;
        let (after, _) = expect(space(after), "=", Reason::AttributeValue)?;
        let (after, text) = decode_value(after, &[';', ','])?;
        items.push((name.to_string(), text));
        match after.strip_prefix(',') {
            Some(next) => rest = next,
            None => return Ok((after, items)),
        }
    }
}

/// The text before one of `ends`, which may stand in quotes; a line end in it becomes a space.
fn decode_value<'a>(input: &'a str, ends: &[char]) -> Read<'a, String> {
    let mut quoted = false;
    for (at, c) in input.char_indices() {
        match c {
            '"' => quoted = !quoted,
            '\r' | '\n' if quoted => break,
            _ if !quoted && ends.contains(&c) => {
                let (value, rest) = input.split_at_checked(at).unwrap_or((input, ""));
                let mut text = String::new();
                for line in value.lines().map(str::trim).filter(|line| !line.is_empty()) {
                    if !text.is_empty() {
                        text.push(' ');
                    }
                    text.push_str(line);
                }
                return Ok((rest, text));
            }
            '\n' if next_section(input.get(at + 1..).unwrap_or("")) => break,
            _ => {}
        }
    }
    fail(input, Reason::AttributeEnd)
}

/// An attribute without its `;` ends where the next section begins, rather than swallow it.
fn next_section(rest: &str) -> bool {
    ["/APPL", "/MN", "/POS", "/END"].iter().any(|section| rest.starts_with(section))
}
