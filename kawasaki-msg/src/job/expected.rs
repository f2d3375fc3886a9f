//! What the next job is expected to be, but for its own fields.
//!
//! What is known beforehand is compared and not parsed: the name, the header, the order, the next number, and the constants of the
//! dialect. A job whose message is not exactly so (blanks in the length, another number) is left to the general way, which
//! finds the message and checks its other values by themselves, and reads its fields as they are read here.

use super::reader::{Reader, Swar, chunk, word};
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
    before: Bytes,
    after: Bytes,
    /// `before`, number, `after`
    lead: Text,
    /// From the mark after the job's own fields to the end.
    tail: Text,
    order: u16,
    number: u16,
    max: u16,
    /// Where the last digit of the number is in `lead`: its word, and 1 in it.
    last_word: usize,
    one: u64,
    /// The number after which the last digit is carried, or 1 follows.
    stop: u16,
    /// A text has more than one word.
    is_long: bool,
}

impl Expected {
    /// The job of this number; 1 follows `max`. `None` where the dialect has more than 32 bytes before the length or
    /// around a job's own fields, or something there that is not known.
    pub(crate) fn new(dialect: &Dialect<'_>, order: u16, number: u16, max: u16) -> Option<Self> {
        let entry = dialect.entry(Role::Job)?;
        let charset = dialect.charset();
        let mut prefix = Known { charset, order, bytes: Bytes::EMPTY };
        prefix.push(START)?;
        prefix.text(entry.name)?;
        prefix.push(SEPARATOR)?;
        for field in entry.header {
            prefix.field(field)?;
            prefix.push(SEPARATOR)?;
        }
        let (before, after, tail) = Self::around(entry, charset, order)?;
        let longest = before.length + Digits::new(i32::from(max)).count() + after.length;
        let mut expected = Self {
            charset,
            swar: Swar::new(charset),
            prefix: prefix.bytes.compared(),
            lead: before.compared(),
            before,
            after,
            tail: tail.compared(),
            order,
            number,
            max,
            last_word: 0,
            one: 0,
            stop: 0,
            is_long: prefix.bytes.length.max(longest).max(tail.length) > 8,
        };
        expected.set(number);
        (longest <= Bytes::MAX).then_some(expected)
    }

    /// What is before the number, between it and the job's own fields, and after them.
    fn around(entry: &Entry<'_>, charset: Charset, order: u16) -> Option<(Bytes, Bytes, Bytes)> {
        let known = || Known { charset, order, bytes: Bytes::EMPTY };
        let (mut before, mut after, mut tail) = (known(), known(), known());
        let (mut part, mut number, mut work) = (&mut before, false, false);
        for (place, field) in entry.fields.iter().enumerate() {
            if place > 0 {
                part.push(SEPARATOR)?;
            }
            match field {
                Field::Number if !work => (part, number) = (&mut after, true),
                Field::Work if number => (part, work) = (&mut tail, true),
                field => part.field(field)?,
            }
        }
        tail.push(DATA)?;
        tail.push(END)?;
        work.then_some((before.bytes, after.bytes, tail.bytes))
    }

    /// Gives the jobs that these bytes begin with to `take`, as long as each is the expected one, until it refuses one, and says how
    /// many bytes they are. A job is not read where fewer bytes than a window are left.
    #[inline(always)]
    pub(crate) fn read<W: Work, const WINDOW: usize>(
        &mut self,
        bytes: &[u8],
        ranges: &W::Ranges,
        mut take: impl FnMut(&Job<W>) -> bool,
    ) -> usize {
        let Some(last) = bytes.len().checked_sub(WINDOW) else { return 0 };
        let swar = self.swar;
        let mut at = 0;
        // One check of each place.
        while at <= last {
            let Some(window) = bytes.get(at..).and_then(<[u8]>::first_chunk::<WINDOW>) else { break };
            let mut job = Job { order: 0, number: 0, work: W::default() };
            let Some(used) = self.read_one(&swar, window, ranges, &mut job) else { break };
            if !take(&job) {
                break;
            }
            at += used;
            self.advance();
        }
        at
    }

    /// Reads the job that a window begins with, and gives the place after it.
    #[inline(always)]
    fn read_one<W: Work, const WINDOW: usize>(
        &self,
        swar: &Swar,
        window: &[u8; WINDOW],
        ranges: &W::Ranges,
        job: &mut Job<W>,
    ) -> Option<usize> {
        let length_at = self.prefix.skip(window, 0)?;
        let (digits, mask) = match chunk(window, length_at)? {
            [_, _, DATA, _] => (2, 0x00FF_FFFF),
            [_, DATA, ..] => (1, 0xFFFF),
            [_, _, _, DATA] => (3, u32::MAX),
            _ => return None,
        };
        let data_at = length_at + digits + 1;
        let work_at = self.lead.skip(window, data_at)? - 1;
        let tail_at = Reader::read(window, work_at, self.charset, swar, ranges, &mut job.work)?;
        let after = self.tail.skip(window, tail_at)?;
        (job.order, job.number) = (self.order, self.number);
        let text = u32::from_le_bytes(*chunk(window, length_at)?) & mask;
        let is_expected =
            length_is(text, after - data_at - 2) && !(self.is_long && self.differs(window, data_at, tail_at));
        is_expected.then_some(after)
    }

    /// Whether what is after the first word of each text is another.
    #[inline(never)]
    fn differs<const WINDOW: usize>(&self, window: &[u8; WINDOW], data_at: usize, tail_at: usize) -> bool {
        let parts = [(&self.prefix, 0), (&self.lead, data_at), (&self.tail, tail_at)];
        !parts.into_iter().all(|(text, at)| text.rest_is_at(window, at))
    }

