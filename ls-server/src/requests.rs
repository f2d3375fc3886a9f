//! The requests that are answered, and what the client is told of them.

use lsp_types::request::{Completion, DocumentSymbolRequest, HoverRequest, Request, WorkspaceSymbolRequest};
use lsp_types::{
    CompletionOptions, HoverProviderCapability, OneOf, ServerCapabilities, TextDocumentSyncCapability,
    TextDocumentSyncKind, TextDocumentSyncOptions, WorkspaceFoldersServerCapabilities,
    WorkspaceServerCapabilities,
};
use serde_json::Value;

use crate::answer::{Answer, Failure};
use crate::answers::{completion, hover, symbols};
use crate::folder::Folder;
use crate::position::Encoding;

/// The command that simulates a program; its argument is the URI of the file.
pub(crate) const RUN: &str = "cellwire.ls.run";

/// Answers a request; None if the method is not one of the server's.
pub(crate) fn answer(folder: &Folder, method: &str, params: Value) -> Option<Answer<Value>> {
    Some(match method {
        Completion::METHOD => on::<Completion>(folder, params, completion::completion),
        HoverRequest::METHOD => on::<HoverRequest>(folder, params, hover::hover),
        DocumentSymbolRequest::METHOD => on::<DocumentSymbolRequest>(folder, params, symbols::of_document),
        WorkspaceSymbolRequest::METHOD => on::<WorkspaceSymbolRequest>(folder, params, symbols::of_workspace),
        _ => return None,
    })
}

fn on<R: Request>(
    folder: &Folder,
    params: Value,
    answer: fn(&Folder, R::Params) -> Answer<R::Result>,
) -> Answer<Value> {
    let params = serde_json::from_value(params).map_err(Failure::params)?;
    serde_json::to_value(answer(folder, params)?).map_err(Failure::refused)
}

/// What the server can do.
pub(crate) fn capabilities(encoding: Encoding) -> ServerCapabilities {
    ServerCapabilities {
        position_encoding: Some(encoding.kind()),
        text_document_sync: Some(TextDocumentSyncCapability::Options(TextDocumentSyncOptions {
            open_close: Some(true),
            change: Some(TextDocumentSyncKind::INCREMENTAL),
            ..TextDocumentSyncOptions::default()
        })),
        completion_provider: Some(CompletionOptions {
            trigger_characters: Some(vec!["[".into()]),
            ..CompletionOptions::default()
        }),
        hover_provider: Some(HoverProviderCapability::Simple(true)),
        document_symbol_provider: Some(OneOf::Left(true)),
        workspace_symbol_provider: Some(OneOf::Left(true)),
        workspace: Some(WorkspaceServerCapabilities {
            workspace_folders: Some(WorkspaceFoldersServerCapabilities {
                supported: Some(true),
                change_notifications: Some(OneOf::Left(true)),
            }),
            file_operations: None,
        }),
        ..ServerCapabilities::default()
    }
}
