//! `textDocument/formatting` and `onTypeFormatting`: the layout of a controller, and the numbers of lines while they are typed.

use core::ops::Range;

use lsp_types::{DocumentFormattingParams, DocumentOnTypeFormattingParams, TextEdit};

use super::rename::changed;
use crate::answer::{Answer, document};
use crate::document::Document;
use crate::edits;
use crate::folder::Folder;
use crate::position::Lines;

pub(crate) fn format(folder: &Folder, params: DocumentFormattingParams) -> Answer<Option<Vec<TextEdit>>> {
    let document = document(folder, &params.text_document.uri)?;
    changed(document, fanuc_ls::Document::format).map(Some)
}

/// Returns the edits after a key. After a line end, the new line gets its number and the previous one its `;`; after a `;`,
/// all lines get their numbers. Text after the cursor in its line stays, and the cursor is at the point at which typing
/// continues.
pub(crate) fn on_type(
    folder: &Folder,
    params: DocumentOnTypeFormattingParams,
) -> Answer<Option<Vec<TextEdit>>> {
    let at = params.text_document_position;
    let document = document(folder, &at.text_document.uri)?;
    let cursor = document.offset(at.position);
    Ok(match params.ch.as_str() {
        "\n" => broken(document, cursor),
        ";" => renumbered(document.text()).map(|new| edits::between(document, &new)),
        _ => None,
    })
}

/// Returns a program's text with numbered lines; `None` if the text is not a program.
fn renumbered(text: &str) -> Option<String> {
    let mut program = fanuc_ls::Document::decode(text).ok()?;
    program.renumber_lines().ok()?;
    Some(program.as_str().to_owned())
}

/// Returns the edits after a line of `/MN` was split at the cursor.
fn broken(document: &Document, cursor: usize) -> Option<Vec<TextEdit>> {
    let (text, lines) = (document.text(), document.lines());
    let line = lines.line(cursor);
    let (before, own) = (lines.range(text, line.checked_sub(1)?), lines.range(text, line));
    let (blanks, rest) = (text.get(own.start..cursor)?, text.get(cursor..own.end)?.trim());
    if !blanks.trim().is_empty() || !is_in_main(text.get(..own.start)?) {
        return None;
    }
    let previous = document.at(&before).trim();
    if previous.is_empty() && split(rest).is_some_and(|(number, _)| !number.is_empty()) {
        // The line end is before a numbered line: the text above it is a line of its own.
        let new = [text.get(..before.start)?, "   0:   ;", text.get(before.end..)?].concat();
        return Some(edits::between(document, &renumbered(&new)?));
    }
    let statement = split(previous);
    if statement.is_none() && previous != "/MN" || split(rest).is_some() {
        return None;
    }
    let (number, body) = statement.unwrap_or(("", ";"));
    let is_open = !body.is_empty() && !body.ends_with(';');
    let next = document.at(&lines.range(text, line + 1));
    let has_more = split(next.trim()).is_some_and(|(number, _)| number.is_empty());
    let is_circle_begun = !number.is_empty() && is_circle_begun(body);
    if is_open && (is_circle_begun || has_more || !matches!(rest, "" | ";")) {
        return Some(vec![typed(document, own.start..cursor, "    :  ")]);
    }
    let mut new = text.get(..before.start + document.at(&before).trim_end().len())?.to_owned();
    new.push_str(if body.is_empty() {
        "   ;"
    } else if is_open {
        " ;"
    } else {
        ""
    });
    new.push_str(text.get(before.end..own.start)?);
    // The number is for `renumber_lines` to correct.
    new.push_str("   0:  ");
    new.push_str(rest);
    new.push_str(if rest.ends_with(';') { "" } else { " ;" });
    new.push_str(text.get(own.end..)?);
    let new = renumbered(&new)?;
    let own_new = new.get(Lines::new(&new).range(&new, line))?;
    let number = own_new.get(..own_new.find(':')?)?;
    let mut edits = edits::between(document, &new);
    edits.retain(|edit| edit.range.start.line as usize != line);
    edits.push(typed(document, own.start..cursor, &format!("{number}:  ")));
    Some(edits)
}

/// Splits a line of `/MN` into its number, which is empty if the line continues a statement, and the text after the colon. `None`
/// for another line.
fn split(line: &str) -> Option<(&str, &str)> {
    let (number, body) = line.split_once(':')?;
    let number = number.trim_end();
    number.bytes().all(|byte| byte.is_ascii_digit()).then(|| (number, body.trim()))
}

/// Returns whether a circular motion has only the first of its two positions.
fn is_circle_begun(body: &str) -> bool {
    body.strip_prefix("C ").is_some_and(|rest| {
        let positions = rest.match_indices('[').filter(|(at, _)| {
            let head = rest.get(..*at).unwrap_or("");
            head.ends_with('P') || head.ends_with("PR")
        });
        positions.count() == 1
    })
}

/// Returns an edit that replaces the blanks before the cursor by `text`; the cursor is then after the text.
fn typed(document: &Document, blanks: Range<usize>, text: &str) -> TextEdit {
    let found = document.at(&blanks);
    let (place, text) = match text.strip_prefix(found) {
        Some(rest) => (blanks.end..blanks.end, rest),
        None => (blanks, text),
    };
    TextEdit { range: document.converter().range(&place), new_text: text.to_owned() }
}

/// Returns whether the last section that begins in a text is `/MN`.
fn is_in_main(text: &str) -> bool {
    text.lines().rev().map(str::trim_end).find(|line| line.starts_with('/') && !line.starts_with("//"))
        == Some("/MN")
}
