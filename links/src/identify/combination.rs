//! A combination of settings, and what it makes of bytes.

use anyhow::Result;
use serde_json::{Map, Value};

use super::plausible::plausible;
use super::{Sender, Stream};
use crate::codec::{self, Codec, Kind};
use crate::link::Link;

/// How well bytes are explained.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub(super) enum Level {
    /// Not.
    #[default]
    None,
    /// They are a message, which is written another way.
    Read,
    /// They are a message as it is written.
    Written,
}

/// Settings, and the codecs that they make.
pub(super) struct Combination {
    pub(super) link: &'static Link,
    pub(super) settings: Map<String, Value>,
    codecs: Vec<(&'static str, Box<dyn Codec>)>,
}

/// A message in a stream.
#[derive(Debug, Clone)]
pub(super) struct Piece {
    pub(super) stream: usize,
    pub(super) begin: u64,
    pub(super) bytes: Vec<u8>,
    pub(super) side: &'static str,
    pub(super) level: Level,
    pub(super) json: String,
    /// How much sense its numbers and texts make.
    pub(super) sense: f64,
}

/// A message among some bytes.
#[derive(Debug, Default)]
pub(super) struct Within {
    /// Twice the bytes of all messages that are written so, and those of the others.
    pub(super) weight: usize,
    pub(super) level: Level,
    pub(super) len: usize,
    pub(super) message: Value,
}

/// What a combination makes of all streams.
#[derive(Debug, Clone, Default)]
pub(super) struct Reading {
    /// In order.
    pub(super) pieces: Vec<Piece>,
    /// The bytes of all streams on which the link's ends send messages.
    pub(super) bytes: u64,
    /// About how many messages are corrupt between those that were read.
    pub(super) corrupt: usize,
    /// The sides that sent each stream.
    pub(super) senders: Vec<Vec<&'static str>>,
}

impl Piece {
    pub(super) fn end(&self) -> u64 {
        self.begin + self.bytes.len() as u64
    }

    fn weight(&self) -> u64 {
        self.bytes.len() as u64 * if self.level == Level::Written { 2 } else { 1 }
    }

    /// Whether it is the better explanation of bytes that both have: it is written so, or it is not a part of the other.
    pub(super) fn explains_more_than(&self, other: &Self) -> bool {
        let is_part = other.begin <= self.begin && self.end() <= other.end();
        self.level > other.level || self.level == other.level && !is_part
    }

    pub(super) fn value(&self) -> Value {
        serde_json::from_str(&self.json).unwrap_or_default()
    }
}

impl Reading {
    /// Twice the bytes of what is written as it was read, and those of what is not.
    pub(super) fn weight(&self) -> u64 {
        self.pieces.iter().map(Piece::weight).sum()
    }

    pub(super) fn explained(&self) -> u64 {
        self.pieces.iter().map(|piece| piece.bytes.len() as u64).sum()
    }

    /// The messages that overlap one of another reading.
    pub(super) fn overlapping(&self, piece: &Piece) -> &[Piece] {
        let before = |other: &Piece| (other.stream, other.end()) <= (piece.stream, piece.begin);
        let rest = self.pieces.get(self.pieces.partition_point(before)..).unwrap_or_default();
        let count = rest.partition_point(|other| (other.stream, other.begin) < (piece.stream, piece.end()));
        rest.get(..count).unwrap_or_default()
    }

    /// The piece of these bytes.
    pub(super) fn same(&self, piece: &Piece) -> Option<&Piece> {
        let key = |it: &Piece| (it.stream, it.begin);
        let at = self.pieces.binary_search_by_key(&key(piece), key).ok()?;
        self.pieces.get(at).filter(|found| found.bytes.len() == piece.bytes.len())
    }
}

impl Stream {
    /// The sides of a link that may have sent it, the likeliest first.
    pub(super) fn sides(&self, link: &Link) -> Vec<&'static str> {
        let all = || link.sides.to_vec();
        match &self.sender {
            Sender::Unknown => all(),
            Sender::Named(name) => match link.sides.iter().find(|side| **side == name) {
                Some(side) => vec![side],
                None => all(),
            },
            Sender::Connected { is_client, port } => {
                let likely = (link.sender)(*is_client, *port);
                let others = link.sides.iter().copied().filter(|side| Some(*side) != likely);
                likely.into_iter().chain(others).collect()
            }
            Sender::Traced { name, sent } => match link.traces.iter().find(|(known, _)| known == name) {
                Some((_, [sender, receiver])) => {
                    (if *sent { sender } else { receiver }).iter().copied().collect()
                }
                None => all(),
            },
        }
    }

