//! The supported requests, and the capabilities that the client receives.

use lsp_types::request::{
    CallHierarchyIncomingCalls, CallHierarchyOutgoingCalls, CallHierarchyPrepare, CodeActionRequest,
    Completion, DocumentHighlightRequest, DocumentSymbolRequest, FoldingRangeRequest, Formatting,
    GotoDefinition, HoverRequest, InlayHintRequest, OnTypeFormatting, PrepareRenameRequest, References,
    Rename, Request, SemanticTokensFullRequest, SemanticTokensRangeRequest, WorkspaceSymbolRequest,
};
use lsp_types::{
    CallHierarchyServerCapability, CodeActionKind, CodeActionOptions, CodeActionProviderCapability,
    CompletionOptions, DocumentOnTypeFormattingOptions, ExecuteCommandOptions,
    FoldingRangeProviderCapability, HoverProviderCapability, OneOf, RenameOptions, SemanticTokensFullOptions,
    SemanticTokensOptions, SemanticTokensServerCapabilities, ServerCapabilities, TextDocumentSyncCapability,
    TextDocumentSyncKind, TextDocumentSyncOptions, WorkDoneProgressOptions,
    WorkspaceFoldersServerCapabilities, WorkspaceServerCapabilities,
};
use serde_json::Value;

use crate::answer::{Answer, Failure};
use crate::answers::{
    actions, calls, completion, folding, format, hover, inlay, places, rename, symbols, tokens,
};
use crate::folder::Folder;
use crate::position::Encoding;

/// The command that simulates a program; its argument is the URI of the file.
pub(crate) const RUN: &str = "cellwire.ls.run";

/// Answers a request; None if the method is not one of the server's.
pub(crate) fn answer(folder: &Folder, method: &str, params: Value) -> Option<Answer<Value>> {
    Some(match method {
        CallHierarchyIncomingCalls::METHOD => {
            on::<CallHierarchyIncomingCalls>(folder, params, calls::incoming)
        }
        CallHierarchyOutgoingCalls::METHOD => {
            on::<CallHierarchyOutgoingCalls>(folder, params, calls::outgoing)
        }
        CallHierarchyPrepare::METHOD => on::<CallHierarchyPrepare>(folder, params, calls::prepare),
        CodeActionRequest::METHOD => on::<CodeActionRequest>(folder, params, actions::actions),
        Completion::METHOD => on::<Completion>(folder, params, completion::completion),
        DocumentHighlightRequest::METHOD => on::<DocumentHighlightRequest>(folder, params, places::highlight),
        DocumentSymbolRequest::METHOD => on::<DocumentSymbolRequest>(folder, params, symbols::of_document),
        FoldingRangeRequest::METHOD => on::<FoldingRangeRequest>(folder, params, folding::folding),
        Formatting::METHOD => on::<Formatting>(folder, params, format::format),
        GotoDefinition::METHOD => on::<GotoDefinition>(folder, params, places::definition),
        HoverRequest::METHOD => on::<HoverRequest>(folder, params, hover::hover),
        InlayHintRequest::METHOD => on::<InlayHintRequest>(folder, params, inlay::inlay),
        OnTypeFormatting::METHOD => on::<OnTypeFormatting>(folder, params, format::on_type),
        PrepareRenameRequest::METHOD => on::<PrepareRenameRequest>(folder, params, rename::prepare),
        References::METHOD => on::<References>(folder, params, places::references),
        Rename::METHOD => on::<Rename>(folder, params, rename::rename),
        SemanticTokensFullRequest::METHOD => on::<SemanticTokensFullRequest>(folder, params, tokens::full),
        SemanticTokensRangeRequest::METHOD => {
            on::<SemanticTokensRangeRequest>(folder, params, tokens::of_range)
        }
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

/// Returns the capabilities of the server; `runs` is whether it has a simulation.
pub(crate) fn capabilities(encoding: Encoding, runs: bool) -> ServerCapabilities {
    ServerCapabilities {
        position_encoding: Some(encoding.kind()),
        text_document_sync: Some(TextDocumentSyncCapability::Options(TextDocumentSyncOptions {
            open_close: Some(true),
            change: Some(TextDocumentSyncKind::INCREMENTAL),
            ..TextDocumentSyncOptions::default()
        })),
        call_hierarchy_provider: Some(CallHierarchyServerCapability::Simple(true)),
        code_action_provider: Some(CodeActionProviderCapability::Options(CodeActionOptions {
            code_action_kinds: Some(vec![CodeActionKind::QUICKFIX, actions::RENUMBER]),
            ..CodeActionOptions::default()
        })),
        completion_provider: Some(CompletionOptions {
            trigger_characters: Some(vec!["[".into()]),
            ..CompletionOptions::default()
        }),
        definition_provider: Some(OneOf::Left(true)),
        document_formatting_provider: Some(OneOf::Left(true)),
        document_highlight_provider: Some(OneOf::Left(true)),
        document_on_type_formatting_provider: Some(DocumentOnTypeFormattingOptions {
            first_trigger_character: "\n".into(),
            more_trigger_character: Some(vec![";".into()]),
        }),
        document_symbol_provider: Some(OneOf::Left(true)),
        execute_command_provider: runs.then(|| ExecuteCommandOptions {
            commands: vec![RUN.into()],
            ..ExecuteCommandOptions::default()
        }),
        folding_range_provider: Some(FoldingRangeProviderCapability::Simple(true)),
        hover_provider: Some(HoverProviderCapability::Simple(true)),
        inlay_hint_provider: Some(OneOf::Left(true)),
        references_provider: Some(OneOf::Left(true)),
        rename_provider: Some(OneOf::Right(RenameOptions {
            prepare_provider: Some(true),
            work_done_progress_options: WorkDoneProgressOptions::default(),
        })),
        semantic_tokens_provider: Some(SemanticTokensServerCapabilities::SemanticTokensOptions(
            SemanticTokensOptions {
                legend: tokens::legend(),
                range: Some(true),
                full: Some(SemanticTokensFullOptions::Bool(true)),
                ..SemanticTokensOptions::default()
            },
        )),
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