    /// Goes on to the next number.
    #[inline(always)]
    fn advance(&mut self) {
        if self.number == self.stop {
            self.carry();
        } else {
            self.number += 1;
            if let Some(word) = self.lead.words.get_mut(self.last_word % Text::WORDS) {
                *word += self.one;
            }
        }
    }

    /// Goes on to a number that differs in more than its last digit.
    #[inline(never)]
    fn carry(&mut self) {
        let word = self.lead.words.get_mut(self.last_word % Text::WORDS);
        match (self.number / 10 % 10, word) {
            (1..=8, Some(word)) if self.one > 0xFF && self.number < self.max => {
                // From 9 to 0, and one more in the digit before it.
                *word = word.wrapping_sub(9 * self.one).wrapping_add(self.one >> 8);
                self.number += 1;
                self.stop = self.last_of_ten(self.number);
            }
            _ => self.set(if self.number >= self.max { 1 } else { self.number + 1 }),
        }
    }

    #[cold]
    fn set(&mut self, number: u16) {
        let mut lead = self.before;
        Digits::new(i32::from(number)).for_each(|byte| lead.append(byte));
        let last = lead.length.saturating_sub(1);
        self.after.as_slice().iter().for_each(|byte| lead.append(*byte));
        (self.number, self.lead) = (number, lead.compared());
        (self.last_word, self.one) = (last / 8, 1 << (8 * (last % 8)));
        self.stop = self.last_of_ten(number);
    }

    fn last_of_ten(&self, number: u16) -> u16 {
        (number - number % 10 + 9).min(self.max)
    }

    #[cfg(test)]
    pub(crate) const fn number(&self) -> u16 {
        self.number
    }
}

/// Whether a length and the mark after it are this one, as we write it.
#[inline(always)]
fn length_is(text: u32, length: usize) -> bool {
    match TWO_DIGITS.get(length) {
        Some(expected) => text == *expected,
        None => long_length_is(text, length),
    }
}

#[cold]
#[inline(never)]
fn long_length_is(text: u32, length: usize) -> bool {
    let [hundreds, tens, ones, _] = text.to_le_bytes();
    i32::try_from(length).is_ok_and(|length| Digits::new(length).as_bytes() == [hundreds, tens, ones])
}

/// The lengths of most jobs as they are on the wire, with the mark after them.
const TWO_DIGITS: [u32; 100] = {
    let mut table = [0; 100];
    let mut rest: &mut [u32] = &mut table;
    let (mut tens, mut ones) = (b'0', b'0');
    while let [first, others @ ..] = rest {
        let bytes = match tens {
            b'0' => [ones, DATA, 0, 0],
            _ => [tens, ones, DATA, 0],
        };
        *first = u32::from_le_bytes(bytes);
        rest = others;
        (tens, ones) = if ones == b'9' { (tens + 1, b'0') } else { (tens, ones + 1) };
    }
    table
};

/// A text that is being put together from what is known of a message.
struct Known {
    charset: Charset,
    order: u16,
    bytes: Bytes,
}

impl Known {
    fn push(&mut self, byte: u8) -> Option<()> {
        (self.bytes.length < Bytes::MAX).then(|| self.bytes.append(byte))
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

/// Up to 32 bytes.
#[derive(Debug, Clone, Copy)]
struct Bytes {
    bytes: [u8; Self::MAX],
    length: usize,
}

impl Bytes {
    const MAX: usize = 8 * Text::WORDS;
    const EMPTY: Self = Self { bytes: [0; Self::MAX], length: 0 };

    /// Nothing where it is full.
    fn append(&mut self, byte: u8) {
        if let Some(place) = self.bytes.get_mut(self.length) {
            *place = byte;
            self.length += 1;
        }
    }

    fn as_slice(&self) -> &[u8] {
        self.bytes.get(..self.length).unwrap_or_default()
    }

    /// As they are compared.
    fn compared(&self) -> Text {
        let mut text = Text { words: [0; Text::WORDS], masks: [0; Text::WORDS], length: 0 };
        let mut left = self.length;
        let places = text.words.iter_mut().zip(&mut text.masks);
        for ((word, mask), bytes) in places.zip(self.bytes.as_chunks().0) {
            *word = u64::from_le_bytes(*bytes);
            *mask = if left >= 8 { u64::MAX } else { (1 << (8 * left)) - 1 };
            left = left.saturating_sub(8);
        }
        // At most 32.
        text.length = u8::try_from(self.length).unwrap_or(0);
        text
    }
}

/// Up to 32 bytes that are compared eight at a time.
#[derive(Debug, Clone, Copy)]
struct Text {
    words: [u64; Self::WORDS],
    masks: [u64; Self::WORDS],
    length: u8,
}

impl Text {
    const WORDS: usize = 4;

    /// The place after this text, if its first word is here.
    #[inline(always)]
    fn skip<const WINDOW: usize>(&self, window: &[u8; WINDOW], at: usize) -> Option<usize> {
        let [first, ..] = self.words;
        let [mask, ..] = self.masks;
        // At most 32: the remainder only shows its bound.
        let length = usize::from(self.length % 64);
        (word(window, at)? & mask == first).then_some(at + length)
    }

    fn rest_is_at<const WINDOW: usize>(&self, window: &[u8; WINDOW], at: usize) -> bool {
        let words = self.words.iter().zip(&self.masks).enumerate().skip(1);
        let mut words = words.take_while(|(place, _)| 8 * place < usize::from(self.length));
        words.all(|(place, (expected, mask))| {
            word(window, at + 8 * place).is_some_and(|found| found & mask == *expected)
        })
    }
}
