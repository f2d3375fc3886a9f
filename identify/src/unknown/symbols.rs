//! The symbols into which a stream is divided: bytes, or the words and numbers of a text.

use std::collections::HashMap;

use super::{enough, real};

/// The number of bytes of each part that are examined.
const SAMPLE: usize = 8 * 1024;

/// A part of a stream.
pub(super) struct Part {
    /// One number for each symbol.
    pub(super) symbols: Vec<u32>,
    /// The position at which each symbol begins among the bytes, and the end of the last one.
    places: Vec<usize>,
    /// The bytes.
    bytes: Vec<u8>,
    /// The position at which the part begins in its stream.
    begin: usize,
}

/// A stream.
pub(super) struct Symbols {
    pub(super) parts: Vec<Part>,
    pub(super) is_text: bool,
    /// The share of each symbol.
    shares: HashMap<u32, f64>,
}

impl Part {
    /// Returns the bytes of some symbols.
    pub(super) fn bytes(&self, from: usize, to: usize) -> &[u8] {
        let place = |at: usize| self.places.get(at).copied().unwrap_or(self.bytes.len());
        self.bytes.get(place(from)..place(to)).unwrap_or_default()
    }

    /// Returns the symbols that begin at these offsets of the stream.
    pub(super) fn at<'a>(&self, places: impl Iterator<Item = &'a usize>) -> Vec<usize> {
        let inside = places.filter_map(|place| place.checked_sub(self.begin));
        inside.filter_map(|place| self.places.binary_search(&place).ok()).collect()
    }
}

impl Symbols {
    pub(super) fn of(parts: &[Vec<u8>]) -> Self {
        let all: usize = parts.iter().map(Vec::len).sum();
        let of_text = |byte: &&u8| matches!(byte, b' '..=b'~' | b'\r' | b'\n' | 0xC0..);
        let is_text = enough(parts.iter().flatten().filter(of_text).count(), all);
        let mut known: HashMap<Vec<u8>, u32> = HashMap::new();
        let (mut begin, mut divided, mut counts) = (0, Vec::new(), HashMap::<u32, usize>::new());
        for part in parts {
            let bytes = part.get(..part.len().min(SAMPLE)).unwrap_or_default().to_vec();
            let (mut symbols, mut places, mut at) = (Vec::new(), Vec::new(), 0);
            while let Some(rest) = bytes.get(at..).filter(|rest| !rest.is_empty()) {
                let (length, is_number) = if is_text { token(rest) } else { (1, false) };
                // All numbers are one symbol.
                let name = if is_number { vec![] } else { rest.get(..length).unwrap_or_default().to_vec() };
                let next = u32::try_from(known.len()).unwrap_or(u32::MAX);
                let symbol = *known.entry(name).or_insert(next);
                *counts.entry(symbol).or_default() += 1;
                symbols.push(symbol);
                places.push(at);
                at += length;
            }
            places.push(bytes.len());
            divided.push(Part { symbols, places, bytes, begin });
            begin += part.len();
        }
        let all = real(counts.values().sum());
        let shares = counts.into_iter().map(|(symbol, count)| (symbol, real(count) / all)).collect();
        Self { parts: divided, is_text, shares }
    }

    /// Returns the share of a symbol.
    pub(super) fn share(&self, symbol: u32) -> f64 {
        self.shares.get(&symbol).copied().unwrap_or(1.0)
    }
}

/// Returns the length of the word, the signed number or the character at the beginning of a text; and whether it is a
/// number.
fn token(text: &[u8]) -> (usize, bool) {
    let run = |from: usize, is: fn(&u8) -> bool| text.iter().skip(from).take_while(|byte| is(byte)).count();
    // A checksum, as hexadecimal digits.
    let hex = run(0, |byte| byte.is_ascii_digit() || (b'A'..=b'F').contains(byte));
    if matches!(hex, 2 | 4 | 8)
        && !text.get(hex).is_some_and(|next| next.is_ascii_alphanumeric() || *next == b'.')
    {
        return (hex, true);
    }
    let is_letter: fn(&u8) -> bool = |byte| byte.is_ascii_alphabetic() || *byte >= 0xC0;
    let letters = run(0, is_letter);
    if letters > 0 {
        return (letters, false);
    }
    let sign = run(0, |byte| matches!(byte, b'+' | b'-')).min(1);
    let blanks = if sign > 0 { run(sign, |byte| *byte == b' ') } else { 0 };
    let digits = run(sign + blanks, u8::is_ascii_digit);
    if digits == 0 {
        return (1, false);
    }
    let whole = sign + blanks + digits;
    let decimals = if text.get(whole) == Some(&b'.') { run(whole + 1, u8::is_ascii_digit) } else { 0 };
    (if decimals > 0 { whole + 1 + decimals } else { whole }, true)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_is_words_numbers_and_characters() {
        let parts = [b"OPEN+ 00080-1.50,x*B5\r\n".to_vec(), b"12.5 7:ABy".to_vec()];
        let symbols = Symbols::of(&parts);
        let [part, next] = symbols.parts.as_slice() else { panic!() };
        let texts = |part: &Part| -> Vec<String> {
            (0..part.symbols.len()).map(|at| String::from_utf8_lossy(part.bytes(at, at + 1)).into()).collect()
        };
        assert_eq!(texts(part), ["OPEN", "+ 00080", "-1.50", ",", "x", "*", "B5", "\r", "\n"]);
        assert_eq!(texts(next), ["12.5", " ", "7", ":", "ABy"]);
        assert_eq!(part.symbols[1], part.symbols[2]);
        assert_eq!((part.at([4, 5, 17].iter()), next.at([4, 23, 25, 27].iter())), (vec![1, 4], vec![0, 1]));
    }
}
