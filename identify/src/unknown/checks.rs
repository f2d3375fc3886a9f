//! Finds the bytes of a message that are a check of other bytes.

use serde::Serialize;

use super::crc::ALL;
use super::enough;

#[cfg(test)]
mod tests;

/// Bytes that check others.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Check {
    /// The kind: `sum`, `negated sum`, `xor`, or a CRC by its name in the catalogue.
    pub kind: String,
    /// The number of bytes of the check; of hex digits, the number of digits.
    pub width: usize,
    /// The order of the check's bytes: `little`, `big`, or `hex` digits.
    pub order: &'static str,
    /// The number of bytes between the check and the end of the message.
    pub from_end: usize,
    /// The index of the first checked byte.
    pub first: usize,
    /// The number of bytes between the last checked byte and the check.
    pub before: usize,
    /// The constant that is added to the sum, or combined with the XOR, beside the bytes.
    pub constant: u32,
    /// The bytes that are doubled count once.
    pub once: bool,
}

/// The places at which a check is searched for.
const FROM_END: usize = 3;
const FIRST: usize = 8;
const BEFORE: usize = 3;
/// The number of messages that try a guess before all do.
const TRIAL_MESSAGES: usize = 6;

/// A sum or a CRC.
#[derive(Clone, Copy)]
enum Kind {
    Sum,
    Negated,
    Xor,
    Crc(&'static super::crc::Crc),
}

/// Finds the check of messages that end with a mark of this length.
pub(super) fn find(messages: &[&[u8]], end: usize, doubled: Option<u8>) -> Option<Check> {
    let mut different: Vec<&[u8]> = Vec::new();
    for message in messages {
        if !different.contains(message) {
            different.push(message);
        }
    }
    if different.len() < 4 {
        return None;
    }
    let sums = [Kind::Sum, Kind::Negated, Kind::Xor];
    let kinds: Vec<Kind> = sums.into_iter().chain(ALL.iter().map(Kind::Crc)).collect();
    let ends: Vec<usize> =
        core::iter::once(end).chain((0..=FROM_END).filter(|other| *other != end)).collect();
    let once: &[bool] = if doubled.is_some() { &[true, false] } else { &[false] };
    let mut with_constant = None;
    for from_end in ends {
        for (width, order) in [
            (4, "hex"),
            (2, "hex"),
            (4, "little"),
            (4, "big"),
            (3, "big"),
            (3, "little"),
            (2, "little"),
            (2, "big"),
            (1, "little"),
        ] {
            let values: Vec<Option<u32>> =
                different.iter().map(|it| value(it, from_end, width, order)).collect();
            if !is_check(&values) {
                continue;
            }
            for before in 0..=BEFORE {
                for first in 0..=FIRST {
                    for once in once {
                        let bodies: Vec<Vec<u8>> = different
                            .iter()
                            .map(|it| body(it, first, from_end + width + before, doubled.filter(|_| *once)))
                            .collect();
                        if bodies.iter().filter(|body| body.is_empty()).count() * 2 > bodies.len() {
                            continue;
                        }
                        for kind in &kinds {
                            if let Some((kind, constant)) = agrees(*kind, &bodies, &values, width, order) {
                                let found = Check {
                                    kind,
                                    width,
                                    order,
                                    from_end,
                                    first,
                                    before,
                                    constant,
                                    once: *once,
                                };
                                // A constant may be bytes that were left out, or that do not belong to it.
                                if constant == 0 {
                                    return Some(found);
                                }
                                with_constant.get_or_insert(found);
                            }
                        }
                    }
                }
            }
        }
    }
    with_constant
}

/// Returns the value of the check's bytes.
fn value(message: &[u8], from_end: usize, width: usize, order: &str) -> Option<u32> {
    let end = message.len().checked_sub(from_end)?;
    let bytes = message.get(end.checked_sub(width)?..end)?;
    let join = |value, byte: &u8| value * 256 + u32::from(*byte);
    match order {
        "hex" => {
            u32::from_str_radix(core::str::from_utf8(bytes).ok().filter(|text| !text.starts_with('+'))?, 16)
                .ok()
        }
        "big" => Some(bytes.iter().fold(0, join)),
        _ => Some(bytes.iter().rev().fold(0, join)),
    }
}

/// Returns whether values can be checks: a check has several values.
fn is_check(values: &[Option<u32>]) -> bool {
    let mut known: Vec<u32> = values.iter().flatten().copied().collect();
    known.sort_unstable();
    known.dedup();
    known.len() >= 3
}

/// Returns the checked bytes.
fn body(message: &[u8], first: usize, behind: usize, once: Option<u8>) -> Vec<u8> {
    let end = message.len().saturating_sub(behind);
    let mut bytes = message.get(first..end).unwrap_or_default().iter();
    let mut found = Vec::with_capacity(end);
    while let Some(byte) = bytes.next() {
        found.push(*byte);
        if once == Some(*byte) {
            bytes.next();
        }
    }
    found
}

/// Returns whether nearly all values are those of their bodies, except for a constant.
fn agrees(
    kind: Kind,
    bodies: &[Vec<u8>],
    values: &[Option<u32>],
    width: usize,
    order: &str,
) -> Option<(String, u32)> {
    let bits = 8 * if order == "hex" { width / 2 } else { width };
    let mask = u32::MAX >> (32 - bits);
    let of = |body: &Vec<u8>| -> Option<u32> {
        let sum = || body.iter().fold(0_u32, |sum, byte| sum.wrapping_add(u32::from(*byte)));
        Some(match kind {
            Kind::Sum => sum(),
            Kind::Negated => sum().wrapping_neg(),
            Kind::Xor if bits == 8 => u32::from(body.iter().fold(0, |xor, byte| xor ^ byte)),
            Kind::Crc(crc) if usize::from(crc.bits) == bits => crc.of_bytes(body),
            Kind::Xor | Kind::Crc(_) => return None,
        })
    };
    let difference = |body: &Vec<u8>, value: u32| {
        let of = of(body)?;
        Some(match kind {
            Kind::Sum | Kind::Negated => value.wrapping_sub(of) & mask,
            Kind::Xor => value ^ of,
            // For messages of different lengths a CRC has no constant.
            Kind::Crc(_) => u32::from(value != of),
        })
    };
    let pairs = bodies.iter().zip(values).filter_map(|(body, value)| Some((body, (*value)?)));
    let few: Vec<u32> =
        pairs.clone().take(TRIAL_MESSAGES).filter_map(|(body, value)| difference(body, value)).collect();
    let constant = few.iter().copied().max_by_key(|it| few.iter().filter(|other| *other == it).count())?;
    if few.iter().filter(|it| **it == constant).count() * 2 < few.len()
        || matches!(kind, Kind::Crc(_)) && constant != 0
    {
        return None;
    }
    let right = pairs.filter(|(body, value)| difference(body, *value) == Some(constant)).count();
    if !enough(right, bodies.len()) {
        return None;
    }
    let name = match kind {
        Kind::Sum => "sum".into(),
        Kind::Negated => "negated sum".into(),
        Kind::Xor => "xor".into(),
        Kind::Crc(crc) => crc.name.replacen('_', "-", 1).replacen('_', "/", 1).replace('_', "-"),
    };
    Some((name, constant))
}
