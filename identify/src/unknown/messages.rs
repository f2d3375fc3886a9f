//! The marks of messages: their common beginnings and ends, and the byte that is doubled inside of them.

use super::enough;

/// Returns the first bytes that messages have in common, and the last ones.
pub(super) fn marks(messages: &[&[u8]]) -> (Vec<u8>, Vec<u8>) {
    let begin = constant(messages, |message, at| message.get(at));
    let mut end = constant(messages, |message, at| message.iter().rev().nth(at));
    end.reverse();
    // A message of constant bytes alone has no end mark of its own.
    let shortest = messages.iter().map(|it| it.len()).min().unwrap_or_default();
    end.drain(..end.len().saturating_sub(shortest.saturating_sub(begin.len())).min(end.len()));
    (begin, end)
}

/// Returns the bytes that nearly all messages have at the same offsets, one after the other.
fn constant(messages: &[&[u8]], byte: impl Fn(&[u8], usize) -> Option<&u8>) -> Vec<u8> {
    (0..).map_while(|at| same(messages.iter().map(|message| byte(message, at)))).collect()
}

/// Returns the value that nearly all of these bytes have, one of each message.
pub(super) fn same<'a>(bytes: impl ExactSizeIterator<Item = Option<&'a u8>>) -> Option<u8> {
    let all = bytes.len();
    let mut counts = [0_usize; 256];
    for byte in bytes.flatten() {
        if let Some(count) = counts.get_mut(usize::from(*byte)) {
            *count += 1;
        }
    }
    let (count, byte) = counts.into_iter().zip(0..=u8::MAX).max_by_key(|(count, _)| *count)?;
    enough(count, all).then_some(byte)
}

/// Returns a byte that comes only in pairs between the marks: the byte of a mark, which is doubled elsewhere.
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
