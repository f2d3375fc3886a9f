//! The messages of jobs as [`Message::encode`](crate::Message::encode) writes them, read in one pass.
//!
//! Thousands of jobs come in packets of nothing else. This reads them at a tenth of the cost of the general way, and only
//! them: the default table's order of fields, two digits of length, no blanks, no more than seven digits (16 bytes for a
//! point), the active order, the next number, coordinates within the bounds. Whatever is not exactly so is left to the general
//! way, which gives the same job or says what is wrong; property tests and a fuzz target hold the two together.
//!
//! What is known beforehand is compared and not parsed: the name, the order, the next number, and where the line begins, which is
//! where the last one ended: the robot is there.

use crate::dialect::Dialect;
use crate::job::{Bounds, Job, JobKind, Line, Point};
use crate::role::{Field, Role};
use crate::value::{DATA, END, SEPARATOR, START};

const DRAW: u16 = u16::from_le_bytes([b'1', SEPARATOR]);
const MOVE: u16 = u16::from_le_bytes([b'2', SEPARATOR]);

/// How many bytes from the beginning of a message may be looked at: so many more than the longest plain job has that the
/// compiler sees that none of the places below is outside.
pub(crate) const WINDOW: usize = 160;

type Window = [u8; WINDOW];

/// What the plain messages of one order have in common.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PlainJobs {
    /// `<name$`
    prefix: Text,
    /// `order$`
    order: Text,
    x: Range,
    y: Range,
    swar: Swar,
}

impl PlainJobs {
    /// `None` when there is no order, or the table puts the job's fields in another order or gives it a long name.
    pub(crate) fn new(dialect: &Dialect, bounds: &Bounds, order: u16) -> Option<Self> {
        use Field::{EndX, EndY, Kind, Number, Order, StartX, StartY};
        let entry = dialect.entry(Role::Job);
        if entry.fields != [Order, Number, Kind, StartX, StartY, EndX, EndY] || order == 0 {
            return None;
        }
        let mut prefix = Text::EMPTY;
        prefix.push(START)?;
        entry.name.chars().try_for_each(|c| prefix.push(dialect.charset().byte(c).ok()?))?;
        prefix.push(SEPARATOR)?;
        let (x, y) = (Range::new(bounds.min.x, bounds.max.x), Range::new(bounds.min.y, bounds.max.y));
        Some(Self { prefix, order: Text::number(order), x, y, swar: Swar::CONSTANTS })
    }

    /// The job that begins with the first byte of the window, and how many bytes it takes.
    #[inline(always)]
    pub(crate) fn read(&self, window: &Window, next: &mut Next) -> Option<(Job, usize)> {
        let length_at = self.prefix.skip(window, 0)?;
        let data_at = length_at + 3;
        let at = self.order.skip(window, data_at)?;
        let at = next.text.skip(window, at)?;
        let kind = match u16::from_le_bytes(*bytes(window, at)?) {
            DRAW => JobKind::Draw,
            MOVE => JobKind::Move,
            _ => return None,
        };
        let at = at + 2;
        let (start, end_at) = match next.start.skip(window, at) {
            Some(end_at) => (next.start.point, end_at),
            None => self.point(window, at, SEPARATOR)?,
        };
        let (end, at) = self.point(window, end_at, DATA)?;
        let length = u32::from_le_bytes(*bytes(window, length_at)?) & 0xFF_FFFF;
        if length != *LENGTHS.get((at - 1 - data_at) % 128)? || *bytes(window, at)? != [END] {
            return None;
        }
        next.start = PointText::new(end, window, end_at, at - 1)?;
        Some((Job { number: next.number, line: Line { kind, start, end } }, at + 1))
    }