    /// How many bytes it has.
    pub fn size(&self) -> usize {
        self.parts.iter().map(Vec::len).sum()
    }
}

/// JSON has no number for NaN.
fn has_null(value: &Value) -> bool {
    match value {
        Value::Null => true,
        Value::Array(values) => values.iter().any(has_null),
        Value::Object(fields) => fields.values().any(has_null),
        _ => false,
    }
}

impl Combination {
    pub(super) fn new(link: &'static Link, settings: Map<String, Value>) -> Result<Self> {
        let codecs = link.sides.iter().map(|side| Ok((*side, (link.codec)(side, &settings)?)));
        Ok(Self { link, codecs: codecs.collect::<Result<_>>()?, settings })
    }

    fn codec(&mut self, side: &str) -> Option<&mut Box<dyn Codec>> {
        self.codecs.iter_mut().find(|(name, _)| *name == side).map(|(_, codec)| codec)
    }

    /// The bytes of a message.
    pub(super) fn encode(&mut self, side: &str, message: Value) -> Option<Vec<u8>> {
        self.codec(side)?.encode(message).ok()
    }

    /// The message in bytes that is explained best, if there is any.
    pub(super) fn within(&mut self, side: &str, bytes: &[u8]) -> Within {
        let mut found = Vec::new();
        let Some(codec) = self.codec(side) else { return Within::default() };
        let (begin, mut rest, mut ended) = (codec.position(), bytes, false);
        while !ended {
            ended = rest.is_empty();
            if ended {
                codec.finish();
            } else {
                let taken = codec.push(rest);
                rest = rest.get(taken..).unwrap_or_default();
            }
            let (mut at, mut json) = (codec.position(), Vec::new());
            while let Some(kind) = codec.next(&mut json) {
                if kind == Kind::Message {
                    found.push((at - begin, codec.position() - begin, core::mem::take(&mut json)));
                }
                json.clear();
                at = codec.position();
            }
        }
        codec.clear();
        let (mut best, mut weight) = (Within::default(), 0);
        for (from, to, json) in found {
            let place = |at: u64| usize::try_from(at).unwrap_or(usize::MAX);
            let bytes = bytes.get(place(from)..place(to)).unwrap_or_default();
            let message: Value = serde_json::from_slice(&json).unwrap_or_default();
            let written = self.encode(side, message.clone()).as_deref() == Some(bytes);
            let (level, len) = (if written { Level::Written } else { Level::Read }, bytes.len());
            weight += if written { 2 * len } else { len };
            if (level, len) > (best.level, best.len) {
                best = Within { weight, level, len, message };
            }
        }
        Within { weight, ..best }
    }

    /// A message without the bytes that another one has already, if it is one without them.
    fn trimmed(&mut self, taken: &[Piece], mut piece: Piece) -> Option<Piece> {
        let at = taken.partition_point(|other| other.end() <= piece.begin);
        let Some(other) = taken.get(at).filter(|other| other.begin < piece.end()) else { return Some(piece) };
        let common = usize::try_from(other.end().checked_sub(piece.begin)?).ok()?;
        let is_last = taken.get(at + 1).is_none_or(|next| piece.end() <= next.begin);
        let rest = piece.bytes.get(common..).filter(|_| is_last && other.begin < piece.begin)?;
        let Within { level, len, message, .. } = self.within(piece.side, rest);
        if len < rest.len() || rest.is_empty() {
            return None;
        }
        (piece.level, piece.begin, piece.bytes) = (level, other.end(), rest.to_vec());
        piece.json = message.to_string();
        Some(piece)
    }

