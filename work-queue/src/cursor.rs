//! The place of an end in the endless sequence of jobs.
//!
//! A position counts jobs from 0 up to [`Limits::wrap`], and then from 0 again: after this many laps that no two positions
//! which are compared are half of that apart.

/// The parameters of a queue. The highest number is above the capacity.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Limits {
    pub(crate) capacity: u32,
    pub(crate) max: u16,
}

impl Limits {
    /// Returns the number of positions before they wrap: 2^16 laps, below 2^30. A lap begins there, and the low half of a
    /// position continues to count.
    const fn wrap(self) -> u32 {
        self.capacity << 16
    }

    /// Returns the distance from `position` to a later one.
    #[inline(always)]
    pub(crate) const fn distance(self, position: u32, later: u32) -> u32 {
        let distance = later.wrapping_sub(position);
        if later < position { distance.wrapping_add(self.wrap()) } else { distance }
    }

    /// Returns whether a position is before another one.
    pub(crate) const fn is_before(self, position: u32, other: u32) -> bool {
        let distance = self.distance(position, other);
        0 < distance && distance < self.wrap() / 2
    }

    /// Returns the position this many jobs later, at most a lap.
    #[inline(always)]
    pub(crate) const fn after(self, position: u32, jobs: u32) -> u32 {
        let after = position + jobs;
        if after < self.wrap() { after } else { after - self.wrap() }
    }
}

/// The place of one end. Until `stop` a step is one addition and one comparison.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Cursor {
    pub(crate) at: u32,
    /// The end of the slots that are known to be this end's.
    pub(crate) end: u32,
    /// The end of the lap, or of the numbers, or an earlier position: a step to it must [`turn`](Self::turn).
    pub(crate) stop: u32,
    /// The position of the first slot on this lap.
    lap: u32,
    /// The position before that of the job with number 1.
    zero: u32,
    /// Whether a job was queued before number 1: it had the highest number.
    wrapped: bool,
}

impl Cursor {
    /// Creates a cursor at this position, whose job has this number. No jobs are queued before it.
    pub(crate) const fn new(at: u32, number: u16, limits: Limits) -> Self {
        let lap = at - at % limits.capacity;
        let mut cursor = Cursor { at, end: at, stop: at, lap, zero: 0, wrapped: false };
        cursor.number_from(number, limits);
        cursor
    }

    /// Sets the number of the job here; no jobs precede the first one.
    pub(crate) const fn number_from(&mut self, number: u16, limits: Limits) {
        self.zero = self.at.wrapping_sub(number as u32);
        self.wrapped = false;
        self.turn(limits);
    }

    /// Returns the same end one lap or less before, without a reset in between. No slots are known to belong to the end.
    pub(crate) const fn back_at(self, position: u32, limits: Limits) -> Self {
        let max = limits.max as u32;
        let back = limits.distance(position, self.at) % max;
        let number = (self.number() as u32 - 1 + max - back) % max + 1;
        let cursor = Self::new(position, (number & 0xFFFF) as u16, limits);
        Cursor { wrapped: self.wrapped, ..cursor }
    }

    /// Wraps the lap and the numbers at their end, and finds the next stop.
    #[inline(always)]
    pub(crate) const fn turn(&mut self, limits: Limits) {
        if self.at == limits.wrap() {
            self.zero = self.zero.wrapping_sub(self.at);
            (self.at, self.lap) = (0, 0);
        } else if self.at - self.lap == limits.capacity {
            self.lap = self.at;
        }
        if self.at.wrapping_sub(self.zero) > limits.max as u32 {
            self.zero = self.at.wrapping_sub(1);
            self.wrapped = true;
        }
        let slots = limits.capacity - (self.at - self.lap);
        let numbers = limits.max as u32 + 1 - self.at.wrapping_sub(self.zero);
        self.stop = self.at + if slots < numbers { slots } else { numbers };
    }

