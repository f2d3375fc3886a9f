//! The records and spans, with the feature.

use core::fmt::Debug;
#[cfg(feature = "tokio")]
use core::{fmt::Display, future::Future, time::Duration};

#[cfg(feature = "tokio")]
use crate::now;

/// The target of all records.
const TARGET: &str = "robot_session";

pub(crate) fn connected() {
    tracing::info!(target: TARGET, "connected");
}

pub(crate) fn disconnected() {
    tracing::info!(target: TARGET, "disconnected");
}

/// Records the bytes that a session has received.
pub(crate) fn received(bytes: &[u8]) {
    tracing::trace!(target: TARGET, bytes = %format_args!("{bytes:02X?}"), "received");
}

/// Records the bytes that a session has written.
pub(crate) fn written(bytes: &[u8]) {
    tracing::trace!(target: TARGET, bytes = %format_args!("{bytes:02X?}"), "written");
}

pub(crate) fn event(event: &impl Debug) {
    tracing::debug!(target: TARGET, ?event);
}

/// Records that a connection is lost, or could not be made.
#[cfg(feature = "tokio")]
pub(crate) fn failed(what: &str, reason: &impl Display) {
    tracing::warn!(target: TARGET, %reason, "{what}");
}

/// The span of a connection: its link and end, and its peer if that is known.
#[cfg(feature = "std")]
#[derive(Debug, Clone)]
pub(crate) struct Span(tracing::Span);

#[cfg(feature = "std")]
impl Span {
    pub(crate) fn of([link, end]: [&str; 2], peer: Option<&str>) -> Self {
        Self(tracing::info_span!(target: TARGET, "connection", link, end, peer))
    }

    /// Calls `work` in the span.
    pub(crate) fn within<T>(&self, work: impl FnOnce() -> T) -> T {
        self.0.in_scope(work)
    }

    /// Runs `future` in the span.
    #[cfg(feature = "tokio")]
    pub(crate) fn instrument<F: Future>(&self, future: F) -> impl Future<Output = F::Output> + use<F> {
        tracing::Instrument::instrument(future, self.0.clone())
    }
}

/// A call, until its outcome.
#[cfg(feature = "tokio")]
#[derive(Clone)]
pub(crate) struct Call {
    span: tracing::Span,
    begun: Duration,
}

#[cfg(feature = "tokio")]
impl Call {
    pub(crate) fn of([link, end]: [&str; 2]) -> Self {
        let span = tracing::debug_span!(target: TARGET, "call", link, end);
        Self { span, begun: now() }
    }

    pub(crate) fn begun(&self, call: &impl Debug) {
        self.span.in_scope(|| tracing::debug!(target: TARGET, ?call));
    }

    pub(crate) fn ended(&self, outcome: &impl Debug) {
        let time = now().saturating_sub(self.begun);
        self.span.in_scope(|| tracing::debug!(target: TARGET, ?outcome, ?time));
    }
}
