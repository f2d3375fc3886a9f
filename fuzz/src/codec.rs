//! The decoder and the messages of each side of a link, in any of its settings.

use core::iter;

use arbitrary::{Arbitrary, Unstructured};
use bytes::{Buf, BytesMut};
use cellwire_links::codec::{self, StreamItem};
use cellwire_links::link::{AcceptedMessage, Link};
use cellwire_links::settings::insert;
use cellwire_links::vectors::{Outcome, Vector, vectors};
use robot_session::contract::Rng;
use robot_session::tokio::Codec;
use serde_json::{Map, Value, json};
use testkit::contract::{Change, Objects};
use testkit::reference_file;
use tokio_util::codec::Decoder as _;

use crate::{Bytes, Target};

/// A stream of any bytes that a side of the link sends.
#[derive(Debug, Arbitrary)]
struct Stream {
    settings: Settings,
    /// Read by tokio's codec, not by the decoder.
    is_framed: bool,
    /// The bytes in each read, less one.
    size: u8,
    bytes: Bytes,
}

/// A message to write and to read again.
#[derive(Debug, Arbitrary)]
struct Message {
    /// The position at which the bytes of the message are cut, modulo their number.
    cut: u8,
    source: InputSource,
}

#[derive(Debug, Arbitrary)]
enum InputSource {
    /// A message of the vectors, with changes.
    Vector {
        vector: u16,
        /// The settings in place of those of the vector, as in [`Settings`].
        others: u8,
        changes: Vec<Change>,
    },
    /// A value of the crate's own types.
    Typed { settings: Settings, bytes: Bytes },
}

/// A side and its settings, each counted on from the first again after the last.
#[derive(Debug, Clone, Copy, Arbitrary)]
struct Settings {
    /// The number of a side and settings that vectors are written with.
    place: u8,
    /// Other values of the settings, by the digits of this number; 0 for none.
    others: u8,
}

/// Returns a target for the decoder of each side.
pub(crate) fn decoder(link: &'static Link) -> Target {
    let codecs = Codecs::of(link);
    Target::new(codecs.streams(), move |stream| codecs.stream(&stream))
}

/// Returns a target for the messages of each side.
pub(crate) fn message(link: &'static Link) -> Target {
    let codecs = Codecs::of(link);
    Target::new(codecs.messages(), move |message| codecs.message(&message))
}

/// The codecs of a link.
struct Codecs {
    link: &'static Link,
    /// The sides and settings with which the vectors are written.
    known: Vec<(&'static str, Map<String, Value>)>,
    /// The vectors, each with the index of its side and settings.
    vectors: Vec<(usize, Vector)>,
    /// The settings of a few values, each with those other than the default.
    settings: Vec<(String, Vec<Value>)>,
}

/// A side of the link, and the settings of its codec.
struct CodecSide {
    link: &'static Link,
    side: &'static str,
    settings: Map<String, Value>,
}

impl Codecs {
    fn of(link: &'static Link) -> Self {
        let mut known: Vec<_> = link.sides.iter().map(|side| (*side, Map::new())).collect();
        let vectors = vectors(reference_file(&format!("vectors/{}.json", link.name))).unwrap().into_iter();
        let vectors = vectors.map(|vector| {
            let way = (link.side(vector.from.as_deref()).unwrap(), vector.options.clone());
            let place = known.iter().position(|known| *known == way).unwrap_or_else(|| {
                known.push(way);
                known.len() - 1
            });
            (place, vector)
        });
        let vectors = vectors.collect();
        let settings = (link.settings)().into_iter().filter(|setting| {
            ["bool", "word"].contains(&setting.unit)
                || setting.unit == "number" && setting.values.contains(", ")
        });
        let settings = settings.map(|setting| {
            let values = setting.values.replace(" or ", ", ");
            let values =
                values.split(", ").map(|text| serde_json::from_str(text).unwrap_or_else(|_| text.into()));
            (setting.name, values.filter(|value| *value != setting.default).collect())
        });
        Self { link, known, vectors, settings: settings.collect() }
    }

    /// Returns a side with its settings.
    fn way(&self, Settings { place, others }: Settings) -> CodecSide {
        let (side, mut settings) = self.known[usize::from(place) % self.known.len()].clone();
        let mut others = usize::from(others);
        for (name, values) in &self.settings {
            if let Some(other) = (others % (values.len() + 1)).checked_sub(1) {
                insert(&mut settings, name, values[other].clone()).unwrap();
            }
            others /= values.len() + 1;
        }
        CodecSide { link: self.link, side, settings }
    }

