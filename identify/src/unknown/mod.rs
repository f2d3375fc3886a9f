//! The visible structure of bytes that no combination of options explains: the beginnings and ends of messages, constants,
//! checks, lengths, counters, numbers that change slowly, and the nearest link.

mod checks;
mod crc;
mod divide;
mod fields;
mod messages;
mod nearest;
mod symbols;
#[cfg(test)]
mod tests;

use serde::Serialize;

use super::Stream;

pub use checks::Check;
pub use fields::{Length, Number};
pub use nearest::{Nearest, nearest};

/// The visible structure of the bytes of one end.
#[derive(Debug, Clone, Serialize)]
pub struct StreamStructure {
    /// The number of messages that the bytes are divided into.
    pub messages: usize,
    /// The lengths of the shortest and the longest message, in bytes.
    pub lengths: [usize; 2],
    /// The bytes that all messages begin with.
    #[serde(serialize_with = "hex")]
    pub begin: Vec<u8>,
    /// The bytes that all messages end with.
    #[serde(serialize_with = "hex")]
    pub end: Vec<u8>,
    /// The byte that is doubled inside of messages; `None` without one.
    pub doubled: Option<u8>,
    /// The bytes besides the marks that are the same in all messages: their offsets and values.
    pub constant: Vec<(usize, u8)>,
    /// The bytes that check others; `None` without any.
    pub check: Option<Check>,
    /// The field with the length of the message; `None` without one.
    pub length: Option<Length>,
    /// Numbers that grow by one from message to message.
    pub counters: Vec<Number>,
    /// The fields with numbers that change slowly.
    pub numbers: Vec<Number>,
}

/// The number of messages of a stream that are examined.
const MAX_MESSAGES: usize = 200;
/// A capture may have corrupt bytes: the share of messages, in percent, that must have a property.
pub(crate) const SHARE: usize = 85;

/// Returns the visible structure of each stream that has any.
pub fn look(streams: &[Stream]) -> Vec<StreamStructure> {
    streams.iter().filter_map(seen).collect()
}

/// Returns the structure of the one among nearly equal divisions in whose messages most is found.
fn seen(stream: &Stream) -> Option<StreamStructure> {
    let found = divide::divide(stream).into_iter().rev().filter_map(|division| {
        let seen = of_messages(&division.messages)?;
        let check = seen.check.as_ref().is_some_and(|it| it.constant == 0);
        // A check that is there is not there by chance.
        let rank = (division.rank.together, check, seen.length.is_some(), division.rank);
        Some((rank, seen))
    });
    // Of equals the first, which comes last here.
    found.max_by_key(|(rank, _)| *rank).map(|(_, seen)| seen)
}

fn of_messages(messages: &[Vec<u8>]) -> Option<StreamStructure> {
    let count = messages.len();
    let messages: Vec<&[u8]> = messages.iter().map(Vec::as_slice).take(MAX_MESSAGES).collect();
    let (begin, end) = messages::marks(&messages);
    let doubled = messages::doubled(&messages, begin.len(), &end);
    let check = checks::find(&messages, end.len(), doubled);
    let taken = check.as_ref().map_or(end.len(), |check| check.from_end + check.width);
    let length = fields::length(&messages);
    let mut counters = fields::counters(&messages, taken, begin.len());
    if let Some(length) = &length {
        counters.retain(|it| it.at != length.at);
    }
    let numbers = fields::numbers(&messages, begin.len(), taken, &counters);
    let constant = fields::constant(&messages, begin.len(), end.len());
    let shortest = messages.iter().map(|it| it.len()).min()?;
    let longest = messages.iter().map(|it| it.len()).max()?;
    let lengths = [shortest, longest];
    Some(StreamStructure {
        messages: count,
        lengths,
        begin,
        end,
        doubled,
        constant,
        check,
        length,
        counters,
        numbers,
    })
}

fn real(count: usize) -> f64 {
    u32::try_from(count).map_or(f64::MAX, f64::from)
}

/// Returns whether `found` of `all` are enough.
fn enough(found: usize, all: usize) -> bool {
    found > 0 && found * 100 >= all * SHARE
}

fn hex<S: serde::Serializer>(bytes: &[u8], out: S) -> Result<S::Ok, S::Error> {
    let pairs: Vec<String> = bytes.iter().map(|byte| format!("{byte:02X}")).collect();
    out.serialize_str(&pairs.join(" "))
}
