//! The motions of a device as jobs: the replies of the device, beside the motions that it has begun.

use cellwire_sim::ledger::Counts;

/// The motions of a device, in their order.
#[derive(Debug, Default)]
pub struct Motions {
    spans: Vec<Span>,
    /// Motions without a reply since the last agreed one.
    unknown: u64,
    /// The number of motions that the device had begun when it agreed to the last one.
    begun: u64,
}

/// A motion that the device agreed to, and those before it whose replies were lost.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Span {
    /// False: the run has ended, and only motions without a reply are left.
    agreed: bool,
    /// Motions whose connection broke before the reply: each is executed once, or not at all.
    unknown: u64,
    /// The motions that the device has begun.
    executed: u64,
}

impl Motions {
    /// Called when the device has agreed to a motion, and has begun this many motions by now.
    pub fn agree(&mut self, begun: u64) {
        let executed = begun.saturating_sub(core::mem::replace(&mut self.begun, begun));
        self.spans.push(Span { agreed: true, unknown: core::mem::take(&mut self.unknown), executed });
    }

    /// Called when the connection broke before the reply to a motion.
    pub fn lose_reply(&mut self) {
        self.unknown += 1;
    }

    /// Returns the spans of all motions, if the device has begun this many motions.
    pub fn spans(&self, begun: u64) -> Vec<Span> {
        let Self { spans, unknown, begun: before } = self;
        let rest = Span { agreed: false, unknown: *unknown, executed: begun.saturating_sub(*before) };
        spans.iter().copied().chain([rest]).collect()
    }
}

impl Span {
    /// Returns whether exactly one motion was to be executed, and was executed.
    pub fn is_certain(&self) -> bool {
        (self.agreed, self.unknown, self.executed) == (true, 0, 1)
    }

    /// Returns the motions with one execution removed.
    #[must_use]
    pub fn without_one(self) -> Self {
        Self { executed: self.executed.saturating_sub(1), ..self }
    }

    /// Returns the motions with one more execution.
    #[must_use]
    pub fn with_one_more(self) -> Self {
        Self { executed: self.executed + 1, ..self }
    }

    /// Returns the counts of the motions as jobs.
    pub fn count(&self) -> Counts {
        let Self { agreed, unknown, executed } = *self;
        let agreed = u64::from(agreed);
        let sent = agreed + unknown;
        let lost = agreed.saturating_sub(executed);
        // A motion that was not sent is a repetition of another one.
        let repeated = executed.saturating_sub(sent).min(sent.max(1));
        Counts {
            sent: sent.max(repeated),
            lost,
            repeated,
            executed_once: executed.min(sent).saturating_sub(repeated),
            unknown,
            unknown_executed: executed.min(sent).saturating_sub(agreed),
            ..Counts::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_motion_whose_reply_was_lost_does_not_hide_another() {
        let mut motions = Motions::default();
        motions.agree(1);
        motions.lose_reply(); // executed
        motions.agree(3);
        motions.agree(3); // lost
        motions.lose_reply(); // not executed
        motions.agree(4);
        motions.agree(6); // twice
        motions.lose_reply(); // executed, and the last
        let spans = motions.spans(7);
        let total = spans.iter().fold(Counts::default(), |all, span| all + span.count());
        let expected = Counts {
            sent: 8,
            executed_once: 5,
            lost: 1,
            repeated: 1,
            unknown: 3,
            unknown_executed: 2,
            ..Counts::default()
        };
        assert_eq!(total, expected);
        let certain: Vec<bool> = spans.iter().map(Span::is_certain).collect();
        assert_eq!(certain, [true, false, false, false, false, false]);
    }
}
