//! A combination of settings, and its reading of bytes.

use anyhow::Result;
use serde_json::{Map, Value};

use super::plausible::plausible;
use super::{Sender, Stream};
use cellwire_links::codec::{self, Codec, Kind};
use cellwire_links::link::Link;

/// How well bytes are explained.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub(super) enum Level {
    /// The bytes are not a message.
    #[default]
    None,
    /// The bytes are a message, which is written another way.
    Read,
    /// The bytes are a message as it is written.
    Written,
}

impl Level {
    /// Returns the weight of a piece: each byte counts twice if the piece is written as it was read, and once if it is only
    /// read.
    fn weight(self, len: usize) -> u64 {
        len as u64 * self as u64
    }
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
    /// The sense that the message's numbers and texts make.
    pub(super) sense: f64,
}

/// A message among some bytes.
#[derive(Debug, Default)]
pub(super) struct MessageWithin {
    /// The weight of all messages.
    pub(super) weight: u64,
    pub(super) level: Level,
    pub(super) len: usize,
    pub(super) message: Value,
}

/// The result of a combination for all streams.
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
        self.level.weight(self.bytes.len())
    }

    /// Returns whether this is the better explanation of bytes that both have: it is written as it was read, or it is not a
    /// part of the other.
    pub(super) fn explains_more_than(&self, other: &Self) -> bool {
        let is_part = other.begin <= self.begin && self.end() <= other.end();
        self.level > other.level || self.level == other.level && !is_part
    }

    pub(super) fn value(&self) -> Value {
        serde_json::from_str(&self.json).unwrap_or_default()
    }
}

impl Reading {
    /// Returns twice the number of bytes that are written as they were read, and once the number of the others.
    pub(super) fn weight(&self) -> u64 {
        self.pieces.iter().map(Piece::weight).sum()
    }

    pub(super) fn explained(&self) -> u64 {
        self.pieces.iter().map(|piece| piece.bytes.len() as u64).sum()
    }

    /// Returns the messages that overlap a message of another reading.
    pub(super) fn overlapping(&self, piece: &Piece) -> &[Piece] {
        let before = |other: &Piece| (other.stream, other.end()) <= (piece.stream, piece.begin);
        let rest = self.pieces.get(self.pieces.partition_point(before)..).unwrap_or_default();
        let count = rest.partition_point(|other| (other.stream, other.begin) < (piece.stream, piece.end()));
        rest.get(..count).unwrap_or_default()
    }

    /// Returns the piece of these bytes.
    pub(super) fn same(&self, piece: &Piece) -> Option<&Piece> {
        let key = |it: &Piece| (it.stream, it.begin);
        let at = self.pieces.binary_search_by_key(&key(piece), key).ok()?;
        self.pieces.get(at).filter(|found| found.bytes.len() == piece.bytes.len())
    }
}

impl Stream {
    /// Returns the sides of a link that may have sent the stream, the likeliest first: if nothing is known, the sides that
    /// have sent no other stream.
    pub(super) fn sides(&self, link: &Link, of_others: &[Vec<&'static str>]) -> Vec<&'static str> {
        let all = || {
            let mut sides = link.sides.to_vec();
            sides.sort_by_key(|side| of_others.iter().any(|others| others.contains(side)));
            sides
        };
        let first = |likely: Option<&'static str>| {
            let others = link.sides.iter().copied().filter(|side| Some(*side) != likely);
            likely.into_iter().chain(others).collect()
        };
        match &self.sender {
            Sender::Unknown => all(),
            Sender::Named(name) => match link.sides.iter().find(|side| **side == name) {
                Some(side) => vec![side],
                None => all(),
            },
            Sender::Other(name) if link.sides.contains(&name.as_str()) => {
                link.sides.iter().copied().filter(|side| side != name).collect()
            }
            Sender::Other(_) => all(),
            Sender::Kept { by_keeper } => first(link.keeper(None, *by_keeper).ok().flatten()),
            Sender::Connected { is_client, port } => first((link.sender)(*is_client, *port)),
            Sender::Traced { name, sent } => match link.traces.iter().find(|(known, _)| known == name) {
                Some((_, [sender, receiver])) => {
                    (if *sent { sender } else { receiver }).iter().copied().collect()
                }
                None => all(),
            },
        }
    }

    /// Returns the number of bytes of all parts.
    pub fn size(&self) -> usize {
        self.parts.iter().map(Vec::len).sum()
    }
}

/// Returns whether a value contains null, which stands for NaN: JSON has no number for it.
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

    /// Encodes a message, and returns the bytes.
    pub(super) fn encode(&mut self, side: &str, message: Value) -> Option<Vec<u8>> {
        self.codec(side)?.encode(message).ok()
    }

