//! Fields of messages: lengths, counters, and numbers that change slowly.

use serde::Serialize;

use super::enough;
use super::messages::same;

/// A field with the length of a message.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Length {
    /// The first byte of the field; of decimal digits, the place of the number among the numbers of the message, from 0.
    pub at: usize,
    /// The number of bytes of the field; 0 for decimal digits.
    pub width: usize,
    /// The order of its bytes: `little`, `big`, or `digits`.
    pub order: &'static str,
    /// The number of bytes that the message has beside those that the field counts.
    pub beside: i64,
}

/// A number at a fixed place.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Number {
    /// The first byte of the field.
    pub at: usize,
    /// The type of the field: `u8`, `u16`, `i16` or `f32`; `digits` in a text, whose place is the number among those of the
    /// message.
    #[serde(rename = "type")]
    pub kind: &'static str,
    /// The order of its bytes.
    pub order: &'static str,
}

impl Number {
    /// Returns the number of bytes of the field, if it is not digits.
    fn width(&self) -> usize {
        match self.kind {
            "u8" => 1,
            "f32" => 4,
            _ => 2,
        }
    }
}

/// The places at which fields are searched for.
const PLACES: usize = 24;
/// Fewer messages do not show that a number changes slowly.
const FEWEST: usize = 8;

/// Finds a field that grows with the length of its message.
pub(super) fn length(messages: &[&[u8]]) -> Option<Length> {
    let usual = most_frequent(messages.iter().map(|it| it.len()))?;
    let others = messages.iter().filter(|it| it.len() != usual).count();
    // One length alone is not evidence, nor are a few corrupt messages.
    if others < 3 || others * 10 < messages.len() {
        return None;
    }
    let field = |at: usize, width: usize, order: &'static str, read: &dyn Fn(&[u8]) -> Option<i64>| {
        let beside: Vec<i64> =
            messages.iter().filter_map(|it| Some(i64::try_from(it.len()).ok()? - read(it)?)).collect();
        let most = most_frequent(beside.iter().copied())?;
        let right = beside.iter().filter(|it| **it == most).count();
        let of_others = messages.iter().filter(|it| it.len() != usual);
        let of_others = of_others.filter(|it| {
            read(it).is_some_and(|value| i64::try_from(it.len()).is_ok_and(|len| len - value == most))
        });
        // A byte that is the same in all is right where most are of one length.
        let grows = of_others.count() * 2 > others;
        (grows && enough(right, messages.len()) && (-8..=64).contains(&most)).then_some(Length {
            at,
            width,
            order,
            beside: most,
        })
    };
    for at in 0..PLACES {
        let found = field(at, 2, "big", &|it| whole(it, at, 2, false))
            .or_else(|| field(at, 2, "little", &|it| whole(it, at, 2, true)))
            .or_else(|| field(at, 1, "big", &|it| whole(it, at, 1, false)))
            .or_else(|| field(at, 0, "digits", &|it| digits(it).nth(at)));
        if found.is_some() {
            return found;
        }
    }
    None
}

/// Numbers that are one more in nearly every message.
pub(super) fn counters(messages: &[&[u8]], end: usize, begin: usize) -> Vec<Number> {
    let shortest = messages.iter().map(|it| it.len()).min().unwrap_or_default();
    let mut found: Vec<Number> = Vec::new();
    let counts = |read: &dyn Fn(&[u8]) -> Option<i64>, modulus: i64| {
        let values: Vec<Option<i64>> = messages.iter().map(|it| read(it)).collect();
        let pairs = values.iter().zip(values.iter().skip(1));
        let ones = pairs
            .filter(|(a, b)| matches!((a, b), (Some(a), Some(b)) if (b - a).rem_euclid(modulus) == 1))
            .count();
        // Corrupt messages are missing between those that are there.
        values.len() > 4 && ones * 100 >= (values.len() - 1) * 70
    };
    for at in begin..PLACES.min(shortest.saturating_sub(end)) {
        for (width, order, kind) in [(2, "little", "u16"), (2, "big", "u16"), (1, "big", "u8")] {
            let room = at + width <= shortest.saturating_sub(end);
            let is_new = found.iter().all(|it| at >= it.at + it.width());
            if room && is_new && counts(&|it| whole(it, at, width, order == "little"), 1 << (8 * width)) {
                // The high byte of a wide one must be a part of it: a constant one other than 0 may be any field.
                let high = if order == "little" { at + 1 } else { at };
                let high = messages.iter().filter_map(|it| it.get(high));
                let (least, most) = (high.clone().min(), high.max());
                if width == 1 || least != most || most == Some(&0) {
                    found.push(Number { at, kind, order });
                }
            }
        }
    }
    for at in 0..6 {
        if counts(&|it| text(it).then(|| digits(it).nth(at)).flatten(), i64::MAX) {
            found.push(Number { at, kind: "digits", order: "big" });
        }
    }
    found
}

