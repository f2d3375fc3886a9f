//! `textDocument/formatting` and `onTypeFormatting`: the layout of a controller, and the numbers of lines while they are typed.

use lsp_types::{DocumentFormattingParams, DocumentOnTypeFormattingParams, TextEdit};

use super::rename::changed;
use crate::answer::{Answer, document};
use crate::document::Document;
use crate::edits;
use crate::folder::Folder;

pub(crate) fn format(folder: &Folder, params: DocumentFormattingParams) -> Answer<Option<Vec<TextEdit>>> {
    let document = document(folder, &params.text_document.uri)?;
    changed(document, fanuc_ls::Document::format).map(Some)
}

/// After a line end, the new line gets its number and the previous one its `;`; after a `;`, all lines get their numbers.
pub(crate) fn on_type(
    folder: &Folder,
    params: DocumentOnTypeFormattingParams,
) -> Answer<Option<Vec<TextEdit>>> {
    let at = params.text_document_position;
    let document = document(folder, &at.text_document.uri)?;
    let line = document.lines().line(document.offset(at.position));
    let text = match params.ch.as_str() {
        "\n" => match numbered(document, line) {
            Some(text) => text,
            None => return Ok(None),
        },
        ";" => document.text().to_owned(),
        _ => return Ok(None),
    };
    Ok(fanuc_ls::Document::decode(&text).ok().and_then(|mut program| {
        program.renumber_lines().ok()?;
        Some(edits::between(document, program.as_str()))
    }))
}

/// The text with a statement in a new, empty line of `/MN` after a statement; the previous line is closed.
fn numbered(document: &Document, line: usize) -> Option<String> {
    let (text, lines) = (document.text(), document.lines());
    let (before, own) = (lines.range(text, line.checked_sub(1)?), lines.range(text, line));
    if !document.at(&own).trim().is_empty() || !is_in_main(text.get(..own.start)?) {
        return None;
    }
    let previous = document.at(&before);
    let is_statement =
        previous.trim_start().trim_start_matches(|c: char| c.is_ascii_digit()).starts_with(':');
    let is_first = previous.trim() == "/MN";
    if !is_statement && !is_first {
        return None;
    }
    let end = before.start + previous.trim_end().len();
    let mut new = text.get(..end)?.to_owned();
    if is_statement && !previous.trim_end().ends_with(';') {
        new.push_str(" ;");
    }
    new.push_str(text.get(before.end..own.start)?);
    // The number is for `renumber_lines` to correct.
    new.push_str("   0:   ;");
    new.push_str(text.get(own.end..)?);
    Some(new)
}

/// Whether the last section that begins in a text is `/MN`.
fn is_in_main(text: &str) -> bool {
    text.lines().rev().map(str::trim_end).find(|line| line.starts_with('/') && !line.starts_with("//"))
        == Some("/MN")
}
