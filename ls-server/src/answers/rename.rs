//! `textDocument/rename`: the comment or the number of an item, the name of a program with its file.

use core::str::FromStr;

use fanuc_ls::{Document as Program, EncodeError, ItemKind};
use lsp_types::{
    DocumentChangeOperation, DocumentChanges, PrepareRenameResponse, RenameFile, RenameParams, ResourceOp,
    TextDocumentPositionParams, TextEdit, Uri, WorkspaceEdit,
};

use super::target::Target;
use crate::answer::{Answer, Failure, document};
use crate::document::Document;
use crate::folder::{Folder, is_local};
use crate::index::Item;
use crate::{edits, uri};

/// Returns the range that would be renamed, and its name.
pub(crate) fn prepare(
    folder: &Folder,
    params: TextDocumentPositionParams,
) -> Answer<Option<PrepareRenameResponse>> {
    let document = document(folder, &params.text_document.uri)?;
    let found = Target::at(document, document.offset(params.position));
    Ok(found.map(|(target, place)| {
        let placeholder = match target {
            Target::Program(name) => name,
            Target::Item(item) => {
                folder.name_of(document, item).map_or_else(|| item.1.to_string(), str::to_owned)
            }
        };
        PrepareRenameResponse::RangeWithPlaceholder { range: document.converter().range(&place), placeholder }
    }))
}

pub(crate) fn rename(folder: &Folder, params: RenameParams) -> Answer<Option<WorkspaceEdit>> {
    let at = params.text_document_position;
    let document = document(folder, &at.text_document.uri)?;
    match Target::at(document, document.offset(at.position)) {
        None => Err(Failure::refused("there is nothing here that has a name")),
        Some((Target::Program(name), _)) => {
            program(folder, document, &name, params.new_name.trim()).map(Some)
        }
        Some((Target::Item(item), _)) => renamed(folder, document, item, params.new_name.trim()).map(Some),
    }
}

/// Renames an item: a number is its new number, any other text its comment.
fn renamed(folder: &Folder, document: &Document, item: Item, new: &str) -> Answer<WorkspaceEdit> {
    let (kind, number) = item;
    let inner =
        new.strip_prefix(&kind.to_string()).and_then(|rest| rest.strip_prefix('[')?.strip_suffix(']'));
    // A number that is negative or too large is not a comment.
    let to: Option<i128> = inner.unwrap_or(new).trim().parse().ok();
    let none = |to: i128| Failure::refused(format_args!("there is no {kind}[{to}]"));
    let to = to.map(|to| u32::try_from(to).map_err(|_| none(to))).transpose()?;
    if to.is_none() {
        // The name is refused before a program that is typed at the moment.
        probe()?.set_item_name(kind, number, new).map_err(Failure::refused)?;
    }
    let documents =
        folder.neighbours(document).filter(|other| !is_local(item) || other.uri() == document.uri());
    let mut found = Vec::new();
    for other in documents {
        if let Some(to) =
            to.filter(|to| *to != number && kind != ItemKind::Label && kind != ItemKind::Position)
            && other.index().references_to((kind, to)).next().is_some()
        {
            return Err(Failure::refused(format_args!("{kind}[{to}] is used in {}", other.name())));
        }
        if other.index().references_to(item).next().is_none() {
            continue;
        }
        let change = |program: &mut Program| match to {
            Some(to) => program.replace_items(|k, n| ((k, n) == item).then_some((kind, to))),
            None => program.set_item_name(kind, number, new),
        };
        found.push((other, changed(other, change)?));
    }
    found.retain(|(_, edits)| !edits.is_empty());
    Ok(edits::workspace(folder, found))
}

/// Returns the edits of a change of a document.
pub(crate) fn changed<T>(
    document: &Document,
    change: impl FnOnce(&mut Program) -> Result<T, EncodeError>,
) -> Answer<Vec<TextEdit>> {
    let name = || document.path().map_or_else(String::new, |path| format!("{}: ", path.display()));
    let mut program =
        document.program().map_err(|error| Failure::refused(format_args!("{}{error}", name())))?;
    change(&mut program).map_err(Failure::refused)?;
    Ok(edits::between(document, program.as_str()))
}

fn program(folder: &Folder, document: &Document, old: &str, new: &str) -> Answer<WorkspaceEdit> {
    let target = folder.program(document, old);
    let limit = folder.rules.name_limit;
    probe()?.set_name(new).map_err(Failure::refused)?;
    if new.len() > limit {
        return Err(Failure::refused(EncodeError::NameLength { found: new.len(), limit }));
    }
    if folder
        .program(document, new)
        .is_some_and(|other| target.is_none_or(|target| target.uri() != other.uri()))
    {
        return Err(Failure::refused(format_args!("a program is already named {new}")));
    }
    let mut found: Vec<(&Document, Vec<TextEdit>)> = Vec::new();
    let calls = Target::Program(old.to_owned());
    for other in folder.neighbours(document) {
        let converter = other.converter();
        let edit = |place| TextEdit { range: converter.range(place), new_text: new.to_owned() };
        let edits: Vec<TextEdit> = calls.within(other).iter().map(|named| edit(&named.place)).collect();
        if !edits.is_empty() {
            found.push((other, edits));
        }
    }
    let renamed = target
        .and_then(|target| file(target, old, new))
        .filter(|_| folder.client.versions && folder.client.renames);
    let Some(file) = renamed else { return Ok(edits::workspace(folder, found)) };
    let edits = found
        .into_iter()
        .map(|(document, edits)| DocumentChangeOperation::Edit(edits::versioned(document, edits)));
    let operations = edits.chain([DocumentChangeOperation::Op(ResourceOp::Rename(file))]).collect();
    Ok(WorkspaceEdit {
        document_changes: Some(DocumentChanges::Operations(operations)),
        ..WorkspaceEdit::default()
    })
}

/// Returns a program to check names with.
fn probe() -> Answer<Program> {
    Program::decode("/PROG A\n/MN\n/END\n").map_err(Failure::refused)
}

/// Returns the renaming of a program's file, if the file has the old name.
fn file(target: &Document, old: &str, new: &str) -> Option<RenameFile> {
    let path = target.path()?;
    let stem = path.file_stem()?.to_str()?;
    if !stem.eq_ignore_ascii_case(old) {
        return None;
    }
    let is_small = !stem.chars().any(char::is_uppercase);
    let mut name = if is_small { new.to_lowercase() } else { new.to_owned() };
    if let Some(end) = path.extension().and_then(|end| end.to_str()) {
        name = format!("{name}.{end}");
    }
    let new_uri = Uri::from_str(&uri::of_path(&path.with_file_name(name))).ok()?;
    Some(RenameFile { old_uri: target.uri().clone(), new_uri, options: None, annotation_id: None })
}
