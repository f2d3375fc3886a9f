//! A position in the endless sequence of jobs: the lap in the high bits, the slot's index in the low sixteen.
//!
//! Laps wrap. That is safe because every comparison is between positions that are far less than half of all laps apart.

use crate::sync::{SignedWord, Word};

const INDEX_BITS: u32 = 16;
/// The distance of one lap.
const LAP: Word = 1 << INDEX_BITS;
const INDEX: Word = LAP - 1;
/// A watermark that is older than this is replaced (a quarter of all laps). From half of all laps it would compare as newer.
const STALE: Word = 1 << (Word::BITS - 2);

const COMPLETED: Word = 1 << (Word::BITS - 1);

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Position(Word);

/// What is in a slot on a lap.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Stamp {
    /// The job with this number.
    Job(u16),
    /// Nothing any more: its job was completed before older jobs.
    Completed,
    /// Nothing yet.
    Free,
}

impl Position {
    /// The first slot of the first lap; a slot's stamp of zero belongs to the lap before it.
    pub(crate) const START: Self = Position(LAP);

    /// Before every position of any lap, for [`is_in_lap_before`](Self::is_in_lap_before).
    pub(crate) const NOWHERE: Self = Position(0);

    /// The first slot of a lap. Tests start shortly before laps wrap.
    pub(crate) const fn lap(lap: Word) -> Self {
        Position(lap << INDEX_BITS)
    }

    #[inline(always)]
    pub(crate) const fn index(self) -> usize {
        (self.0 & INDEX) as usize
    }

    /// The next index, which may be the capacity.
    #[inline(always)]
    pub(crate) const fn step(self) -> Self {
        Position(self.0.wrapping_add(1))
    }

    /// The same position, but the first slot of the next lap if the index is the capacity.
    pub(crate) const fn normalized(self, capacity: usize) -> Self {
        if self.index() == capacity { Position((self.0 | INDEX).wrapping_add(1)) } else { self }
    }

    /// The next position on a ring of `capacity` slots.
    pub(crate) const fn next(self, capacity: usize) -> Self {
        self.step().normalized(capacity)
    }

    /// The position after the last slot of this lap: its index is the capacity.
    pub(crate) const fn end_of_lap(self, capacity: usize) -> Self {
        Position((self.0 & !INDEX) | capacity as Word)
    }

    /// This position, or the end of the lap of `earlier` if that comes first.
    pub(crate) const fn or_end_of_lap(self, earlier: Self, capacity: usize) -> Self {
        if (self.0 ^ earlier.0) & !INDEX == 0 { self } else { earlier.end_of_lap(capacity) }
    }

    /// Whether this position is before `end`, which is an end of the same lap or [`NOWHERE`](Self::NOWHERE).
    #[inline(always)]
    pub(crate) const fn is_in_lap_before(self, end: Self) -> bool {
        self.0 < end.0
    }

    /// The same slot, one lap later.
    #[inline(always)]
    pub(crate) const fn lap_after(self) -> Self {
        Position(self.0.wrapping_add(LAP))
    }

    /// The same slot, one lap earlier.
    #[inline(always)]
    pub(crate) const fn lap_before(self) -> Self {
        Position(self.0.wrapping_sub(LAP))
    }

    /// The stamp of the slot while it contains the job with this `number` on this lap.
    #[inline(always)]
    pub(crate) const fn stamp(self, number: u16) -> Word {
        (self.0 & !INDEX) | number as Word
    }

    /// The stamp of the slot after its job of this lap was completed out of order: a lap half of all laps away.
    pub(crate) const fn stamp_completed(self) -> Word {
        (self.0 & !INDEX) ^ COMPLETED
    }

    /// The meaning of a stamp on this lap.
    #[inline(always)]
    pub(crate) const fn read(self, stamp: Word) -> Stamp {
        let difference = stamp ^ (self.0 & !INDEX);
        if difference <= INDEX {
            #[expect(clippy::cast_possible_truncation, reason = "it is below 1 << 16")]
            Stamp::Job(difference as u16)
        } else if difference == COMPLETED {
            Stamp::Completed
        } else {
            Stamp::Free
        }
    }

    #[inline(always)]
    pub(crate) const fn is_before(self, other: Self) -> bool {
        (self.0.wrapping_sub(other.0) as SignedWord) < 0
    }

    /// The number of slots from here to `later`, which is at most one lap later.
    #[inline]
    pub(crate) const fn distance_to(self, later: Self, capacity: usize) -> usize {
        let lap = if (later.0 ^ self.0) & !INDEX == 0 { 0 } else { capacity };
        lap + later.index() - self.index()
    }

    /// Whether this position is so much older than `newer` that it must be replaced.
    #[inline(always)]
    pub(crate) const fn is_stale_at(self, newer: Self) -> bool {
        newer.0.wrapping_sub(self.0) > STALE
    }

    pub(crate) const fn into_word(self) -> Word {
        self.0
    }

    #[inline(always)]
    pub(crate) const fn from_word(word: Word) -> Self {
        Position(word)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_position_is_stale_beyond_a_quarter_of_all_laps() {
        // Sixteen bits are the index: 2^(n - 16) laps.
        let quarter = 1 << (Word::BITS - 18);
        for lap in [0, 1, quarter * 4 - 1] {
            let older = Position::lap(lap);
            assert!(!older.is_stale_at(older));
            assert!(!older.is_stale_at(Position::lap(lap.wrapping_add(quarter))));
            assert!(older.is_stale_at(Position::lap(lap.wrapping_add(quarter)).step()));
        }
    }
}
