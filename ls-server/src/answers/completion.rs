//! `textDocument/completion`: instructions, options, items with their comments, labels, positions, programs.

use fanuc_ls::{Completion, ItemKind, Syntax};
use lsp_types::{
    CompletionItem, CompletionItemKind, CompletionParams, CompletionResponse, CompletionTextEdit,
    Documentation, MarkupContent, MarkupKind, TextEdit,
};

use crate::answer::{Answer, document};
use crate::document::Document;
use crate::folder::Folder;

/// The items that are offered at most.
const MAX_ITEMS: usize = 2000;

pub(crate) fn completion(folder: &Folder, params: CompletionParams) -> Answer<Option<CompletionResponse>> {
    let at = params.text_document_position;
    let document = document(folder, &at.text_document.uri)?;
    let offset = document.offset(at.position);
    let Some(program) = document.unfinished_program() else { return Ok(None) };
    let found = program.completions(offset);
    let mut items = match (within(document, offset), calls(document, offset)) {
        (Some((kind, start)), _) => numbers(folder, document, kind, start, offset),
        (None, Some(start)) => programs(folder, document, start, offset),
        (None, None) => found.iter().map(|completion| word(document, completion)).collect(),
    };
    items.truncate(MAX_ITEMS);
    Ok(Some(CompletionResponse::Array(items)))
}

/// Returns the kind of the item whose brackets contain a byte, such as that of `R[`, and the offset of its number.
fn within(document: &Document, offset: usize) -> Option<(ItemKind, usize)> {
    let before = line_before(document, offset);
    let open = before.rfind('[').filter(|open| !before.get(*open..).unwrap_or("").contains(']'))?;
    let head = before.get(..open)?;
    let letters = head.len() - head.trim_end_matches(|c: char| c.is_ascii_alphabetic() || c == '_').len();
    let kind = ItemKind::named(head.get(head.len() - letters..)?)?;
    Some((kind, offset - (before.len() - open - 1)))
}

/// Returns the offset at which the name of a program begins that is called at a byte.
fn calls(document: &Document, offset: usize) -> Option<usize> {
    let before = line_before(document, offset);
    let word = |c: char| c.is_alphanumeric() || matches!(c, '_' | '-');
    let head = before.trim_end_matches(word);
    let call = head.trim_end();
    let name = call.len() - call.trim_end_matches(word).len();
    let last = call.get(call.len() - name..)?;
    let is_call = ["CALL", "AUFRUF", "RUN", "MONITOR"].iter().any(|name| last.eq_ignore_ascii_case(name));
    (is_call && call.len() < head.len()).then_some(offset - (before.len() - head.len()))
}

fn line_before(document: &Document, offset: usize) -> &str {
    let line = document.lines().range(document.text(), document.lines().line(offset));
    document.at(&(line.start..offset.min(line.end)))
}

/// Returns the numbers of a kind with their names: labels and positions of the program, others of all programs and of the
/// listings.
fn numbers(
    folder: &Folder,
    document: &Document,
    kind: ItemKind,
    start: usize,
    offset: usize,
) -> Vec<CompletionItem> {
    let mut found = folder.names(document);
    found.retain(|(of, _), _| *of == kind);
    for reference in document.index().references().filter(|found| found.kind == kind) {
        // Leave out the number that is being typed.
        if !(reference.digits.start..=reference.digits.end).contains(&offset) {
            found.entry((kind, reference.number)).or_default();
        }
    }
    let is_local = matches!(kind, ItemKind::Label | ItemKind::Position);
    let place = document.converter().range(&(start..offset));
    let item = |((_, number), name): (&(ItemKind, u32), &&str)| {
        // A jump or a motion does not repeat the name.
        let text = if is_local || name.is_empty() { number.to_string() } else { format!("{number}:{name}") };
        CompletionItem {
            label: format!("{kind}[{text}]"),
            detail: (!name.is_empty()).then(|| (*name).to_owned()),
            kind: Some(CompletionItemKind::VARIABLE),
            filter_text: Some(format!("{number}:{name}")),
            sort_text: Some(format!("{number:05}")),
            text_edit: Some(CompletionTextEdit::Edit(TextEdit { range: place, new_text: text })),
            ..CompletionItem::default()
        }
    };
    found.iter().map(item).collect()
}

/// Returns the programs of the folder.
fn programs(folder: &Folder, document: &Document, start: usize, offset: usize) -> Vec<CompletionItem> {
    let place = document.converter().range(&(start..offset));
    let item = |name: &str| {
        let program = folder.program(document, name);
        CompletionItem {
            label: name.to_owned(),
            detail: program.and_then(|program| program.index().comment()).map(str::to_owned),
            kind: Some(CompletionItemKind::FUNCTION),
            text_edit: Some(CompletionTextEdit::Edit(TextEdit { range: place, new_text: name.to_owned() })),
            ..CompletionItem::default()
        }
    };
    folder.programs(document).into_iter().map(item).collect()
}

/// Returns the completion of a word.
fn word(document: &Document, completion: &Completion) -> CompletionItem {
    let Completion { text, place } = completion;
    let mut forms = Syntax::instructions().chain(Syntax::options());
    let syntax = forms.find(|syntax| syntax.words.contains(&text.as_str()));
    let item = text
        .strip_suffix('[')
        .and_then(ItemKind::named)
        .map(|kind| format!("{}, {} to {}", kind.text(), kind.numbers().start(), kind.numbers().end()));
    let documentation = syntax.map(|syntax| {
        Documentation::MarkupContent(MarkupContent { kind: MarkupKind::Markdown, value: syntax.form })
    });
    CompletionItem {
        label: text.clone(),
        detail: item,
        kind: Some(if documentation.is_some() {
            CompletionItemKind::KEYWORD
        } else {
            CompletionItemKind::VARIABLE
        }),
        documentation,
        text_edit: Some(CompletionTextEdit::Edit(TextEdit {
            range: document.converter().range(place),
            new_text: text.clone(),
        })),
        ..CompletionItem::default()
    }
}
