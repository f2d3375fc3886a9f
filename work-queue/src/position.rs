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

const COMPLETED: Word = 1 << (Word::BITS - 1);

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Position(Word);

/// What is in a slot on a lap.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Stamp {
    /// The job with this number.
    Job(u16),
    /// Nothing any more: its job was completed before the jobs in front of it.
    Completed,
    /// Nothing yet.
    Free,
}

impl Position {
    /// The first slot of the first lap; a slot's stamp of zero belongs to the lap before it.
    pub(crate) const START: Self = Position(LAP);

    /// Before every position of any lap, for [`is_in_lap_before`](Self::is_in_lap_before).
    pub(crate) const NOWHERE: Self = Position(0);

    /// The first slot of a lap: tests start close before the last one.
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

    /// The first slot of the next lap instead of an index that is the capacity.
    pub(crate) const fn normalized(self, capacity: usize) -> Self {
        if self.index() == capacity { Position((self.0 | INDEX).wrapping_add(1)) } else { self }
    }

    /// The next position on a ring of `capacity` slots.
    pub(crate) const fn next(self, capacity: usize) -> Self {
        self.step().normalized(capacity)
    }

    /// Behind the last slot of this lap.
    pub(crate) const fn end_of_lap(self, capacity: usize) -> Self {
        Position((self.0 & !INDEX) | capacity as Word)
    }

    /// This position, or the end of the lap of `earlier` if that comes first.
    pub(crate) const fn or_end_of_lap(self, earlier: Self, capacity: usize) -> Self {
        if (self.0 ^ earlier.0) & !INDEX == 0 { self } else { earlier.end_of_lap(capacity) }
    }

    /// Whether `end`, which is an end of the same lap or [`NOWHERE`](Self::NOWHERE), comes later.
    #[inline(always)]
    pub(crate) const fn is_in_lap_before(self, end: Self) -> bool {
        self.0 < end.0
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

    /// What the slot carries when the job with this `number` is in it on this lap.
    #[inline(always)]
    pub(crate) const fn stamp(self, number: u16) -> Word {
        (self.0 & !INDEX) | number as Word
    }

    /// What the slot carries when its job of this lap was completed out of order: a lap half of all laps away.
    pub(crate) const fn stamp_completed(self) -> Word {
        (self.0 & !INDEX) ^ COMPLETED
    }

    /// What a stamp says on this lap.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_position_is_left_behind_beyond_a_quarter_of_all_laps() {
        // Sixteen bits are the index: 2^(n - 16) laps.
        let quarter = 1 << (Word::BITS - 18);
        for lap in [0, 1, quarter * 4 - 1] {
            let older = Position::lap(lap);
            assert!(!older.has_left_behind(older));
            assert!(!Position::lap(lap.wrapping_add(quarter)).has_left_behind(older));
            assert!(Position::lap(lap.wrapping_add(quarter)).step().has_left_behind(older));
        }
    }
}
