//! Completions at a byte of a program, for an editor.

use alloc::format;
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::ops::Range;

use crate::expression::{Function, ItemKind};
use crate::grammar::{Context, OPTIONS, ROWS};
use crate::operation::Operation;
use crate::parts::{Parts, at, offset};
use crate::statement::Statement;

/// A text that may stand at a place.
#[derive(Debug, Clone, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Completion {
    /// The text that completes the word.
    pub text: String,
    /// The bytes of the document that it would replace: the part of the text that is there already.
    pub place: Range<usize>,
}

/// Returns the completions at this byte.
pub(crate) fn find(text: &str, parts: &Parts, byte: usize) -> Vec<Completion> {
    let within =
        |(range, nested): &&(Range<usize>, bool)| !nested && (range.start..=range.end).contains(&byte);
    let Some((range, _)) = parts.statements.iter().find(within) else { return Vec::new() };
    let body = Statement::new(at(text, range), false).body();
    let start = offset(text, body);
    let Some(before) = text.get(start..byte).filter(|_| !body.starts_with(['!', '/'])) else {
        return Vec::new();
    };
    let word = before.len() - before.trim_end_matches(|c: char| c.is_alphanumeric() || c == '_').len();
    let (head, word) = before.split_at_checked(before.len() - word).unwrap_or(("", before));
    let place = byte - word.len()..byte;
    let begins = |name: &str| name.get(..word.len()).is_some_and(|begin| begin.eq_ignore_ascii_case(word));
    let mut found: Vec<String> = Vec::new();
    if let Some(open) = head.trim_end().strip_suffix('[') {
        found = numbers(text, parts, open);
    } else if matches!(before.as_bytes(), [b'J' | b'L' | b'C' | b'A' | b'S', b' ' | b'\t', ..]) {
        // The letter of a motion is a word of its own: `LBL` and `CALL` begin with one.
        found.extend(OPTIONS.iter().filter_map(|choice| choice.words.first()).map(ToString::to_string));
    } else {
        let is_first = head.trim().is_empty();
        let is_action = head.trim_end().ends_with(',');
        if is_first || is_action {
            let rows = ROWS.iter().filter(|row| is_first || row.place == Context::Anywhere);
            found.extend(rows.filter_map(|row| row.words.first()).map(ToString::to_string));
        }
        found.extend(ItemKind::names().map(|name| format!("{name}[")));
        if !is_first && !is_action {
            found.extend(Function::ALL.iter().map(|(_, name)| name.to_string()));
            found.extend(["ON", "OFF", "LPOS", "JPOS"].map(ToString::to_string));
        }
    }
    found.retain(|name| begins(name));
    found.into_iter().map(|text| Completion { text, place: place.clone() }).collect()
}

/// Returns the labels or positions of the program, if one of them is expected.
fn numbers(text: &str, parts: &Parts, open: &str) -> Vec<String> {
    if open.ends_with("LBL") {
        let labels =
            parts.statements(text).filter_map(|statement| match Operation::decode(statement.body()) {
                Some(Operation::Label(label)) => match label.index {
                    crate::expression::Index::Number(number) => Some(number.to_string()),
                    _ => None,
                },
                _ => None,
            });
        return labels.collect();
    }
    if open.ends_with('P') {
        return parts.positions(text).filter_map(Result::ok).map(|p| p.number.to_string()).collect();
    }
    Vec::new()
}
