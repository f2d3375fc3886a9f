//! `textDocument/definition`, `references`, `documentHighlight`: the places of the item or the program at a position.

use lsp_types::{
    DocumentHighlight, DocumentHighlightKind, DocumentHighlightParams, GotoDefinitionParams,
    GotoDefinitionResponse, Location, ReferenceParams,
};

use super::target::{Mention, Target};
use crate::answer::{Answer, document};
use crate::folder::Folder;

/// The places that are returned at most.
const MAX_PLACES: usize = 10_000;

/// Returns the definition: the label, the position in `/POS`, the program; for other items, the instructions that set them.
pub(crate) fn definition(
    folder: &Folder,
    params: GotoDefinitionParams,
) -> Answer<Option<GotoDefinitionResponse>> {
    let at = params.text_document_position_params;
    let document = document(folder, &at.text_document.uri)?;
    let offset = document.offset(at.position);
    let found = match Target::at(document, offset) {
        Some((Target::Program(name), _)) => {
            let program = folder.program(document, &name);
            program.map(|program| program.location(&program.index().name())).into_iter().collect()
        }
        Some((target, _)) => {
            locations(target.places(folder, document).into_iter().filter(|named| named.is_set))
        }
        None => macro_program(folder, document, offset).into_iter().collect(),
    };
    Ok((!found.is_empty()).then_some(GotoDefinitionResponse::Array(found)))
}

/// Returns the program of the macro in the statement at a byte.
fn macro_program(folder: &Folder, document: &crate::document::Document, offset: usize) -> Option<Location> {
    let line = document.lines().range(document.text(), document.lines().line(offset));
    let (_, body) = document.at(&line).split_once(':')?;
    let name = body.split(['(', ';']).next().unwrap_or("").trim();
    let program = folder.program(document, folder.macro_program(document, name)?)?;
    Some(program.location(&program.index().name()))
}

pub(crate) fn references(folder: &Folder, params: ReferenceParams) -> Answer<Option<Vec<Location>>> {
    let at = params.text_document_position;
    let document = document(folder, &at.text_document.uri)?;
    let Some((target, _)) = Target::at(document, document.offset(at.position)) else { return Ok(None) };
    let all = params.context.include_declaration;
    Ok(Some(locations(
        target.places(folder, document).into_iter().filter(|named| all || !named.is_definition),
    )))
}

pub(crate) fn highlight(
    folder: &Folder,
    params: DocumentHighlightParams,
) -> Answer<Option<Vec<DocumentHighlight>>> {
    let at = params.text_document_position_params;
    let document = document(folder, &at.text_document.uri)?;
    let Some((target, _)) = Target::at(document, document.offset(at.position)) else { return Ok(None) };
    let converter = document.converter();
    let highlight = |named: &Mention<'_>| DocumentHighlight {
        range: converter.range(&named.place),
        kind: Some(if named.is_set { DocumentHighlightKind::WRITE } else { DocumentHighlightKind::READ }),
    };
    Ok(Some(target.within(document).iter().take(MAX_PLACES).map(highlight).collect()))
}

/// Returns the places as locations; those of one document are consecutive.
fn locations<'a>(places: impl Iterator<Item = Mention<'a>>) -> Vec<Location> {
    let mut converter = None;
    let location = |named: Mention<'a>| {
        let document = named.document;
        let (_, converter) = match converter.take() {
            Some((uri, known)) if uri == document.uri() => converter.insert((uri, known)),
            _ => converter.insert((document.uri(), document.converter())),
        };
        Location { uri: document.uri().clone(), range: converter.range(&named.place) }
    };
    places.take(MAX_PLACES).map(location).collect()
}
