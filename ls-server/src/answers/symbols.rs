//! `textDocument/documentSymbol` and `workspace/symbol`: programs, labels and positions.

use fanuc_ls::ItemKind;
use lsp_types::{
    DocumentSymbol, DocumentSymbolParams, DocumentSymbolResponse, OneOf, SymbolKind, WorkspaceSymbol,
    WorkspaceSymbolParams, WorkspaceSymbolResponse,
};

use crate::answer::{Answer, document};
use crate::document::Document;
use crate::folder::Folder;

/// The symbols of the workspace that are returned at most.
const MAX_SYMBOLS: usize = 500;

/// Returns the program of a document with its labels and positions.
pub(crate) fn of_document(
    folder: &Folder,
    params: DocumentSymbolParams,
) -> Answer<Option<DocumentSymbolResponse>> {
    let document = document(folder, &params.text_document.uri)?;
    Ok((!document.name().is_empty()).then(|| DocumentSymbolResponse::Nested(vec![program(document)])))
}

fn program(document: &Document) -> DocumentSymbol {
    let (index, converter) = (document.index(), document.converter());
    let definitions = index.references().filter(|found| found.is_definition);
    let children = definitions.map(|found| {
        let name = found.name.as_ref().map(|name| document.at(name).to_owned());
        let end = found.name.as_ref().map_or(found.digits.end, |name| name.end.max(found.digits.end));
        let kind = if found.kind == ItemKind::Label { SymbolKind::KEY } else { SymbolKind::CONSTANT };
        symbol(
            format!("{}[{}]", found.kind, found.number),
            name,
            kind,
            converter.range(&(found.letters.start..end)),
        )
    });
    let children = children.collect();
    let whole = converter.range(&(0..document.text().len()));
    let name = converter.range(&index.name());
    let mut program =
        symbol(document.name().to_owned(), index.comment().map(str::to_owned), SymbolKind::MODULE, name);
    program.range = whole;
    program.children = Some(children);
    program
}

fn symbol(name: String, detail: Option<String>, kind: SymbolKind, range: lsp_types::Range) -> DocumentSymbol {
    #[expect(deprecated, reason = "the type has the field, and no other way to make one")]
    DocumentSymbol {
        name,
        detail,
        kind,
        tags: None,
        deprecated: None,
        range,
        selection_range: range,
        children: None,
    }
}

/// Returns the programs whose names or comments contain the query.
pub(crate) fn of_workspace(
    folder: &Folder,
    params: WorkspaceSymbolParams,
) -> Answer<Option<WorkspaceSymbolResponse>> {
    let query = params.query.to_lowercase();
    let is_meant = |document: &&Document| {
        let comment = document.index().comment().unwrap_or("");
        !document.name().is_empty()
            && format!("{} {comment}", document.name()).to_lowercase().contains(&query)
    };
    let symbol = |document: &Document| WorkspaceSymbol {
        name: document.name().to_owned(),
        kind: SymbolKind::MODULE,
        tags: None,
        container_name: document.index().comment().map(str::to_owned),
        location: OneOf::Left(document.location(&document.index().name())),
        data: None,
    };
    let found = folder.documents().filter(is_meant).take(MAX_SYMBOLS).map(symbol);
    Ok(Some(WorkspaceSymbolResponse::Nested(found.collect())))
}