    /// Finds the message in some bytes that is explained best, if there is one.
    pub(super) fn within(&mut self, side: &str, bytes: &[u8]) -> MessageWithin {
        let mut found = Vec::new();
        let Some(codec) = self.codec(side) else { return MessageWithin::default() };
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
        let mut best = MessageWithin::default();
        for (from, to, json) in found {
            let place = |at: u64| usize::try_from(at).unwrap_or(usize::MAX);
            let bytes = bytes.get(place(from)..place(to)).unwrap_or_default();
            let message: Value = serde_json::from_slice(&json).unwrap_or_default();
            let written = self.encode(side, message.clone()).as_deref() == Some(bytes);
            let (level, len) = (if written { Level::Written } else { Level::Read }, bytes.len());
            best.weight += level.weight(len);
            if (level, len) > (best.level, best.len) {
                (best.level, best.len, best.message) = (level, len, message);
            }
        }
        best
    }

    /// Removes the bytes that another message has already; `None` if the rest is not a message.
    fn trimmed(&mut self, taken: &[Piece], mut piece: Piece) -> Option<Piece> {
        let at = taken.partition_point(|other| other.end() <= piece.begin);
        let Some(other) = taken.get(at).filter(|other| other.begin < piece.end()) else { return Some(piece) };
        let common = usize::try_from(other.end().checked_sub(piece.begin)?).ok()?;
        let is_last = taken.get(at + 1).is_none_or(|next| piece.end() <= next.begin);
        let rest = piece.bytes.get(common..).filter(|_| is_last && other.begin < piece.begin)?;
        let MessageWithin { level, len, message, .. } = self.within(piece.side, rest);
        if len < rest.len() || rest.is_empty() {
            return None;
        }
        (piece.level, piece.begin, piece.bytes) = (level, other.end(), rest.to_vec());
        piece.json = message.to_string();
        Some(piece)
    }

    /// Reads streams. Unless `exactly`, a message that is read counts as one that is written.
    pub(super) fn read(&mut self, streams: &[Stream], exactly: bool) -> Result<Reading> {
        let mut reading = Reading::default();
        for (number, stream) in streams.iter().enumerate() {
            let mut sides: Vec<Vec<Piece>> = Vec::new();
            for side in stream.sides(self.link, &reading.senders) {
                sides.push(self.read_side(number, stream, side, exactly)?);
            }
            let weight = |pieces: &Vec<Piece>| pieces.iter().map(Piece::weight).sum::<u64>();
            // Of equal sides the first stays first.
            sides.sort_by_key(|pieces| core::cmp::Reverse(weight(pieces)));
            let mut pieces: Vec<Piece> = Vec::new();
            for more in sides {
                // One line may have both ends' messages.
                let more = more.into_iter().filter_map(|piece| self.trimmed(&pieces, piece));
                let more: Vec<Piece> = more.collect();
                pieces.extend(more);
                pieces.sort_by_key(|piece| piece.begin);
            }
            // The other end may send no messages.
            if !pieces.is_empty() || self.link.sides.len() > 1 {
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
                // JSON cannot represent infinities and NaN, so the message cannot be written. That is not evidence against it:
                // the bytes may be corrupt. It counts that the message makes no sense.
                self.encode(side, message).map_or(!is_number, |written| written == bytes)
            };
            let level = if is_written { Level::Written } else { Level::Read };
            pieces.push(Piece { stream: number, begin: item.offset, bytes, side, level, json, sense: 0.0 });
        }
        Ok(pieces)
    }
}

