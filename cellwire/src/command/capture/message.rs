use std::time::Duration;

use serde_json::Value;

/// A message, or bytes that are not a message.
#[derive(Debug, Clone)]
pub(super) struct Message {
    /// The number of the message, from 1.
    pub(super) number: usize,
    /// When it was whole, since the first byte of the conversation.
    pub(super) at: Duration,
    /// The client's end, or the one that recorded.
    pub(super) is_first: bool,
    /// The side that sent it; none where it polls.
    pub(super) side: Option<&'static str>,
    pub(super) bytes: Vec<u8>,
    pub(super) content: Result<Value, Value>,
    /// Bytes are missing before it.
    pub(super) after_gap: bool,
}
