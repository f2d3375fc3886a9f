//! The phase of an order, as both ends report it in their status.

/// The phase of an order. The codes on the wire are this project's: the source only states that the status message names the
/// phase (thesis, section 11.2).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
pub enum Phase {
    /// 0: there is no order.
    Idle,
    /// 1: an order is to begin, and is not acknowledged yet.
    Starting,
    /// 2: jobs are sent and executed.
    Active,
    /// 3: no job follows; those in the queue are executed.
    Ending,
    /// 4: the queue is being cleared; the job that is being executed is the last.
    Interrupted,
    /// 5: the recovery has failed; the motion program must act (thesis, section 6.3).
    Alarm,
    /// A code that this version does not know. No session ever has this phase.
    Other(u8),
}

impl From<u8> for Phase {
    fn from(code: u8) -> Self {
        match code {
            0 => Phase::Idle,
            1 => Phase::Starting,
            2 => Phase::Active,
            3 => Phase::Ending,
            4 => Phase::Interrupted,
            5 => Phase::Alarm,
            other => Phase::Other(other),
        }
    }
}

impl From<Phase> for u8 {
    fn from(phase: Phase) -> Self {
        match phase {
            Phase::Idle => 0,
            Phase::Starting => 1,
            Phase::Active => 2,
            Phase::Ending => 3,
            Phase::Interrupted => 4,
            Phase::Alarm => 5,
            Phase::Other(code) => code,
        }
    }
}
