//! Conversion between job numbers on the wire and the count of jobs in the order.

/// The numbering of jobs: from 1 to `max`, then from 1 again (thesis, section 11.1.1), while the sessions count on. In a
/// window shorter than `max`, a number stands for exactly one count.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Numbering {
    max: u16,
}

impl Numbering {
    /// Numbers up to `max`, which is at least 1.
    pub const fn new(max: u16) -> Self {
        Self { max: if max == 0 { 1 } else { max } }
    }

    /// Returns the highest number.
    pub const fn max(self) -> u16 {
        self.max
    }

    /// Returns whether this is a valid number.
    pub const fn contains(self, number: u16) -> bool {
        1 <= number && number <= self.max
    }

    /// Returns the number of the job that is the `count`-th of its order; `None` for the zeroth, since 0 is never sent.
    pub fn number(self, count: u32) -> Option<u16> {
        let before = count.checked_sub(1)?;
        u16::try_from(before % u32::from(self.max)).ok().map(|n| n + 1)
    }

    /// Returns the number of the job that follows the `count`-th.
    pub fn next(self, count: u32) -> u16 {
        self.number(count + 1).unwrap_or(1)
    }

    /// Returns how many jobs a number is ahead of the `count`-th job: `0..max`.
    pub fn ahead(self, count: u32, number: u16) -> u32 {
        let (max, last) = (u32::from(self.max), count % u32::from(self.max));
        (u32::from(number) + max - last) % max
    }
}

/// The jobs after a count that have overtaken others: those executed, or acknowledged, before all up to them are.
#[derive(Debug, Clone, Default, PartialEq, Eq, Hash)]
pub struct AheadJobs {
    /// A bit for each job after the count, the next one first.
    bits: [u64; Self::MAX as usize / 64],
    /// The number of jobs in the set.
    len: u16,
}

impl AheadJobs {
    /// The number of jobs after the count that can be distinguished: the longest queue in which jobs overtake one another.
    pub const MAX: u32 = 1024;

    /// Returns whether the set has the job that follows the count after this many others.
    pub fn contains(&self, after: u32) -> bool {
        self.len > 0 && self.bits.get(after as usize / 64).is_some_and(|word| word >> (after % 64) & 1 == 1)
    }

    /// Returns whether the set is empty.
    pub const fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Adds the job that follows the count after this many others; returns whether it is new and distinguishable.
    pub(crate) fn insert(&mut self, after: u32) -> bool {
        let is_new = !self.contains(after);
        let Some(word) = self.bits.get_mut(after as usize / 64).filter(|_| is_new) else { return false };
        *word |= 1 << (after % 64);
        self.len += 1;
        true
    }

    /// Increases the count: its next job is not ahead any more.
    pub(crate) fn pass(&mut self) {
        if self.len == 0 {
            return;
        }
        let mut first = 0;
        for word in self.bits.iter_mut().rev() {
            (*word, first) = (*word >> 1 | first << 63, *word & 1);
        }
        self.len -= u16::from(first == 1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn jobs_ahead_follow_their_count() {
        let mut ahead = AheadJobs::default();
        let jobs = [0, 1, 63, 64, 500, 1023];
        for after in jobs {
            assert!(!ahead.contains(after) && ahead.insert(after) && !ahead.insert(after));
            assert!(ahead.contains(after) && !ahead.contains(after + 2));
        }
        assert!(!ahead.insert(AheadJobs::MAX) && !ahead.contains(AheadJobs::MAX));
        for count in 0..=1024 {
            let left = jobs.iter().filter(|after| **after >= count);
            assert!((0..1024).filter(|after| ahead.contains(*after)).eq(left.map(|after| after - count)));
            ahead.pass();
        }
        assert_eq!(ahead, AheadJobs::default());
    }
}