    /// Returns the streams of the vectors, alone and all of one direction, as bytes of a [`Stream`].
    fn streams(&self) -> Vec<Vec<u8>> {
        let input = |place: usize, stream: &[u8]| [&[place as u8, 0, 0, 6], stream].concat();
        let alone = self.vectors.iter().map(|(place, vector)| input(*place, &vector.bytes));
        let all = (0..self.known.len()).map(|place| {
            let of = self.vectors.iter().filter(|(at, _)| *at == place);
            input(place, &of.flat_map(|(_, vector)| vector.bytes.iter().copied()).collect::<Vec<_>>())
        });
        alone.chain(all).collect()
    }

    /// Returns every message of the vectors with changes, and as many values of the crate's types, as bytes of a [`Message`].
    fn messages(&self) -> Vec<Vec<u8>> {
        let changed = |number: usize| {
            let vector = (number as u16).to_le_bytes();
            [&[0; 5][..], &vector, &[0], &Rng::new(number as u64).bytes(40)].concat()
        };
        let typed = |number: usize| {
            let bytes = Rng::new(number as u64).bytes(300);
            [&[7, 0xFF, 0xFF, 0xFF, 0xFF, number as u8, 0], &bytes[..]].concat()
        };
        (0..self.vectors.len()).flat_map(|number| [changed(number), typed(number)]).collect()
    }

    /// Checks a stream: the division into reads has no effect, every byte is in one item, an accepted message is
    /// encoded as it was read or as the link allows, and the message after the end is read.
    fn stream(&self, Stream { settings, is_framed, size, bytes: Bytes(stream) }: &Stream) {
        let way = self.way(*settings);
        let Some(next) = self.good(&way, settings.place.into()) else { return };
        let size = usize::from(*size) + 1;
        let whole = way.items(&[stream], &next);
        if *is_framed {
            let contents: Vec<_> = whole.iter().map(|item| item.content.clone()).collect();
            assert_eq!(way.framed(stream, size), contents, "tokio's codec, and the decoder");
        } else {
            let pieces: Vec<_> = stream.chunks(size).collect();
            let pieces = way.items(&pieces, &next);
            let (pieces, whole) = (pieces.iter().map(placed), whole.iter().map(placed));
            assert!(pieces.clone().eq(whole.clone()), "cut: {pieces:?}, and {whole:?}");
        }
        for (from, length, content) in whole.iter().map(placed) {
            assert!(length > 0, "the decoder makes no progress at byte {from}");
            if let Ok(message) = content {
                way.check(message, &stream[from..from + length]);
            }
        }
    }

    /// Returns the bytes of a message that a side sends.
    fn good(&self, way: &CodecSide, place: usize) -> Option<Vec<u8>> {
        let is_its = |(at, vector): &&(usize, Vector)| {
            *at == place % self.known.len() && vector.result == Outcome::Valid && !vector.end
        };
        let codec = way.codec()?;
        let of = self.vectors.iter().filter(is_its).filter_map(|(_, vector)| vector.message.clone());
        of.filter_map(|message| codec.encode(message).ok()).next()
    }

    /// Checks a message: if it can be encoded, it decodes to itself and a part of it is not a message; any other is
    /// refused.
    fn message(&self, Message { cut, source }: &Message) {
        let (way, message) = match source {
            InputSource::Vector { vector, others, changes } => self.changed(*vector, *others, changes),
            InputSource::Typed { settings, bytes: Bytes(bytes) } => {
                let way = self.way(*settings);
                let made = |codec: Box<dyn codec::Codec>| codec.arbitrary(&mut Unstructured::new(bytes)).ok();
                let message = way.codec().and_then(made);
                (way, message)
            }
        };
        if let Some(message) = message {
            way.check_message(&message, (*cut).into());
        }
    }

    /// Returns a message of the vectors with changes, if the settings have the message.
    fn changed(&self, vector: u16, others: u8, changes: &[Change]) -> (CodecSide, Option<Value>) {
        let (place, vector) = &self.vectors[usize::from(vector) % self.vectors.len()];
        let way = self.way(Settings { place: *place as u8, others });
        if way.codec().is_none() {
            return (way, None);
        }
        // As these settings show it, where they read its bytes.
        let shown = way.items(&[&vector.bytes], &[]).into_iter().find_map(|item| item.content.ok());
        let mut message = shown.map(|json| parsed(&json)).or(vector.message.clone());
        if let Some(message) = &mut message {
            changes.iter().for_each(|change| change.apply(message));
        }
        (way, message)
    }
}

impl CodecSide {
    /// Checks that a message that can be written is read again as it was, also three of them after one another, and that a
    /// part of it is not a message.
    fn check_message(&self, message: &Value, cut: usize) {
        let Some(codec) = self.codec() else { return };
        let Ok(bytes) = codec.encode(message.clone()) else { return };
        let read = |count| {
            let items = self.items(&[&bytes.repeat(count)], &[]);
            let is_it = |(_, length, content): (usize, usize, &Result<String, String>)| {
                let Ok(read) = content.as_ref().map(|json| parsed(json)) else { return false };
                // With a list of another length it may be shown under another key.
                let mut keys = read.as_object().into_iter().flat_map(Map::keys);
                let is_other = keys.any(|key| message.get(key).is_none());
                let is_same =
                    same(message, &read) || is_other && codec.encode(read).is_ok_and(|it| it == bytes);
                length == bytes.len() && is_same
            };
            let is_read = items.len() == count && items.iter().map(placed).all(is_it);
            assert!(is_read, "{items:?}, of {message}: {bytes:02X?}");
            items.iter().all(|item| !item.at_end)
        };
        // If only the end of the stream limits the frame, nothing may follow.
        let _ = read(1) && read(3);
        let part = self.items(&[&bytes[..cut % bytes.len()]], &[]);
        assert!(part.iter().all(|item| item.at_end), "{part:?}, of {bytes:02X?}");
    }