    /// What it makes of streams. Unless `exactly`, what is read counts as what is written.
    pub(super) fn read(&mut self, streams: &[Stream], exactly: bool) -> Result<Reading> {
        let mut reading = Reading::default();
        for (number, stream) in streams.iter().enumerate() {
            let mut sides: Vec<Vec<Piece>> = Vec::new();
            for side in stream.sides(self.link) {
                sides.push(self.read_side(number, stream, side, exactly)?);
            }
            let weight = |pieces: &Vec<Piece>| pieces.iter().map(Piece::weight).sum::<u64>();
            // Of equals the first.
            sides.sort_by_key(|pieces| core::cmp::Reverse(weight(pieces)));
            let mut pieces: Vec<Piece> = Vec::new();
            let possible = sides.len();
            for more in sides {
                // One line may have both ends' messages.
                let more = more.into_iter().filter_map(|piece| self.trimmed(&pieces, piece));
                let more: Vec<Piece> = more.collect();
                pieces.extend(more);
                pieces.sort_by_key(|piece| piece.begin);
            }
            // The other end may send no messages.
            if !pieces.is_empty() || possible > 0 && self.link.sides.len() > 1 {
                reading.bytes += stream.size() as u64;
            }
            reading.corrupt += corrupt(stream, &pieces);
            let mut senders: Vec<&'static str> = Vec::new();
            for piece in &pieces {
                if !senders.contains(&piece.side) {
                    senders.push(piece.side);
                }
            }
            reading.senders.push(senders);
            reading.pieces.extend(pieces);
        }
        if exactly {
            let mut before: Vec<(usize, &'static str, Value)> = Vec::new();
            for piece in &mut reading.pieces {
                let value = piece.value();
                piece.sense = plausible(&value);
                let same = before
                    .iter_mut()
                    .find(|(stream, side, _)| (*stream, *side) == (piece.stream, piece.side));
                match same {
                    Some((.., last)) => {
                        piece.sense += (self.link.open.sense)(last, &value);
                        *last = value;
                    }
                    None => before.push((piece.stream, piece.side, value)),
                }
            }
        }
        Ok(reading)
    }

    fn read_side(
        &mut self,
        number: usize,
        stream: &Stream,
        side: &'static str,
        exactly: bool,
    ) -> Result<Vec<Piece>> {
        let parts: Vec<Vec<&[u8]>> = stream.parts.iter().map(|part| vec![part.as_slice()]).collect();
        let mut pieces = Vec::new();
        let all = stream.parts.concat();
        for item in codec::items((self.link.codec)(side, &self.settings)?, &parts)? {
            let Ok(json) = item.content else { continue };
            let (begin, end) = (usize::try_from(item.offset)?, usize::try_from(item.offset + item.length)?);
            let bytes = all.get(begin..end).unwrap_or_default().to_vec();
            let is_written = !exactly || {
                let message: Value = serde_json::from_str(&json)?;
                let is_number = !has_null(&message);
                // What is no number cannot be written, and says nothing: it may be corrupt. That it makes no sense counts.
                self.encode(side, message).map_or(!is_number, |written| written == bytes)
            };
            let level = if is_written { Level::Written } else { Level::Read };
            pieces.push(Piece { stream: number, begin: item.offset, bytes, side, level, json, sense: 0.0 });
        }
        Ok(pieces)
    }
}

/// About how many messages are missing between those that were read: those cut off at both ends are none.
fn corrupt(stream: &Stream, pieces: &[Piece]) -> usize {
    let bytes: usize = pieces.iter().map(|piece| piece.bytes.len()).sum();
    let usual = bytes.checked_div(pieces.len()).unwrap_or_default().max(1);
    let ends: Vec<u64> = stream
        .parts
        .iter()
        .scan(0, |end, part| {
            *end += part.len() as u64;
            Some(*end)
        })
        .collect();
    let pairs = pieces.iter().zip(pieces.iter().skip(1));
    pairs
        .filter(|(before, after)| !ends.iter().any(|end| before.end() <= *end && *end <= after.begin))
        .map(|(before, after)| usize::try_from(after.begin - before.end()).unwrap_or(usize::MAX))
        .filter(|gap| *gap > 0)
        .map(|gap| (gap / usual).max(1))
        .sum()
}