/// Returns about how many messages are missing between those that were read, without those cut off at both ends.
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

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn piece(stream: usize, begin: u64, bytes: &[u8]) -> Piece {
        let (side, level, json) = ("central", Level::Written, String::new());
        Piece { stream, begin, bytes: bytes.to_vec(), side, level, json, sense: 0.0 }
    }

    fn of(pieces: &[(usize, u64, u64)]) -> Vec<Piece> {
        let piece = |&(stream, begin, end): &(usize, u64, u64)| {
            piece(stream, begin, &vec![0; usize::try_from(end - begin).unwrap()])
        };
        pieces.iter().map(piece).collect()
    }

    fn stream(parts: &[usize]) -> Stream {
        let parts = parts.iter().map(|size| vec![0; *size]).collect();
        Stream { sender: Sender::Unknown, parts, arrivals: Vec::new() }
    }

    fn mma() -> Combination {
        Combination::new(Link::by_name("mmacell-proto").unwrap(), Map::new()).unwrap()
    }

    #[test]
    fn the_messages_of_a_reading() {
        let mut pieces = of(&[(0, 0, 5), (0, 5, 10), (0, 10, 15), (0, 16, 19), (1, 5, 10)]);
        pieces[1].level = Level::Read;
        let reading = Reading { pieces, ..Reading::default() };
        assert_eq!((reading.weight(), reading.explained()), (10 + 5 + 10 + 6 + 10, 23));
        for (place, overlapping) in
            [((0, 5, 10), vec![5]), ((0, 4, 16), vec![0, 5, 10]), ((0, 15, 16), vec![]), ((1, 0, 6), vec![5])]
        {
            let found = reading.overlapping(&of(&[place])[0]).iter().map(|it| it.begin);
            assert_eq!(found.collect::<Vec<_>>(), overlapping, "{place:?}");
        }
        let same = |place| reading.same(&of(&[place])[0]).is_some();
        assert_eq!([(0, 5, 10), (0, 5, 9), (1, 0, 5)].map(same), [true, false, false]);
    }

    #[test]
    fn what_explains_more() {
        let [one, other] = [Level::Read, Level::Written];
        for (place, level, beside, of_beside, more) in [
            ((0, 0, 5), one, (0, 0, 5), one, false),
            ((0, 0, 5), one, (0, 0, 3), one, true),
            ((0, 0, 5), one, (0, 2, 5), one, true),
            ((0, 1, 4), one, (0, 0, 5), one, false),
            ((0, 0, 5), one, (0, 0, 3), other, false),
            ((0, 1, 2), other, (0, 0, 5), one, true),
        ] {
            let [mut a, mut b] = [place, beside].map(|place| of(&[place]).remove(0));
            (a.level, b.level) = (level, of_beside);
            assert_eq!(a.explains_more_than(&b), more, "{place:?} {beside:?}");
        }
    }

    /// Where bytes of the capture are missing, nothing is corrupt.
    #[test]
    fn what_is_between_messages_is_corrupt() {
        let near: &[_] = &[(0, 0, 4), (0, 20, 24)];
        for (parts, pieces, messages) in [
            (&[60][..], near, 4),
            (&[2, 58], near, 4),
            (&[30, 30], near, 4),
            (&[4, 56], near, 0),
            (&[12, 48], near, 0),
            (&[20, 40], near, 0),
            (&[60], &[(0, 0, 4), (0, 5, 9), (0, 9, 13)], 1),
            (&[60], &[(0, 30, 34)], 0),
            (&[60], &[], 0),
        ] {
            assert_eq!(corrupt(&stream(parts), &of(pieces)), messages, "{parts:?} {pieces:?}");
        }
        let mut lines = b"STA\r\n???\r\nSTA\r\n".to_vec();
        lines[5..8].copy_from_slice(b"\xFF\0?");
        let one = Stream { parts: vec![lines], ..stream(&[]) };
        assert_eq!(mma().read(&[one.clone(), one], true).unwrap().corrupt, 2);
    }

    #[test]
    fn the_best_of_several_messages() {
        for (bytes, weight, level, message) in [
            (&b"STA\r\nSTA\r\n"[..], 20, Level::Written, r#"{"command":"STA"}"#),
            (b"SRVON\r\nSTA\r\n", 24, Level::Written, r#"{"command":"SRV","on":true}"#),
            (b"SRVON\r\nSRVOF\r\n", 28, Level::Written, r#"{"command":"SRV","on":true}"#),
            (b"???\r\nSTA\r\n", 10, Level::Written, r#"{"command":"STA"}"#),
            (b"???\r\n", 0, Level::None, "null"),
        ] {
            let found = mma().within("central", bytes);
            assert_eq!(
                (found.weight, found.level, found.message.to_string()),
                (weight, level, message.into())
            );
        }
    }

    /// If two messages share bytes, the second is read again without the shared ones.
    #[test]
    fn a_message_without_the_bytes_of_another() {
        let line = |begin, bytes: &[u8]| piece(0, begin, bytes);
        let two = line(10, b"STA\r\nSTA\r\n");
        for (taken, begin) in [
            (vec![], Some(10)),
            (vec![(0, 0, 10)], Some(10)),
            (vec![(0, 20, 25)], Some(10)),
            (vec![(0, 0, 5), (0, 5, 15)], Some(15)),
            (vec![(0, 5, 15), (0, 20, 25)], Some(15)),
            (vec![(0, 5, 15), (0, 19, 25)], None),
            (vec![(0, 5, 14)], None),
            (vec![(0, 5, 20)], None),
            (vec![(0, 5, 25)], None),
            (vec![(0, 10, 15)], None),
            (vec![(0, 11, 15)], None),
        ] {
            let trimmed = mma().trimmed(&of(&taken), two.clone());
            assert_eq!(trimmed.map(|it| it.begin), begin, "{taken:?}");
        }
    }
}