    /// Returns whether the slot here belongs to this end.
    #[inline(always)]
    pub(crate) const fn is_open(&self) -> bool {
        self.at != self.end
    }

    /// Returns the number of slots from here on that are in a row, numbered one after the other, and this end's.
    #[inline(always)]
    pub(crate) const fn row(&self, limits: Limits) -> u32 {
        let (left, row) = (limits.distance(self.at, self.end), self.stop - self.at);
        if left < row { left } else { row }
    }

    #[inline(always)]
    pub(crate) const fn index(&self) -> usize {
        (self.at - self.lap) as usize
    }

    /// Returns the number of the job here.
    #[inline(always)]
    pub(crate) const fn number(&self) -> u16 {
        (self.at.wrapping_sub(self.zero) & 0xFFFF) as u16
    }

    /// Returns the number of the job before.
    pub(crate) const fn last(&self, limits: Limits) -> Option<u16> {
        match self.number() {
            1 if self.wrapped => Some(limits.max),
            1 => None,
            number => Some(number - 1),
        }
    }

    /// Moves on within a row. True at its stop: then [`turn`](Self::turn).
    #[inline(always)]
    #[must_use]
    pub(crate) const fn advance(&mut self, jobs: u32) -> bool {
        self.at += jobs;
        self.at == self.stop
    }

    #[inline(always)]
    pub(crate) const fn step(&mut self, limits: Limits) {
        if self.advance(1) {
            self.turn(limits);
        }
    }
}

/// The jobs before a position are discarded, and the job there has a number: one word, so that a reader sees both or neither.
///
/// Half of a position is enough, because the writer [renews](Self::is_stale) an old mark.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Mark(pub(crate) u32);

impl Mark {
    pub(crate) const fn new(position: u32, number: u16) -> Self {
        Mark(position << 16 | number as u32)
    }

    pub(crate) const fn number(self) -> u16 {
        (self.0 & 0xFFFF) as u16
    }

    /// Returns the number of positions that it is ahead of `at`; negative if it is behind.
    pub(crate) const fn ahead_of(self, at: u32) -> i16 {
        ((self.0 >> 16) as u16).wrapping_sub((at & 0xFFFF) as u16).cast_signed()
    }

    /// Returns whether the mark is so far behind `at` that it must be renewed. Called at least once per lap, of at most 9999
    /// jobs.
    pub(crate) const fn is_stale(self, at: u32) -> bool {
        self.ahead_of(at) < -(1 << 14)
    }
}

#[cfg(test)]
mod tests {
    use super::{Limits, Mark};

    #[test]
    fn a_position_is_before_those_that_are_less_than_half_of_all_positions_later() {
        for capacity in [1, 3, 9999] {
            let limits = Limits { capacity, max: u16::MAX };
            let wrap = limits.wrap();
            assert_eq!(wrap, capacity * 65536, "a lap begins where the positions do again");
            for position in [0, 1, wrap / 2, wrap - 1] {
                for distance in [0, 1, 2, wrap / 2 - 1, wrap / 2, wrap / 2 + 1, wrap - 1] {
                    let later = (position + distance) % wrap;
                    assert_eq!(limits.distance(position, later), distance);
                    let is_before = 0 < distance && distance < wrap / 2;
                    assert_eq!(limits.is_before(position, later), is_before, "{later} is {distance} later");
                }
                assert_eq!(limits.after(position, capacity), (position + capacity) % wrap);
            }
        }
    }

    #[test]
    fn a_mark_is_stale_when_it_is_more_than_a_quarter_of_its_range_behind() {
        let mark = Mark::new(0, 1);
        assert_eq!([0, 1, 1 << 14, (1 << 14) + 1].map(|at| mark.is_stale(at)), [false, false, false, true]);
        assert!(mark.ahead_of((1 << 14) + 9999) < 0, "nor is it taken for one ahead in the lap after that");
    }
}
