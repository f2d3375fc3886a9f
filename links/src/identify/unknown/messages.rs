//! Where messages begin and end: the marks that divide a stream so that what is at the same place is the most alike.

use std::collections::HashMap;

use super::enough;

/// So many bytes of a stream are looked at.
const SAMPLE: usize = 8 * 1024;
/// The longest mark that is searched for; what is constant beside it is found then.
const MARK: usize = 4;
/// So many marks of each length are tried.
const TRIED: usize = 8;
/// Fewer messages show nothing.
const FEWEST: usize = 5;
/// The places at the beginning and at the end of messages that are compared.
const PLACES: [usize; 2] = [16, 8];
/// Divisions that are as good but for this are shifted against each other.
const NEARLY: f64 = 0.9;

/// A stream, divided.
pub(super) struct Divided {
    pub(super) messages: Vec<Vec<u8>>,
    pub(super) begin: Vec<u8>,
    pub(super) end: Vec<u8>,
}

/// Divides what one end sent into messages; those that are cut off at an end are left out.
pub(super) fn divide(parts: &[Vec<u8>]) -> Option<Divided> {
    let shares = shares(parts);
    let mut found: Vec<(f64, Vec<Vec<u8>>)> = Vec::new();
    for mark in marks(parts) {
        let messages = split(parts, &mark);
        if messages.len() >= FEWEST {
            found.push((alike(&messages, &shares), messages));
        }
    }
    let most = found.iter().map(|(score, _)| *score).fold(0.0, f64::max);
    found.retain(|(score, _)| *score > 0.0 && *score >= most * NEARLY);
    // Of divisions that are shifted against each other, the one with the longest mark at the beginning, or that begins with the capture.
    let first = |messages: &[Vec<u8>]| {
        parts.first().zip(messages.first()).is_some_and(|(part, it)| part.starts_with(it))
    };
    let (_, messages) = found.into_iter().max_by_key(|(_, messages)| {
        (constant(messages, |message, at| message.get(at)).len(), first(messages))
    })?;
    let messages = if is_text(&messages) { ends_of_text(messages) } else { messages };
    let begin = constant(&messages, |message, at| message.get(at));
    let mut end = constant(&messages, |message, at| message.iter().rev().nth(at));
    end.reverse();
    // A message of constant bytes alone has no end mark of its own.
    let shortest = messages.iter().map(Vec::len).min()?;
    end.drain(..end.len().saturating_sub(shortest.saturating_sub(begin.len())).min(end.len()));
    Some(Divided { messages, begin, end })
}

/// The share of each byte.
fn shares(parts: &[Vec<u8>]) -> [f64; 256] {
    let mut counts = [0_usize; 256];
    for byte in parts.iter().flatten() {
        if let Some(count) = counts.get_mut(usize::from(*byte)) {
            *count += 1;
        }
    }
    let all = real(counts.iter().sum());
    counts.map(|count| real(count) / all)
}

fn is_text(messages: &[Vec<u8>]) -> bool {
    let all = messages.iter().map(Vec::len).sum();
    let graphic = messages.iter().flatten().filter(|byte| byte.is_ascii_graphic() || **byte == b' ').count();
    enough(graphic, all)
}

/// The most frequent strings of a few bytes.
fn marks(parts: &[Vec<u8>]) -> Vec<Vec<u8>> {
    let mut found = Vec::new();
    for length in 1..=MARK {
        let mut counts: HashMap<&[u8], usize> = HashMap::new();
        for part in parts {
            for window in part.get(..part.len().min(SAMPLE)).unwrap_or_default().windows(length) {
                *counts.entry(window).or_default() += 1;
            }
        }
        let mut counts: Vec<(usize, &[u8])> = counts
            .into_iter()
            .filter(|(_, count)| *count >= FEWEST)
            .map(|(mark, count)| (count, mark))
            .collect();
        counts.sort_by_key(|(count, mark)| (core::cmp::Reverse(*count), *mark));
        // Those that are in every message are beside one another.
        found.extend(counts.into_iter().take(TRIED * length).map(|(_, mark)| mark.to_vec()));
    }
    found
}

/// What begins with a mark, up to the next one.
fn split(parts: &[Vec<u8>], mark: &[u8]) -> Vec<Vec<u8>> {
    let mut messages = Vec::new();
    for part in parts {
        let part = part.get(..part.len().min(SAMPLE)).unwrap_or_default();
        let mut begin = None;
        let mut at = 0;
        while let Some(rest) = part.get(at..) {
            let Some(next) = rest.windows(mark.len()).position(|window| window == mark).map(|next| at + next)
            else {
                break;
            };
            if let Some(message) = begin.and_then(|begin| part.get(begin..next)) {
                messages.push(message.to_vec());
            }
            begin = Some(next);
            at = next + mark.len();
        }
    }
    messages
}

