//! `textDocument/inlayHint`: the comment of an item that is named without it.

use lsp_types::{InlayHint, InlayHintKind, InlayHintLabel, InlayHintParams};

use crate::answer::{Answer, document};
use crate::folder::Folder;

/// The hints that are returned at most.
const MAX_HINTS: usize = 5000;

pub(crate) fn inlay(folder: &Folder, params: InlayHintParams) -> Answer<Option<Vec<InlayHint>>> {
    let document = document(folder, &params.text_document.uri)?;
    let converter = document.converter();
    let range = converter.bytes(params.range);
    let names = folder.names(document);
    let hints = { document.index().references() }
        .filter(|found| found.name.is_none() && !found.is_selection && !found.is_definition)
        .filter(|found| range.contains(&found.letters.start));
    let hint = |found: fanuc_ls::Reference| {
        let name = names.get(&(found.kind, found.number))?;
        Some(InlayHint {
            position: converter.position(found.digits.end),
            label: InlayHintLabel::String(format!(":{name}")),
            kind: Some(InlayHintKind::PARAMETER),
            text_edits: None,
            tooltip: None,
            padding_left: None,
            padding_right: None,
            data: None,
        })
    };
    Ok(Some(hints.filter_map(hint).take(MAX_HINTS).collect()))
}
