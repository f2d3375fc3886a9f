//! The call hierarchy: which programs call a program, and which it calls.

use std::collections::BTreeMap;

use lsp_types::{
    CallHierarchyIncomingCall, CallHierarchyIncomingCallsParams, CallHierarchyItem,
    CallHierarchyOutgoingCall, CallHierarchyOutgoingCallsParams, CallHierarchyPrepareParams, SymbolKind,
};

use super::target::Target;
use crate::answer::{Answer, document};
use crate::document::Document;
use crate::folder::Folder;

pub(crate) fn prepare(
    folder: &Folder,
    params: CallHierarchyPrepareParams,
) -> Answer<Option<Vec<CallHierarchyItem>>> {
    let at = params.text_document_position_params;
    let document = document(folder, &at.text_document.uri)?;
    let program = match Target::at(document, document.offset(at.position)) {
        Some((Target::Program(name), _)) => folder.program(document, &name),
        _ => None,
    };
    Ok(program.map(|program| vec![item(program)]))
}

pub(crate) fn incoming(
    folder: &Folder,
    params: CallHierarchyIncomingCallsParams,
) -> Answer<Option<Vec<CallHierarchyIncomingCall>>> {
    let document = document(folder, &params.item.uri)?;
    let target = Target::Program(document.name().to_owned());
    let calls = folder.neighbours(document).filter_map(|other| {
        let converter = other.converter();
        let places = target.within(other).into_iter().filter(|named| !named.is_definition);
        let from_ranges: Vec<_> = places.map(|named| converter.range(&named.place)).collect();
        (!from_ranges.is_empty()).then(|| CallHierarchyIncomingCall { from: item(other), from_ranges })
    });
    Ok(Some(calls.collect()))
}

pub(crate) fn outgoing(
    folder: &Folder,
    params: CallHierarchyOutgoingCallsParams,
) -> Answer<Option<Vec<CallHierarchyOutgoingCall>>> {
    let document = document(folder, &params.item.uri)?;
    let converter = document.converter();
    let mut calls: BTreeMap<&str, CallHierarchyOutgoingCall> = BTreeMap::new();
    for place in document.index().programs() {
        let Some(program) = folder.program(document, document.at(&place)) else { continue };
        let call = calls.entry(program.uri().as_str());
        let call =
            call.or_insert_with(|| CallHierarchyOutgoingCall { to: item(program), from_ranges: Vec::new() });
        call.from_ranges.push(converter.range(&place));
    }
    Ok(Some(calls.into_values().collect()))
}

fn item(document: &Document) -> CallHierarchyItem {
    let range = document.converter().range(&document.index().name());
    CallHierarchyItem {
        name: document.name().to_owned(),
        kind: SymbolKind::FUNCTION,
        tags: None,
        detail: document.index().comment().map(str::to_owned),
        uri: document.uri().clone(),
        range,
        selection_range: range,
        data: None,
    }
}
