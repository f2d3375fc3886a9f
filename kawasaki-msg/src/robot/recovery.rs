//! The ladder of recovery: send again, pause, clear the queue, tell the motion program (thesis, section 6.3).

/// What to do about a failure.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
pub enum Rung {
    /// Ask for the same jobs again.
    Resend,
    /// Ask the PC to pause, and wait before asking again.
    Pause,
    /// Clear the queue and ask for all that is not executed.
    Clear,
    /// Give up: the motion program stops and raises an alarm.
    Alarm,
}

/// How often each rung is tried before the next. The source names the rungs; the counts are ours.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ladder {
    /// How often the jobs are asked for again.
    pub resends: u16,
    /// How often the PC is asked to pause.
    pub pauses: u16,
    /// How often the queue is cleared.
    pub clears: u16,
}

impl Default for Ladder {
    fn default() -> Self {
        Self { resends: 3, pauses: 3, clears: 1 }
    }
}

/// Where on the ladder a session is. Any job beyond the one that failed brings it down to the floor.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Recovery {
    failures: u32,
    /// How many jobs were queued when the first of the failures was seen.
    stuck_at: u32,
}

impl Recovery {
    pub(crate) fn fail(&mut self, ladder: &Ladder, queued: u32) -> Rung {
        if self.failures == 0 || queued > self.stuck_at {
            (self.failures, self.stuck_at) = (0, queued);
        }
        self.failures = self.failures.saturating_add(1);
        let pauses = u32::from(ladder.resends) + u32::from(ladder.pauses);
        if self.failures <= u32::from(ladder.resends) {
            Rung::Resend
        } else if self.failures <= pauses {
            Rung::Pause
        } else if self.failures <= pauses + u32::from(ladder.clears) {
            Rung::Clear
        } else {
            Rung::Alarm
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ladder_is_climbed_rung_by_rung_and_left_by_progress() {
        let ladder = Ladder { resends: 2, pauses: 1, clears: 1 };
        let mut recovery = Recovery::default();
        let climb: std::vec::Vec<_> = (0..5).map(|_| recovery.fail(&ladder, 7)).collect();
        assert_eq!(climb, [Rung::Resend, Rung::Resend, Rung::Pause, Rung::Clear, Rung::Alarm]);
        // The clear takes the count back: that is no progress.
        assert_eq!(recovery.fail(&ladder, 3), Rung::Alarm);
        assert_eq!(recovery.fail(&ladder, 8), Rung::Resend);
    }
}
