//! Where in the endless sequence of jobs an end stands: the lap in the high bits, the slot's index in the low sixteen.
//!
//! Laps wrap. That is safe because every comparison is between positions that lie far less than half of all laps apart.

use crate::sync::{SignedWord, Word};

const INDEX_BITS: u32 = 16;
/// One lap on, at the same index.
const LAP: Word = 1 << INDEX_BITS;
const INDEX: Word = LAP - 1;
/// A watermark that lies this far behind is moved up before it could be mistaken for one ahead (a quarter of all laps).
const STALE: Word = 1 << (Word::BITS - 2);

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Position(Word);

impl Position {
    /// The first slot of the first lap; a slot's stamp of zero belongs to the lap before it.
    pub(crate) const START: Self = Position(LAP);

    /// The first slot of a lap: tests start close before the last one.
    pub(crate) const fn lap(lap: Word) -> Self {
        Position(lap << INDEX_BITS)
    }

    #[inline(always)]
    pub(crate) const fn index(self) -> usize {
        (self.0 & INDEX) as usize
    }

    /// The next position on a ring of `capacity` slots.
    #[inline(always)]
    pub(crate) const fn next(self, capacity: usize) -> Self {
        let next = self.0.wrapping_add(1);
        if Position(next).index() == capacity {
            Position((self.0 | INDEX).wrapping_add(1))
        } else {
            Position(next)
        }
    }

    /// The same slot, one lap on.
    #[inline(always)]
    pub(crate) const fn lap_after(self) -> Self {
        Position(self.0.wrapping_add(LAP))
    }

    /// The same slot, one lap ago.
    #[inline(always)]
    pub(crate) const fn lap_before(self) -> Self {
        Position(self.0.wrapping_sub(LAP))
    }

    /// What the slot carries when a job of this `number` is in it on this lap.
    #[inline(always)]
    pub(crate) const fn stamp(self, number: u16) -> Word {
        (self.0 & !INDEX) | number as Word
    }

    /// The number in a stamp, if it is of this lap.
    #[inline(always)]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "the branch says that only the low sixteen bits are set"
    )]
    pub(crate) const fn number_in(self, stamp: Word) -> Option<u16> {
        let number = stamp ^ (self.0 & !INDEX);
        if number <= INDEX { Some(number as u16) } else { None }
    }

    #[inline(always)]
    pub(crate) const fn is_before(self, other: Self) -> bool {
        (self.0.wrapping_sub(other.0) as SignedWord) < 0
    }

    /// The slots from here to `later`, which is at most one lap on.
    #[inline]
    pub(crate) const fn distance_to(self, later: Self, capacity: usize) -> usize {
        let lap = if (later.0 ^ self.0) & !INDEX == 0 { 0 } else { capacity };
        lap + later.index() - self.index()
    }

    /// Whether `older` has fallen so far behind that it must be moved up.
    #[inline(always)]
    pub(crate) const fn has_left_behind(self, older: Self) -> bool {
        self.0.wrapping_sub(older.0) > STALE
    }

    pub(crate) const fn into_word(self) -> Word {
        self.0
    }

    #[inline(always)]
    pub(crate) const fn from_word(word: Word) -> Self {
        Position(word)
    }
}