/// Numbers at fixed places that change slowly, of messages of the usual length.
pub(super) fn numbers(messages: &[&[u8]], begin: usize, end: usize, counters: &[Number]) -> Vec<Number> {
    let length = most_frequent(messages.iter().map(|it| it.len())).unwrap_or_default();
    let alike: Vec<&[u8]> = messages.iter().copied().filter(|it| it.len() == length).collect();
    if alike.len() < FEWEST || alike.iter().all(|it| text(it)) {
        return Vec::new();
    }
    let last = length.saturating_sub(end);
    let mut found: Vec<Number> = Vec::new();
    for at in begin..last {
        let free = |width: usize| {
            let mut known = counters.iter().filter(|it| it.kind != "digits").chain(&found);
            at + width <= last && known.all(|it| at + width <= it.at || it.at + it.width() <= at)
        };
        let real = ["little", "big"].into_iter().find(|order| free(4) && are_reals(&alike, at, order));
        let slow = || are_slow(&alike, at).filter(|_| free(2));
        let number = real.map(|order| ("f32", order)).or_else(|| slow().map(|order| ("i16", order)));
        found.extend(number.map(|(kind, order)| Number { at, kind, order }));
    }
    found
}

/// Returns the bytes between the marks that are equal in nearly all messages.
pub(super) fn constant(messages: &[&[u8]], begin: usize, end: usize) -> Vec<(usize, u8)> {
    let shortest = messages.iter().map(|it| it.len()).min().unwrap_or_default();
    let byte = |at: usize| Some((at, same(messages.iter().map(|it| it.get(at)))?));
    (begin..shortest.saturating_sub(end).min(PLACES)).filter_map(byte).collect()
}

/// Returns the most frequent value.
fn most_frequent<T: PartialEq>(values: impl Iterator<Item = T> + Clone) -> Option<T> {
    values.clone().max_by_key(|it| values.clone().filter(|other| other == it).count())
}

fn are_reals(messages: &[&[u8]], at: usize, order: &str) -> bool {
    let read = |message: &&[u8]| {
        let bytes: [u8; 4] = message.get(at..at + 4)?.try_into().ok()?;
        Some(if order == "little" { f32::from_le_bytes(bytes) } else { f32::from_be_bytes(bytes) })
    };
    let values: Vec<f32> = messages.iter().filter_map(read).collect();
    let sense = |value: &&f32| **value == 0.0 || (1e-3..1e5).contains(&value.abs());
    let different = values.iter().filter(|value| Some(*value) != values.first()).count();
    enough(values.iter().filter(sense).count(), values.len()) && different * 2 > values.len()
}

/// Returns the byte order in which two bytes are a number that changes by little, and by much less than in the other order.
fn are_slow(messages: &[&[u8]], at: usize) -> Option<&'static str> {
    let steps = |little: bool| {
        let read = |message: &&[u8]| {
            let bytes = message.get(at..at + 2)?.try_into().ok()?;
            Some(if little { i16::from_le_bytes(bytes) } else { i16::from_be_bytes(bytes) })
        };
        let values: Vec<i16> = messages.iter().filter_map(read).collect();
        let pairs = values.iter().zip(values.iter().skip(1));
        let mut steps: Vec<i64> = pairs.map(|(a, b)| (i64::from(*a) - i64::from(*b)).abs()).collect();
        steps.sort_unstable();
        let moves = steps.iter().filter(|step| **step > 0).count() * 2 > steps.len();
        steps.get(steps.len() / 2).copied().filter(|_| moves)
    };
    let (little, big) = (steps(true)?, steps(false)?);
    [("little", little, big), ("big", big, little)]
        .into_iter()
        .find(|(_, step, other)| *step < 1024 && step * 8 < *other)
        .map(|(order, ..)| order)
}

fn whole(message: &[u8], at: usize, width: usize, little: bool) -> Option<i64> {
    let bytes = message.get(at..at + width)?;
    let join = |value: i64, byte: &u8| value << 8 | i64::from(*byte);
    Some(if little { bytes.iter().rev().fold(0, join) } else { bytes.iter().fold(0, join) })
}

fn text(message: &[u8]) -> bool {
    message.iter().filter(|byte| byte.is_ascii_graphic() || byte.is_ascii_whitespace()).count() * 10
        >= message.len() * 9
}

/// Returns the numbers of a text.
fn digits(message: &[u8]) -> impl Iterator<Item = i64> {
    message
        .split(|byte| !byte.is_ascii_digit())
        .filter(|run| !run.is_empty() && run.len() < 10)
        .map(|run| run.iter().fold(0, |value, digit| value * 10 + i64::from(digit - b'0')))
}
