//! Lists the fields of a frame with their bytes and the clause of the specification that describes each: for programs that show
//! both.

use anyhow::Result;
use serde::Serialize;
use serde_json::{Map, Value};

use crate::codec::items;
use crate::link::Link;
pub use crate::parts::{Part, Parts, ReadMessage, count};

/// A message or an error in a stream, and the meaning of its bytes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Explanation {
    /// The offset of the first byte, from the start of the stream.
    pub offset: u64,
    /// The number of bytes of the item.
    pub length: u64,
    /// The object of a message; `None` for an error.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub message: Option<Value>,
    /// The object of an error; `None` for a message.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<Value>,
    /// The clause that an error breaks; `None` for a message.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub clause: Option<&'static str>,
    /// Whether the item is given only because the stream ends.
    pub at_end: bool,
    /// The meaning of the message's bytes, in their sequence.
    pub parts: Vec<Part>,
}

/// Explains all items that a side's codec finds in a stream.
///
/// # Errors
/// If the link has no such side or setting.
pub fn explain(
    link: &Link,
    side: &str,
    settings: &Map<String, Value>,
    stream: &[u8],
) -> Result<Vec<Explanation>> {
    let side = link.side(Some(side))?;
    let found = items((link.codec)(side, settings)?, &[vec![stream]])?;
    found
        .into_iter()
        .map(|item| {
            let (message, error) = match item.value()? {
                Ok(message) => (Some(message), None),
                Err(error) => (None, Some(error)),
            };
            let [begin, end] = [item.offset, item.offset + item.length].map(|at| usize::try_from(at).ok());
            let bytes = begin.zip(end).and_then(|(begin, end)| stream.get(begin..end)).unwrap_or_default();
            let parts = message
                .as_ref()
                .map(|message| (link.parts)(&ReadMessage { side, message, bytes }))
                .unwrap_or_default();
            let kind = error.as_ref().and_then(|error| error["kind"].as_str());
            let clause = kind.and_then(|kind| link.clause(kind));
            let (offset, length, at_end) = (item.offset, item.length, item.at_end);
            Ok(Explanation { offset, length, message, error, clause, at_end, parts })
        })
        .collect()
}
