//! The numbers of jobs: 1 to the highest, then 1 again. The rule is part of the queue, so that both ends of a link count alike.

use crate::error::{ConfigError, NumberError};

const FIRST: u16 = 1;

#[derive(Debug)]
pub(crate) struct Numbering {
    next: u16,
    max: u16,
    /// Whether a job was queued before the current number 1. Its number was the highest one.
    wrapped: bool,
}

impl Numbering {
    /// `max` must be above the capacity, because otherwise one number could be in the queue twice.
    pub(crate) const fn new(max: u16) -> Self {
        Numbering { next: FIRST, max, wrapped: false }
    }

    pub(crate) fn restart(&mut self) {
        *self = Self::new(self.max);
    }

    #[inline(always)]
    pub(crate) fn check(&self, found: u16) -> Result<(), NumberError> {
        if found == self.next { Ok(()) } else { Err(self.refuse(found)) }
    }

    #[cold]
    #[inline(never)]
    fn refuse(&self, found: u16) -> NumberError {
        match self.last() {
            Some(last) if last == found => NumberError::Repeated { number: found },
            _ => NumberError::Unexpected { expected: self.next, found },
        }
    }

    #[inline(always)]
    pub(crate) fn advance(&mut self) {
        if self.next < self.max {
            self.next += 1;
        } else {
            self.next = FIRST;
            self.wrapped = true;
        }
    }

    #[inline(always)]
    pub(crate) const fn next(&self) -> u16 {
        self.next
    }

    pub(crate) const fn last(&self) -> Option<u16> {
        match self.next {
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