/// The bits by which what is at the same place of all messages differs from the bytes of the capture.
fn alike(messages: &[Vec<u8>], shares: &[f64; 256]) -> f64 {
    let shortest = messages.iter().map(Vec::len).min().unwrap_or_default();
    let [first, last] = PLACES;
    let last = last.min(shortest / 2);
    let first = first.min(shortest - last);
    let begin = (0..first).map(|at| known(messages.iter().filter_map(|it| it.get(at)), shares));
    let end = (0..last).map(|at| known(messages.iter().filter_map(|it| it.iter().rev().nth(at)), shares));
    real(messages.len()) * begin.chain(end).sum::<f64>()
}

/// The bits that a place tells of its byte; less what a few messages tell by chance.
fn known<'a>(bytes: impl Iterator<Item = &'a u8>, shares: &[f64; 256]) -> f64 {
    let mut counts = [0_usize; 256];
    let mut all = 0;
    for byte in bytes {
        if let Some(count) = counts.get_mut(usize::from(*byte)) {
            *count += 1;
        }
        all += 1;
    }
    let different = counts.iter().filter(|count| **count > 0).count();
    let of = |(count, share): (&usize, &f64)| {
        let here = real(*count) / real(all);
        if *count > 0 { here * (here / share).log2() } else { 0.0 }
    };
    let bits: f64 = counts.iter().zip(shares).map(of).sum();
    (bits - real(different.saturating_sub(1)) / real(all)).max(0.0)
}

/// The end of a line belongs to the line before, and so does a bracket that closes.
fn ends_of_text(messages: Vec<Vec<u8>>) -> Vec<Vec<u8>> {
    let begin = constant(&messages, |message, at| message.get(at));
    let closing = begin.iter().rposition(|byte| b"\r\n>)]};\x03\0".contains(byte)).map_or(0, |at| at + 1);
    let Some(first) = begin.get(..closing) else { return messages };
    let moved = messages.iter().map(|message| [message.get(closing..).unwrap_or_default(), first].concat());
    moved.collect()
}

/// The bytes that nearly all messages have at the same places, one after the other.
fn constant(messages: &[Vec<u8>], byte: impl Fn(&Vec<u8>, usize) -> Option<&u8>) -> Vec<u8> {
    let mut found = Vec::new();
    loop {
        let Some(usual) = usual(messages.iter().filter_map(|message| byte(message, found.len()))) else {
            return found;
        };
        let same = messages.iter().filter(|message| byte(message, found.len()) == Some(&usual)).count();
        if !enough(same, messages.len()) {
            return found;
        }
        found.push(usual);
    }
}

/// The byte that is there most often.
pub(super) fn usual<'a>(bytes: impl Iterator<Item = &'a u8>) -> Option<u8> {
    let mut counts = [0_usize; 256];
    bytes.for_each(|byte| {
        if let Some(count) = counts.get_mut(usize::from(*byte)) {
            *count += 1;
        }
    });
    let (count, byte) = counts.into_iter().zip(0..=u8::MAX).max_by_key(|(count, _)| *count)?;
    (count > 0).then_some(byte)
}

/// A byte that comes in pairs only between the marks: that of a mark, which is doubled where it is no mark.
pub(super) fn doubled(messages: &[&[u8]], begin: usize, end: &[u8]) -> Option<u8> {
    let mut pairs = [0_usize; 256];
    let mut singles = [0_usize; 256];
    for message in messages {
        let body = message.get(begin..message.len().saturating_sub(end.len())).unwrap_or_default();
        let mut rest = body;
        while let Some((byte, after)) = rest.split_first() {
            let run = 1 + after.iter().take_while(|next| *next == byte).count();
            let counts = if run.is_multiple_of(2) { &mut pairs } else { &mut singles };
            if let Some(count) = counts.get_mut(usize::from(*byte)) {
                *count += 1;
            }
            rest = rest.get(run..).unwrap_or_default();
        }
    }
    // In a mark before the check it stands alone, once in each message.
    let is_doubled = |(pairs, singles): (usize, usize)| {
        pairs >= 2
            && singles <= messages.len() + messages.len() / 5
            && pairs * 2 > singles.saturating_sub(messages.len())
    };
    let in_mark =
        |byte: u8| messages.iter().filter(|it| it.iter().take(3).any(|other| *other == byte)).count();
    let found = pairs.into_iter().zip(singles).zip(0..=u8::MAX).filter(|(counts, _)| is_doubled(*counts));
    found.map(|(_, byte)| byte).find(|byte| enough(in_mark(*byte), messages.len()))
}

fn real(count: usize) -> f64 {
    u32::try_from(count).map_or(f64::MAX, f64::from)
}
