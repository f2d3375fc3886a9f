//! Job numbers on the wire against the count of jobs in the order.

use crate::error::ConfigError;

/// Numbers run from 1 to `max`, then from 1 again (thesis, section 11.1.1); the sessions count on. A number means the one count
/// in a window shorter than `max` that has it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Numbering {
    max: u16,
}

impl Numbering {
    /// Numbers up to `max`, which is at least 1.
    pub const fn new(max: u16) -> Self {
        Self { max: if max == 0 { 1 } else { max } }
    }

    /// The highest number.
    pub const fn max(self) -> u16 {
        self.max
    }

    /// Whether this is a number at all.
    pub const fn contains(self, number: u16) -> bool {
        1 <= number && number <= self.max
    }

    /// The number of the job that is the `count`-th of its order; `None` for the zeroth. 0 is never sent.
    pub fn number(self, count: u32) -> Option<u16> {
        let before = count.checked_sub(1)?;
        u16::try_from(before % u32::from(self.max)).ok().map(|n| n + 1)
    }

    /// The number of the job that follows the `count`-th.
    pub fn next(self, count: u32) -> u16 {
        self.number(count + 1).unwrap_or(1)
    }

    /// How far a number is ahead of the job that is the `count`-th: `0..max`.
    pub fn ahead(self, count: u32, number: u16) -> u32 {
        let (max, last) = (u32::from(self.max), count % u32::from(self.max));
        (u32::from(number) + max - last) % max
    }
}

/// The words of a [`NumberSet`] that holds every number of a job, up to 9999.
pub const ALL_NUMBERS: usize = 10_000usize.div_ceil(64);

/// A set of job numbers, below 64 for each of its words.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct NumberSet<const WORDS: usize = ALL_NUMBERS> {
    bits: [u64; WORDS],
    count: u32,
}

impl<const WORDS: usize> NumberSet<WORDS> {
    /// The empty set.
    pub const fn new() -> Self {
        Self { bits: [0; WORDS], count: 0 }
    }

    /// Whether it can hold every number up to this one.
    pub(crate) const fn check(max: u16) -> Result<(), ConfigError> {
        let numbers = 64 * WORDS;
        if max as usize >= numbers { Err(ConfigError::TooManyNumbers { max, numbers }) } else { Ok(()) }
    }

    /// Whether a number is in the set.
    pub fn contains(&self, number: u16) -> bool {
        self.bits.get(usize::from(number / 64)).is_some_and(|word| word >> (number % 64) & 1 == 1)
    }

    /// Adds a number; whether it was not there.
    pub fn insert(&mut self, number: u16) -> bool {
        let new = !self.contains(number);
        if let Some(word) = self.bits.get_mut(usize::from(number / 64)) {
            *word |= 1 << (number % 64);
            self.count += u32::from(new);
        }
        new
    }

    /// Removes a number; whether it was there.
    pub fn remove(&mut self, number: u16) -> bool {
        let there = self.contains(number);
        if let Some(word) = self.bits.get_mut(usize::from(number / 64)) {
            *word &= !(1 << (number % 64));
            self.count -= u32::from(there);
        }
        there
    }

    /// Removes all numbers.
    pub fn clear(&mut self) {
        if !self.is_empty() {
            *self = Self::new();
        }
    }

    /// Whether no number is in the set.
    pub const fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// The numbers in the set, the least first.
    pub fn iter(&self) -> impl Iterator<Item = u16> {
        self.bits.iter().zip((0..).step_by(64)).flat_map(|(word, base)| {
            (0..64).filter(move |bit| word >> bit & 1 != 0).map(move |bit| base + bit)
        })
    }

    /// The least number in the set.
    pub fn first(&self) -> Option<u16> {
        let (i, word) = self.bits.iter().enumerate().find(|(_, word)| **word != 0)?;
        u16::try_from(i * 64)
            .ok()
            .zip(u16::try_from(word.trailing_zeros()).ok())
            .map(|(base, bit)| base + bit)
    }
}

impl<const WORDS: usize> Default for NumberSet<WORDS> {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_wrap_and_counts_go_on() {
        let numbering = Numbering::new(5);
        let numbers: std::vec::Vec<_> = (0..=11).map(|count| numbering.number(count)).collect();
        let expected = [None, Some(1), Some(2), Some(3), Some(4), Some(5)];
        assert_eq!(numbers[..6], expected);
        assert_eq!(numbers[6..], [1, 2, 3, 4, 5, 1].map(Some));
        assert_eq!(numbering.next(5), 1);
    }

    #[test]
    fn a_number_is_as_far_ahead_as_its_count() {
        for max in [1, 2, 5, 9999] {
            let numbering = Numbering::new(max);
            for count in [0, 1, 4, 5, 6, 9998, 9999, 10_000] {
                for ahead in (0..u32::from(max)).step_by(1 + usize::from(max) / 7) {
                    if let Some(number) = numbering.number(count + ahead) {
                        assert_eq!(numbering.ahead(count, number), ahead, "{max} {count} {ahead}");
                    }
                }
            }
        }
    }

    #[test]
    fn a_set_holds_every_number() {
        let mut set: NumberSet = NumberSet::new();
        assert!(set.is_empty() && set.first().is_none());
        let numbers = [1, 63, 65, 128, 9999];
        for number in numbers {
            assert!(set.insert(number) && !set.insert(number));
            assert!(set.contains(number) && !set.contains(number - 1) && !set.is_empty());
        }
        for number in numbers {
            assert_eq!((set.first(), set.is_empty()), (Some(number), false));
            assert!(set.remove(number) && !set.remove(number));
        }
        assert!(set.is_empty() && set.first().is_none());
        assert!(set.insert(5000));
        set.clear();
        assert!(set.is_empty() && !set.contains(5000));
    }
}