    /// A coordinate and the mark after it; the place after the mark.
    #[inline(always)]
    fn coordinate(&self, range: &Range, window: &Window, at: usize, end: u8) -> Option<(i32, usize)> {
        let word = u64::from_le_bytes(*bytes(window, at)?);
        let (value, at) = if word & 0xFF == u64::from(b'-') {
            let word = u64::from_le_bytes(*bytes(window, at + 1)?);
            let (value, at) = self.swar.digits(word, window, at + 1, end)?;
            (-value, at)
        } else {
            self.swar.digits(word, window, at, end)?
        };
        (value.wrapping_sub(range.min).cast_unsigned() <= range.span).then_some((value, at))
    }

    #[inline(always)]
    fn point(&self, window: &Window, at: usize, end: u8) -> Option<(Point, usize)> {
        let (x, at) = self.coordinate(&self.x, window, at, SEPARATOR)?;
        let (y, at) = self.coordinate(&self.y, window, at, end)?;
        Some((Point { x, y }, at))
    }
}

/// What the next job is expected to say.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Next {
    number: u16,
    max: u16,
    /// `number$`
    text: Text,
    /// One more in the last digit of the text.
    one: u64,
    /// The number after which the last digit is carried, or 1 follows.
    stop: u16,
    start: PointText,
}

impl Next {
    /// Begins with this number; 1 follows `max`.
    pub(crate) fn new(number: u16, max: u16) -> Self {
        let mut next = Self { number, max, text: Text::EMPTY, one: 0, stop: 0, start: PointText::NONE };
        next.set(number);
        next
    }

    #[cfg(test)]
    pub(crate) fn number(&self) -> u16 {
        self.number
    }

    /// Goes on to the next number.
    #[inline(always)]
    pub(crate) fn advance(&mut self) {
        if self.number == self.stop {
            self.set(if self.number >= self.max { 1 } else { self.number + 1 });
        } else {
            self.number += 1;
            self.text.word += self.one;
        }
    }

    #[cold]
    fn set(&mut self, number: u16) {
        (self.number, self.text) = (number, Text::number(number));
        self.one = 1 << (8 * self.text.length).saturating_sub(16);
        self.stop = (number - number % 10 + 9).min(self.max);
    }
}

/// A point as it stood on the wire, `x$y`, up to 16 bytes of it.
#[derive(Debug, Clone, Copy)]
struct PointText {
    point: Point,
    word: u128,
    length: usize,
}

impl PointText {
    /// Equal to nothing.
    const NONE: Self = Self { point: Point::new(0, 0), word: 1, length: 0 };

    /// The bytes of the window from `at` to `end`.
    #[inline(always)]
    fn new(point: Point, window: &Window, at: usize, end: usize) -> Option<Self> {
        let length = end - at;
        let mask = MASKS.get(length)?;
        Some(Self { point, word: u128::from_le_bytes(*bytes(window, at)?) & mask, length })
    }

    /// The place after this point and a separator, if the window has it here.
    #[inline(always)]
    fn skip(&self, window: &Window, at: usize) -> Option<usize> {
        let mask = MASKS.get(self.length)?;
        let same = u128::from_le_bytes(*bytes(window, at)?) & mask == self.word;
        (same && *bytes(window, at + self.length)? == [SEPARATOR]).then_some(at + self.length + 1)
    }
}

/// The first bytes of a word, up to 16 of them.
const MASKS: [u128; 17] = {
    let mut table = [0; 17];
    let mut rest: &mut [u128] = &mut table;
    let mut mask = 0;
    while let [first, others @ ..] = rest {
        *first = mask;
        mask = (mask << 8) + 0xFF;
        rest = others;
    }
    table
};

/// The coordinates of one axis.
#[derive(Debug, Clone, Copy)]
struct Range {
    min: i32,
    span: u32,
}

impl Range {
    fn new(min: i32, max: i32) -> Self {
        Self { min, span: max.wrapping_sub(min).cast_unsigned() }
    }
}

/// What eight bytes are calculated with, as data: every one of these as an immediate would take an instruction more.
#[derive(Debug, Clone, Copy)]
struct Swar {
    zeros: u64,
    above_nine: u64,
    tops: u64,
    pairs: u64,
    fours: u64,
    eights: u64,
}

