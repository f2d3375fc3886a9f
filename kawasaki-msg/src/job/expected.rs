//! What the next job is expected to be, but for its own fields.
//!
//! What is known beforehand is compared and not parsed: the name, the header, the order, the next number, and the constants of the
//! dialect. A job whose message is not exactly so (blanks in the length, another number) is left to the general way, which
//! finds the message and checks its other values by themselves, and reads its fields as they are read here.

use super::reader::{BUFFER, Reader, Swar, Window, chunk, word};
use super::{Job, Work};
use crate::dialect::{Dialect, Entry};
use crate::number::Digits;
use crate::role::{Field, Role};
use crate::value::{Charset, DATA, END, SEPARATOR, START};

/// How the messages of an order's jobs begin and end, from the next one on.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Expected {
    charset: Charset,
    swar: Swar,
    /// `<name$header$`
    prefix: Text,
    /// What is between the first `#` and the number, and from the number to the mark before the job's own fields.
    before: Text,
    after: Text,
    /// `before`, number, `after`
    lead: Text,
    /// From the mark after the job's own fields to the end.
    tail: Text,
    order: u16,
    number: u16,
    max: u16,
    /// One more in the last digit of the number.
    one: [u64; Text::WORDS],
    /// The number after which the last digit is carried, or 1 follows.
    stop: u16,
}

impl Expected {
    /// The job of this number; 1 follows `max`. `None` where the dialect has more than 32 bytes before the length or
    /// around a job's own fields, or something there that is not known.
    pub(crate) fn new(dialect: &Dialect<'_>, order: u16, number: u16, max: u16) -> Option<Self> {
        let entry = dialect.entry(Role::Job)?;
        let charset = dialect.charset();
        let mut begin = Known { charset, order, text: Text::EMPTY };
        begin.push(START)?;
        begin.text(entry.name)?;
        begin.push(SEPARATOR)?;
        for field in entry.header {
            begin.field(field)?;
            begin.push(SEPARATOR)?;
        }
        let (before, after, tail) = Self::around(entry, charset, order)?;
        let mut expected = Self {
            charset,
            swar: Swar::CONSTANTS,
            prefix: begin.text,
            before,
            after,
            lead: before,
            tail,
            order,
            number,
            max,
            one: [0; Text::WORDS],
            stop: 0,
        };
        let longest = before.length + Digits::new(i32::from(max)).count() + after.length;
        expected.set(number);
        (longest <= Text::MAX).then_some(expected)
    }

    /// What is before the number, between it and the job's own fields, and after them.
    fn around(entry: &Entry<'_>, charset: Charset, order: u16) -> Option<(Text, Text, Text)> {
        let known = || Known { charset, order, text: Text::EMPTY };
        let (mut before, mut after, mut tail) = (known(), known(), known());
        let mut part = &mut before;
        for (place, field) in entry.fields.iter().enumerate() {
            if place > 0 {
                part.push(SEPARATOR)?;
            }
            match field {
                Field::Number => part = &mut after,
                Field::Work => part = &mut tail,
                field => part.field(field)?,
            }
        }
        tail.push(DATA)?;
        tail.push(END)?;
        let place = |wanted| entry.fields.iter().position(|field| *field == wanted);
        (place(Field::Number)? < place(Field::Work)?).then_some((before.text, after.text, tail.text))
    }

    /// The job that begins at a place, and the place after it. No byte from `end` on is part of it.
    #[inline(always)]
    pub(crate) fn read<W: Work>(
        &self,
        buffer: &[u8; BUFFER],
        at: usize,
        end: usize,
        ranges: &W::Ranges,
    ) -> Option<(Job<W>, usize)> {
        let window: &Window = buffer.get(at..)?.first_chunk()?;
        let length_at = self.prefix.skip(window, 0)?;
        let length = u32::from_le_bytes(*chunk(window, length_at)?);
        let data_at = match length.to_le_bytes() {
            [_, _, DATA, _] => length_at + 3,
            [_, _, _, DATA] => length_at + 4,
            [_, DATA, _, _] => length_at + 2,
            _ => return None,
        };
        let work_at = self.lead.skip(window, data_at)? - 1;
        let (work, tail_at) = Reader::read::<W>(window, work_at, (self.charset, &self.swar), ranges)?;
        let after = self.tail.skip(window, tail_at)?;
        let is_whole = at + after <= end && length_is(length, data_at - length_at - 1, after - data_at - 2)?;
        is_whole.then_some((Job { order: self.order, number: self.number, work }, at + after))
    }

    /// Goes on to the next number.
    #[inline(always)]
    pub(crate) fn advance(&mut self) {
        if self.number == self.stop {
            self.set(if self.number >= self.max { 1 } else { self.number + 1 });
        } else {
            self.number += 1;
            self.lead.words.iter_mut().zip(self.one).for_each(|(word, one)| *word += one);
        }
    }

