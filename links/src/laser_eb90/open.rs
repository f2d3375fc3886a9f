//! The properties of frames that the source leaves open, and the tags that the payloads suggest.

use laser_eb90::{Profile, Tags, Tail};
use serde_json::{Map, Value, json};

use crate::link::{DecidingMessage, Guess, OpenSettings};
use crate::settings;

pub(super) const OPEN: OpenSettings = OpenSettings {
    settings: &["tail", "flag", "tags", "checksum", "checksum_negated", "checksum_with_flag", "byte_order"],
    beside: &[],
    guess: Some(Guess { setting: "tags", with: &["tail", "flag"], values: tags }),
    deciding: &[
        DecidingMessage { side: "controller", about: "any frame", message: r#"{"items":[{"i16":[257]}]}"# },
        DecidingMessage {
            side: "host",
            about: "a frame with floats",
            message: r#"{"items":[{"i16":[257]},{"f32":[100.0,-50.5,250.0,0.5,90.0,-45.25]}]}"#,
        },
        DecidingMessage {
            side: "host",
            about: "a frame with a text",
            message: r#"{"items":[{"char":"PROGRAM ONE IS READY TO BE RUN BY THE HOST"}]}"#,
        },
        DecidingMessage {
            side: "host",
            about: "a frame with bytes that are not text",
            message: r#"{"items":[{"u8":[0,1,2,3,4,5,6,7,8,9,10,11,12,13,14,15]}]}"#,
        },
    ],
    reads_more: &[("tail", "either", "a frame that ends 90 83")],
    rust: |given, _| {
        let profile = settings::read("laser", Profile::default(), given)?;
        let enums = [("tail", "Tail"), ("flag", "Flag"), ("checksum", "Width"), ("byte_order", "ByteOrder")];
        let text = enums.iter().fold(format!("{profile:?}"), |text, (field, of)| {
            text.replace(&format!(" {field}: "), &format!(" {field}: {of}::"))
        });
        // The fields of `Tags` are private: its constructor refuses bytes that are not different.
        let tags = json!(profile.tags);
        let byte = |name: &str| tags.get(name).cloned().unwrap_or_default();
        let made = format!(
            "Tags::new({}, {}, {}, {}).expect(\"four different bytes\")",
            byte("f32"),
            byte("i16"),
            byte("u8"),
            byte("char")
        );
        let profile = text.replace(&format!("{:?}", profile.tags), &made);
        Ok(format!(
            "use laser_eb90::{{ByteOrder, Flag, Profile, Tags, Tail, Width}};\n\npub fn profile() -> Profile {{\n    {profile}\n}}"
        ))
    },
    ..OpenSettings::NOTHING
};

const HEAD: [u8; 3] = [0xEB, 0x90, 0x82];
const FLAG: u8 = 0xF0;
const MARK: u8 = 0x90;
/// The number of payloads that are examined.
const MAX_PAYLOADS: usize = 400;
/// The maximum number of types of each size: one of four bytes, one of two, two of one.
const SIZES: [(usize, usize); 3] = [(4, 1), (2, 1), (1, 2)];
/// The number of values that are suggested.
const SUGGESTED: usize = 6;

/// A tag and the size of its values.
type Sizes = Vec<(u8, usize)>;

/// Returns the tags with which most payloads can be divided into items.
fn tags(given: &Map<String, Value>, streams: &[&[u8]]) -> Vec<Value> {
    let Ok(profile) = settings::read("laser", Profile::default(), given) else { return Vec::new() };
    let payloads: Vec<Vec<u8>> =
        streams.iter().flat_map(|bytes| payloads(bytes, &profile)).take(MAX_PAYLOADS).collect();
    let mut found = Vec::new();
    search(&payloads, Vec::new(), &mut found);
    found.sort_by_key(|(whole, sizes)| (core::cmp::Reverse(*whole), sizes.len()));
    let most = found.first().map_or(0, |(whole, _)| *whole);
    let mut values = Vec::new();
    for (_, sizes) in found.iter().filter(|(whole, _)| *whole > 0 && whole * 2 >= most) {
        for value in named(sizes) {
            if !values.contains(&value) && values.len() < SUGGESTED {
                values.push(value);
            }
        }
    }
    let default = json!(Tags::default());
    if !values.contains(&default) {
        values.push(default);
    }
    values
}

/// Returns the bytes between the heads and tails of a stream, without the stuffing of 90h.
fn payloads(bytes: &[u8], profile: &Profile) -> Vec<Vec<u8>> {
    let ends: &[u8] = match profile.tail {
        Tail::Etx => &[0x83],
        Tail::Either => &[0x82, 0x83],
        _ => &[0x82],
    };
    let separate = profile.flag == laser_eb90::Flag::Separate;
    let mut found = Vec::new();
    for at in (0..bytes.len()).filter(|at| bytes.get(*at..).is_some_and(|rest| rest.starts_with(&HEAD))) {
        let rest = bytes.get(at + HEAD.len()..).unwrap_or_default();
        let rest = if separate { rest.strip_prefix(&[FLAG]) } else { Some(rest) };
        found.extend(rest.and_then(|rest| unstuffed(rest, ends)).filter(|payload| payload.len() > 1));
    }
    found
}

fn unstuffed(bytes: &[u8], ends: &[u8]) -> Option<Vec<u8>> {
    let (mut payload, mut bytes) = (Vec::new(), bytes.iter());
    while payload.len() <= laser_eb90::MAX_PAYLOAD {
        match *bytes.next()? {
            MARK => match *bytes.next()? {
                MARK => payload.push(MARK),
                end if ends.contains(&end) => return Some(payload),
                _ => return None,
            },
            byte => payload.push(byte),
        }
    }
    None
}

/// Adds tags one after the other: each time one of the two that stop most payloads.
fn search(payloads: &[Vec<u8>], sizes: Sizes, found: &mut Vec<(usize, Sizes)>) {
    let mut votes = [0_usize; 256];
    let mut whole = 0;
    for payload in payloads {
        match stop(payload, &sizes) {
            None => whole += 1,
            Some(Some(tag)) => {
                if let Some(votes) = votes.get_mut(usize::from(tag)) {
                    *votes += 1;
                }
            }
            Some(None) => {}
        }
    }
    let mut unknown: Vec<(usize, u8)> =
        votes.into_iter().zip(0..=u8::MAX).filter(|(votes, _)| *votes > 0).collect();
    unknown.sort_by_key(|(votes, _)| core::cmp::Reverse(*votes));
    for (_, tag) in unknown.into_iter().take(2) {
        for (size, most) in SIZES {
            if sizes.iter().filter(|(_, other)| *other == size).count() < most {
                let more = [sizes.as_slice(), &[(tag, size)]].concat();
                search(payloads, more, found);
            }
        }
    }
    found.push((whole, sizes));
}

/// Returns the reason for which a payload does not consist of items: an unknown tag, or `Some(None)` if it ends within an item.
fn stop(payload: &[u8], sizes: &[(u8, usize)]) -> Option<Option<u8>> {
    let mut rest = payload;
    while let Some((tag, after)) = rest.split_first() {
        let Some((_, size)) = sizes.iter().find(|(known, _)| known == tag) else { return Some(Some(*tag)) };
        let Some((count, after)) = after.split_first() else { return Some(None) };
        let Some(after) = after.get(usize::from(*count) * size..) else { return Some(None) };
        rest = after;
    }
    None
}

/// Returns the values of the setting; tags of unseen kinds are the defaults, or free bytes.
fn named(sizes: &[(u8, usize)]) -> Vec<Value> {
    let of = |size| sizes.iter().filter(move |(_, other)| *other == size).map(|(tag, _)| Some(*tag));
    let (real, short) = (of(4).next().flatten(), of(2).next().flatten());
    let ones: Vec<_> = of(1).chain([None, None]).take(2).collect();
    let (Some(first), Some(second)) = (ones.first().copied().flatten(), ones.get(1).copied()) else {
        return vec![value([real, short, None, None])];
    };
    vec![value([real, short, second, Some(first)]), value([real, short, Some(first), second])]
}

fn value(tags: [Option<u8>; 4]) -> Value {
    let mut made = [0; 4];
    let mut used: Vec<u8> = tags.iter().flatten().copied().collect();
    for ((made, tag), default) in made.iter_mut().zip(tags).zip(0xF0..=0xF3) {
        let free = || core::iter::once(default).chain(0xF4..=0xFF).find(|byte| !used.contains(byte));
        *made = tag.or_else(free).unwrap_or_default();
        used.push(*made);
    }
    let [real, short, byte, text] = made;
    json!({"f32": real, "i16": short, "u8": byte, "char": text})
}
