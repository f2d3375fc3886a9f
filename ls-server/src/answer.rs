//! The outcome of a request.

use core::fmt;

use lsp_server::ErrorCode;

use crate::document::Document;
use crate::folder::Folder;

/// The result of a request, or the reason for its failure.
pub(crate) type Answer<T> = Result<T, Failure>;

/// A request that failed: the code and the text of the answer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Failure {
    pub(crate) code: i32,
    pub(crate) message: String,
}

impl Failure {
    /// Creates the error of a request that cannot be answered; the text is for the user.
    pub(crate) fn refused(message: impl fmt::Display) -> Self {
        Self { code: ErrorCode::RequestFailed as i32, message: message.to_string() }
    }

    /// Creates the error of a request with the wrong parameters for its method.
    pub(crate) fn params(message: impl fmt::Display) -> Self {
        Self { code: ErrorCode::InvalidParams as i32, message: message.to_string() }
    }
}

/// Returns the document with this URI.
///
/// # Errors
/// If it is neither open nor in the workspace.
pub(crate) fn document<'a>(folder: &'a Folder, uri: &lsp_types::Uri) -> Answer<&'a Document> {
    folder.get(uri).ok_or_else(|| Failure::params(format_args!("{} is not open", uri.as_str())))
}