    #[cold]
    fn set(&mut self, number: u16) {
        (self.number, self.lead) = (number, self.before);
        for byte in Digits::new(i32::from(number)) {
            self.lead.append(byte);
        }
        let last = self.lead.length.saturating_sub(1);
        self.one = [0; Text::WORDS];
        if let Some(word) = self.one.get_mut(last / 8) {
            *word = 1 << (8 * (last % 8));
        }
        self.after.bytes().for_each(|byte| self.lead.append(byte));
        self.stop = (number - number % 10 + 9).min(self.max);
    }

    #[cfg(test)]
    pub(crate) const fn number(&self) -> u16 {
        self.number
    }
}

/// Whether the first digits of four bytes, so many of them, are this length as we write it; `None` for a length of four digits.
#[inline(always)]
fn length_is(text: u32, digits: usize, length: usize) -> Option<bool> {
    let two = |length: usize| LENGTHS.get(length % 128).copied().unwrap_or_default();
    Some(match digits {
        2 => (10..100).contains(&length) && text & 0xFFFF == two(length),
        3 => {
            let (hundreds, rest) = (length / 100, length % 100);
            (1..10).contains(&hundreds)
                && (text & 0xFF) as usize == usize::from(b'0') + hundreds
                && (text >> 8) & 0xFFFF == two(rest)
        }
        1 => length < 10 && (text & 0xFF) as usize == usize::from(b'0') + length,
        _ => return None,
    })
}

/// Every number below 100 as two digits of the wire.
const LENGTHS: [u32; 128] = {
    let mut table = [0; 128];
    let mut rest: &mut [u32] = &mut table;
    let (mut tens, mut ones) = (b'0', b'0');
    while let ([first, others @ ..], b'0'..=b'9') = (rest, tens) {
        *first = u32::from_le_bytes([tens, ones, 0, 0]);
        rest = others;
        (tens, ones) = if ones == b'9' { (tens + 1, b'0') } else { (tens, ones + 1) };
    }
    table
};

/// A text that is being put together from what is known of a message.
struct Known {
    charset: Charset,
    order: u16,
    text: Text,
}

impl Known {
    fn push(&mut self, byte: u8) -> Option<()> {
        (self.text.length < Text::MAX).then(|| self.text.append(byte))
    }

    fn text(&mut self, text: &str) -> Option<()> {
        text.chars().try_for_each(|c| self.push(self.charset.byte(c).ok()?))
    }

    fn field(&mut self, field: &Field<'_>) -> Option<()> {
        match field {
            Field::Order => Digits::new(i32::from(self.order)).try_for_each(|byte| self.push(byte)),
            Field::Constant(text) => self.text(text),
            // What it holds is not known.
            _ => None,
        }
    }
}

/// Up to 32 bytes that are compared eight at a time.
#[derive(Debug, Clone, Copy)]
struct Text {
    words: [u64; Self::WORDS],
    masks: [u64; Self::WORDS],
    length: usize,
}

impl Text {
    const WORDS: usize = 4;
    const MAX: usize = 8 * Self::WORDS;
    const EMPTY: Self = Self { words: [0; Self::WORDS], masks: [0; Self::WORDS], length: 0 };

    /// Nothing where it is full.
    fn append(&mut self, byte: u8) {
        let (place, shift) = (self.length / 8, 8 * (self.length % 8));
        if let (Some(word), Some(mask)) = (self.words.get_mut(place), self.masks.get_mut(place)) {
            *word |= u64::from(byte) << shift;
            *mask |= 0xFF << shift;
            self.length += 1;
        }
    }

    fn bytes(&self) -> impl Iterator<Item = u8> {
        self.words.into_iter().flat_map(u64::to_le_bytes).take(self.length)
    }

    /// The place after this text, if it is here.
    #[inline(always)]
    fn skip(&self, window: &Window, at: usize) -> Option<usize> {
        let [first, ..] = self.words;
        let [mask, ..] = self.masks;
        let same = word(window, at)? & mask == first && (self.length <= 8 || self.rest_is_at(window, at));
        // The remainder is the length itself: it only shows its bound.
        same.then_some(at + self.length % 64)
    }

    #[inline(never)]
    fn rest_is_at(&self, window: &Window, at: usize) -> bool {
        let words = self.words.iter().zip(&self.masks).enumerate().skip(1);
        let mut words = words.take_while(|(place, _)| 8 * place < self.length);
        words.all(|(place, (expected, mask))| {
            word(window, at + 8 * place).is_some_and(|found| found & mask == *expected)
        })
    }
}