impl Swar {
    const CONSTANTS: Self = Self {
        zeros: 0x3030_3030_3030_3030,
        above_nine: 0x7676_7676_7676_7676,
        tops: 0x8080_8080_8080_8080,
        pairs: 0x00FF_00FF_00FF_00FF,
        fours: 0x0000_FFFF_0000_FFFF,
        eights: (10_000 << 32) + 1,
    };

    /// One to seven digits and the mark after them, all at once: their value, and the place after the mark.
    #[inline(always)]
    fn digits(&self, word: u64, window: &Window, at: usize, end: u8) -> Option<(i32, usize)> {
        // A digit becomes its value; the sum reaches the top bit of a byte from 10 on.
        let values = word ^ self.zeros;
        let others = (values.wrapping_add(self.above_nine) | values) & self.tops;
        if others == 0 {
            return None;
        }
        let bits = others.trailing_zeros() & 0x38;
        let at = at + bits as usize / 8;
        if bits == 0 || *bytes(window, at)? != [end] {
            return None;
        }
        // First digit lowest, zeros before it: then pairs, fours and eights are joined.
        let digits = values << (64 - bits);
        let pairs = (digits.wrapping_mul((10 << 8) + 1) >> 8) & self.pairs;
        let fours = (pairs.wrapping_mul((100 << 16) + 1) >> 16) & self.fours;
        let value = (fours.wrapping_mul(self.eights) >> 32) as u32;
        Some((value.cast_signed(), at + 1))
    }
}

/// Up to eight bytes that are compared at once.
#[derive(Debug, Clone, Copy)]
struct Text {
    word: u64,
    mask: u64,
    length: usize,
}

impl Text {
    const EMPTY: Self = Self { word: 0, mask: 0, length: 0 };

    /// A number of up to five digits and the separator after it.
    fn number(number: u16) -> Self {
        let digit = |of: u16| {
            let [digit, _] = (number / of % 10).to_le_bytes();
            b'0' + digit
        };
        let digits = [digit(10_000), digit(1000), digit(100), digit(10), digit(1), SEPARATOR, 0, 0];
        let length = match number {
            0..10 => 1,
            10..100 => 2,
            100..1000 => 3,
            1000..10_000 => 4,
            10_000.. => 5,
        };
        let word = u64::from_le_bytes(digits) >> (40 - 8 * length);
        Self { word, mask: u64::MAX >> (56 - 8 * length), length: length as usize + 1 }
    }

    fn push(&mut self, byte: u8) -> Option<()> {
        let shift = u32::try_from(self.length * 8).ok().filter(|shift| *shift < u64::BITS)?;
        self.word |= u64::from(byte) << shift;
        self.mask |= 0xFF << shift;
        self.length += 1;
        Some(())
    }

    /// The place after this text, if the window has it here.
    #[inline(always)]
    fn skip(&self, window: &Window, at: usize) -> Option<usize> {
        // The remainder is the length itself: it only shows its bound.
        let word = u64::from_le_bytes(*bytes(window, at)?);
        (word & self.mask == self.word).then_some(at + self.length % 16)
    }
}

#[inline(always)]
fn bytes<const N: usize>(window: &Window, at: usize) -> Option<&[u8; N]> {
    window.get(at..)?.first_chunk()
}

/// Every length below 100 with the mark after it, as three bytes of the wire. No plain job is longer.
const LENGTHS: [u32; 128] = {
    let mut table = [0; 128];
    let mut rest: &mut [u32] = &mut table;
    let (mut tens, mut ones) = (b'0', b'0');
    while let ([first, others @ ..], b'0'..=b'9') = (rest, tens) {
        *first = u32::from_le_bytes([tens, ones, DATA, 0]);
        rest = others;
        (tens, ones) = if ones == b'9' { (tens + 1, b'0') } else { (tens, ones + 1) };
    }
    table
};

#[cfg(test)]
mod tests;