    fn codec(&self) -> Option<Box<dyn codec::Codec>> {
        (self.link.codec)(self.side, &self.settings).ok()
    }

    /// Returns the items of a stream, and of the one message after its end.
    fn items(&self, pieces: &[&[u8]], next: &[u8]) -> Vec<StreamItem> {
        let mut items = codec::items(self.codec().unwrap(), &[pieces.to_vec(), vec![next]]).unwrap();
        if !next.is_empty() {
            let last = items.pop().unwrap();
            assert!(
                last.content.is_ok() && last.length == next.len() as u64,
                "what follows the end is read: {last:?}"
            );
        }
        items
    }

    /// Encodes an accepted message again, and checks that it decodes to the same.
    fn check(&self, json: &str, bytes: &[u8]) {
        let message = parsed(json);
        let written = self.codec().unwrap().encode(message.clone());
        let written = written.ok();
        let accepted = AcceptedMessage {
            settings: &self.settings,
            message: &message,
            bytes,
            written: written.as_deref(),
        };
        assert!(self.link.accepts(&accepted), "{accepted:02X?}");
        if let Some(written) = written.filter(|written| written != bytes) {
            let again = self.items(&[&written], &[]);
            let [StreamItem { content: Ok(again), .. }] = &again[..] else {
                panic!("{again:?}, of {message}")
            };
            assert!(same(&parsed(again), &message), "{again}, of {message}");
        }
    }

    /// Returns the items of tokio's codec, called as by a framed transport.
    fn framed(&self, stream: &[u8], size: usize) -> Vec<Result<String, String>> {
        let (mut codec, mut buffer) =
            (Codec::new(Objects(self.codec().unwrap()), |json| json), BytesMut::new());
        let mut items = Vec::new();
        for piece in stream.chunks(size) {
            buffer.extend_from_slice(piece);
            items.extend(iter::from_fn(|| codec.decode(&mut buffer).unwrap()));
            assert!(
                !buffer.has_remaining(),
                "the codec takes all bytes, and keeps those of an incomplete frame"
            );
        }
        items.extend(iter::from_fn(|| codec.decode_eof(&mut buffer).unwrap()));
        items.into_iter().map(|item| item.map_err(|error| error.to_string())).collect()
    }
}

/// Returns the position, the length and the content of an item.
fn placed(item: &StreamItem) -> (usize, usize, &Result<String, String>) {
    (item.offset as usize, item.length as usize, &item.content)
}

fn parsed(json: &str) -> Value {
    serde_json::from_str(json).unwrap()
}

/// Returns whether two objects are one message: a key may be missing if its value is a flag or empty, and so may the last
/// such values of a list. Numbers with a fraction are rounded to the places of their field, and a flag is a number that is 0
/// or 1.
fn same(one: &Value, other: &Value) -> bool {
    let is_empty =
        |value: &Value| value.is_boolean() || [Value::Null, 0.into(), json!([]), json!([""])].contains(value);
    match (one, other) {
        (Value::Object(one), Value::Object(other)) => {
            let all = one
                .iter()
                .all(|(key, value)| other.get(key).map_or_else(|| is_empty(value), |it| same(value, it)));
            all && other.iter().all(|(key, value)| one.contains_key(key) || is_empty(value))
        }
        (Value::Array(one), Value::Array(other)) => {
            let (short, long) = if one.len() < other.len() { (one, other) } else { (other, one) };
            let (head, rest) = long.split_at(short.len());
            head.iter().zip(short).all(|(one, other)| same(one, other))
                && rest.iter().all(|value| value == false || value == "")
        }
        (Value::Number(_), Value::Number(_)) if one.is_f64() || other.is_f64() => {
            let near = |(one, other): (f64, f64)| (one - other).abs() <= 0.001 + one.abs() / 1e6;
            one.as_f64().zip(other.as_f64()).is_some_and(near)
        }
        (Value::Bool(flag), Value::Number(number)) | (Value::Number(number), Value::Bool(flag)) => {
            number.as_u64() == Some(u64::from(*flag))
        }
        _ => one == other,
    }
}
