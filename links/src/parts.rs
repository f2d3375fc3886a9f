//! The parts of a frame: which bytes are which value, and the clause of each.

use core::ops::Range;

use serde::Serialize;
use serde_json::Value;

/// A part of a frame.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Part {
    /// A value of the message, as a JSON pointer (`/force/0`); otherwise a name of the envelope (`checksum`).
    pub name: String,
    /// The bytes of the part, from the frame's first. Several parts may share a byte.
    pub bytes: Range<usize>,
    /// The clause of the specification that describes it, or its section (`4.2`).
    pub clause: &'static str,
}

/// A message that was read.
#[derive(Debug, Clone, Copy)]
pub struct ReadMessage<'a> {
    /// The side that sent it.
    pub side: &'static str,
    /// The message as its codec shows it.
    pub message: &'a Value,
    /// The bytes of the frame.
    pub bytes: &'a [u8],
}

/// Divides the bytes of a frame into parts, from its first byte on.
#[derive(Debug)]
pub struct Parts<'a> {
    bytes: &'a [u8],
    /// The offset on the wire of each byte that is not there for stuffing alone.
    places: Vec<usize>,
    /// The next of these.
    at: usize,
    /// The number of these bytes before the end of stuffing.
    single: usize,
    parts: Vec<Part>,
}

impl<'a> Parts<'a> {
    /// Divides a frame without stuffing.
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, places: (0..bytes.len()).collect(), at: 0, single: bytes.len(), parts: Vec::new() }
    }

    /// Divides a frame in which this byte is written twice, from `begin` up to the first single one.
    pub fn stuffed(bytes: &'a [u8], begin: usize, twice: u8) -> Self {
        let mut places: Vec<usize> = (0..begin.min(bytes.len())).collect();
        let mut at = begin;
        while let Some(byte) = bytes.get(at) {
            if *byte == twice && bytes.get(at + 1) != Some(&twice) {
                break;
            }
            places.push(at);
            at += if *byte == twice { 2 } else { 1 };
        }
        let single = places.len();
        places.extend(at..bytes.len());
        Self { bytes, places, at: 0, single, parts: Vec::new() }
    }

    /// Returns the number of bytes that are not taken yet, stuffing not counted.
    pub fn left(&self) -> usize {
        self.places.len() - self.at
    }

    /// Returns the number of bytes that are not taken yet and come before the end of stuffing.
    pub fn left_stuffed(&self) -> usize {
        self.single.saturating_sub(self.at)
    }

    /// Returns the next byte.
    pub fn peek(&self) -> Option<u8> {
        self.bytes.get(*self.places.get(self.at)?).copied()
    }

    /// Adds the next bytes as this part.
    pub fn take(&mut self, length: usize, name: impl Into<String>, clause: &'static str) {
        let wire = |at| self.places.get(at).copied().unwrap_or(self.bytes.len());
        let end = (self.at + length).min(self.places.len());
        let bytes = wire(self.at)..wire(end);
        self.at = end;
        if !bytes.is_empty() {
            self.parts.push(Part { name: name.into(), bytes, clause });
        }
    }

    /// Adds the bytes up to one of `ends` as this part.
    pub fn until(&mut self, ends: &[u8], name: impl Into<String>, clause: &'static str) {
        self.after(0, ends, name, clause);
    }

    /// Adds the bytes up to one of `ends` as this part; the first bytes do not end it.
    pub fn after(&mut self, first: usize, ends: &[u8], name: impl Into<String>, clause: &'static str) {
        let is_end = |place: &usize| self.bytes.get(*place).is_some_and(|byte| ends.contains(byte));
        let left = self.places.get(self.at..).unwrap_or_default();
        let length = left.iter().skip(first).position(is_end).map_or(left.len(), |length| first + length);
        self.take(length, name, clause);
    }

    /// Adds another part with the bytes of the last one.
    pub fn also(&mut self, name: impl Into<String>, clause: &'static str) {
        if let Some(last) = self.parts.last() {
            self.parts.push(Part { name: name.into(), bytes: last.bytes.clone(), clause });
        }
    }

    /// Adds the values of a list, each of `size` bytes.
    pub fn list(&mut self, length: usize, size: usize, name: &str, clause: &'static str) {
        for at in 0..length {
            self.take(size, format!("{name}/{at}"), clause);
        }
    }

    /// Returns the parts; remaining bytes are the part `rest`.
    #[must_use]
    pub fn end(mut self, rest: &str, clause: &'static str) -> Vec<Part> {
        self.take(self.left(), rest, clause);
        self.parts
    }
}

/// Returns the number of values that a list of the message has.
pub fn count(message: &Value, list: &str) -> usize {
    message.pointer(&format!("/{list}")).and_then(Value::as_array).map_or(0, Vec::len)
}
