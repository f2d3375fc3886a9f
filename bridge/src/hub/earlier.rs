//! Records as formats 1 and 2 of the store have them.

use prost::Message;

use crate::compact::Words;
use crate::payload::Payload;

/// A record.
#[derive(Clone, PartialEq, Message)]
struct Record {
    /// The cell's name.
    #[prost(string, tag = "1")]
    cell: String,
    /// What it reports.
    #[prost(message, optional, tag = "2")]
    payload: Option<Payload>,
}

/// The cell of a record.
pub fn cell(bytes: &[u8]) -> Option<String> {
    Some(Record::decode(bytes).ok()?.cell)
}

/// As it is now; none of a cell that is not known.
pub fn convert(bytes: &[u8], words: &Words) -> Option<Vec<u8>> {
    let Record { cell, payload } = Record::decode(bytes).ok()?;
    let metrics = payload?.metrics;
    let at = metrics.first()?.timestamp?;
    words.knows(&cell).then(|| words.pack(&cell, at, &metrics))
}
