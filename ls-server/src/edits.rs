//! Changed texts as edits of an editor, which keep its cursor and marks where nothing has changed.

use core::ops::Range;

use lsp_types::{
    DocumentChanges, OneOf, OptionalVersionedTextDocumentIdentifier, TextDocumentEdit, TextEdit,
    WorkspaceEdit,
};

use crate::document::Document;
use crate::folder::Folder;

/// Returns the edits that turn a document into `new`: the parts of lines that differ, and lines that are inserted or removed
/// in one place.
pub(crate) fn between(document: &Document, new: &str) -> Vec<TextEdit> {
    if document.text() == new {
        return Vec::new();
    }
    let converter = document.converter();
    let edit =
        |(place, text): (Range<usize>, String)| TextEdit { range: converter.range(&place), new_text: text };
    differences(document.text(), new).into_iter().map(edit).collect()
}

fn differences(old: &str, new: &str) -> Vec<(Range<usize>, String)> {
    let (olds, news): (Vec<&str>, Vec<&str>) =
        (old.split_inclusive('\n').collect(), new.split_inclusive('\n').collect());
    let same = olds.iter().zip(&news).take_while(|(old, new)| old == new).count();
    let mut at: usize = olds.iter().take(same).map(|line| line.len()).sum();
    let (mut old_rest, mut new_rest) = (olds.into_iter().skip(same), news.into_iter().skip(same));
    let mut found = Vec::new();
    let (old_count, new_count) = (old_rest.len(), new_rest.len());
    if new_count > old_count {
        found.push((at..at, new_rest.by_ref().take(new_count - old_count).collect()));
    } else if old_count > new_count {
        let length: usize = old_rest.by_ref().take(old_count - new_count).map(str::len).sum();
        found.push((at..at + length, String::new()));
        at += length;
    }
    for (old, new) in old_rest.zip(new_rest) {
        if old != new {
            let (before, after) = common(old, new);
            let changed = new.get(before..new.len() - after).unwrap_or("");
            found.push((at + before..at + old.len() - after, changed.to_owned()));
        }
        at += old.len();
    }
    found
}

/// Returns the numbers of bytes that two lines have in common at their beginning and at their end.
fn common(old: &str, new: &str) -> (usize, usize) {
    let same = |(a, b): &(char, char)| a == b;
    let before: usize = old.chars().zip(new.chars()).take_while(same).map(|(c, _)| c.len_utf8()).sum();
    let (old, new) = (old.get(before..).unwrap_or(""), new.get(before..).unwrap_or(""));
    let after = old.chars().rev().zip(new.chars().rev()).take_while(same).map(|(c, _)| c.len_utf8()).sum();
    (before, after)
}

/// Edits of documents, as the client understands them.
pub(crate) fn workspace(folder: &Folder, edits: Vec<(&Document, Vec<TextEdit>)>) -> WorkspaceEdit {
    if !folder.client.versions {
        #[expect(clippy::mutable_key_type, reason = "the type has it; a URI does not change")]
        let changes = edits.into_iter().map(|(document, edits)| (document.uri().clone(), edits)).collect();
        return WorkspaceEdit { changes: Some(changes), ..WorkspaceEdit::default() };
    }
    let edits = edits.into_iter().map(|(document, edits)| versioned(document, edits)).collect();
    WorkspaceEdit { document_changes: Some(DocumentChanges::Edits(edits)), ..WorkspaceEdit::default() }
}

/// Edits of this version of a document.
pub(crate) fn versioned(document: &Document, edits: Vec<TextEdit>) -> TextDocumentEdit {
    let (uri, version) = (document.uri().clone(), document.version());
    TextDocumentEdit {
        text_document: OptionalVersionedTextDocumentIdentifier { uri, version },
        edits: edits.into_iter().map(OneOf::Left).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the text after the edits, as an editor applies them.
    fn applied(old: &str, edits: &[(Range<usize>, String)]) -> String {
        let (mut text, mut copied) = (String::new(), 0);
        for (place, new) in edits {
            text.push_str(&old[copied..place.start]);
            text.push_str(new);
            copied = place.end;
        }
        text + &old[copied..]
    }

    #[test]
    fn what_does_not_change_is_not_edited() {
        let old = "a 1\nb 2\nc 3\n";
        let cases = [
            (old, vec![]),
            ("a 1\nb 5\nc 3\n", vec![(6..7, "5")]),
            ("a 1\nx\nb 3\nc 4\n", vec![(4..4, "x\n"), (6..7, "3"), (10..11, "4")]),
            ("a 1\nc 2\n", vec![(4..8, ""), (10..11, "2")]),
            ("", vec![(0..12, "")]),
        ];
        for (new, edits) in cases {
            let found = differences(old, new);
            assert_eq!(applied(old, &found), new);
            let shown: Vec<_> = found.iter().map(|(place, text)| (place.clone(), text.as_str())).collect();
            assert_eq!(shown, edits, "{new}");
        }
    }

    #[test]
    fn any_text_becomes_any_other() {
        let mut random = fastrand::Rng::with_seed(7);
        let text = |random: &mut fastrand::Rng| -> String {
            (0..random.usize(..12))
                .map(|_| random.choice(["a", "\n", "\u{e9}", "\r\n", "\u{1f600}", "7"]).unwrap())
                .collect()
        };
        for _ in 0..20_000 {
            let (old, new) = (text(&mut random), text(&mut random));
            assert_eq!(applied(&old, &differences(&old, &new)), new, "{old:?}");
        }
    }
}
