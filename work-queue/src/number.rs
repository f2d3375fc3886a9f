//! The numbers of jobs: 1 to the highest, then 1 again. The queue's own rule, so that both ends of a link count alike.

use core::num::NonZeroU16;

use crate::error::{ConfigError, NumberError};

const FIRST: NonZeroU16 = NonZeroU16::MIN;

#[derive(Debug)]
pub(crate) struct Numbering {
    next: NonZeroU16,
    max: u16,
    /// Whether the number before 1 is the highest one, and not none at all.
    wrapped: bool,
}

impl Numbering {
    /// `max` is above the capacity, or one number could be in the queue twice.
    pub(crate) const fn new(max: u16) -> Self {
        Numbering { next: FIRST, max, wrapped: false }
    }

    pub(crate) fn restart(&mut self) {
        *self = Self::new(self.max);
    }

    #[inline(always)]
    pub(crate) fn check(&self, found: u16) -> Result<(), NumberError> {
        if found == self.next.get() { Ok(()) } else { Err(self.refuse(found)) }
    }

    #[cold]
    fn refuse(&self, found: u16) -> NumberError {
        match self.last() {
            Some(last) if last == found => NumberError::Repeated { number: found },
            _ => NumberError::Unexpected { expected: self.next.get(), found },
        }
    }

    #[inline(always)]
    pub(crate) fn advance(&mut self) {
        self.next = match self.next.checked_add(1) {
            Some(next) if next.get() <= self.max => next,
            _ => {
                self.wrapped = true;
                FIRST
            }
        };
    }

    #[inline(always)]
    pub(crate) const fn next(&self) -> NonZeroU16 {
        self.next
    }

    pub(crate) const fn last(&self) -> Option<u16> {
        match self.next.get() {
            1 if self.wrapped => Some(self.max),
            1 => None,
            next => Some(next - 1),
        }
    }

    pub(crate) const fn max(&self) -> u16 {
        self.max
    }
}

/// The highest capacity: the source's controller has no indices of five digits.
const MAX_CAPACITY: usize = 9999;

pub(crate) const fn check_config(capacity: usize, max_number: u16) -> Result<(), ConfigError> {
    if capacity == 0 || capacity > MAX_CAPACITY {
        Err(ConfigError::Capacity { capacity })
    } else if max_number as usize <= capacity {
        Err(ConfigError::MaxNumber { max_number, capacity })
    } else {
        Ok(())
    }
}
