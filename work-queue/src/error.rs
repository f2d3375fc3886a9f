/// Every slot contains a job that is waiting or being executed.
///
/// Discard the rest of the packet, wait until [`drained`](crate::Writer::drained), then request a resend from the job after
/// [`last_number`](crate::Writer::last_number).
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[error("the work queue is full")]
pub struct Full;

/// The number of a job is not the next one. Nothing was queued; the writer still expects the same number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum NumberError {
    /// The job that was queued last was sent again. The caller can ignore it.
    #[error("job {number} is already queued")]
    Repeated {
        /// The number of the job queued last.
        number: u16,
    },
    /// At least one job before this one is missing, or the number is out of range.
    #[error("expected job {expected}, found job {found}")]
    Unexpected {
        /// The number that the next job must have.
        expected: u16,
        /// The number that it has.
        found: u16,
    },
}

/// No queue can have this configuration.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum ConfigError {
    /// The capacity is outside `1..=9999`.
    #[error("a capacity of {capacity} jobs is outside 1 to 9999")]
    Capacity {
        /// The requested number of jobs.
        capacity: usize,
    },
    /// The highest job number is not above the capacity: one number could be in the queue twice.
    #[error("the highest job number {max_number} is not above the capacity of {capacity} jobs")]
    MaxNumber {
        /// The requested highest job number.
        max_number: u16,
        /// The requested number of jobs of the queue.
        capacity: usize,
    },
}
