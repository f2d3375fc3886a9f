//! The frame that was sent last: its state, and the effect of an answer to it, or of a missing answer.

use core::fmt;
use core::time::Duration;

use super::config::{HostConfig, Rule};
use crate::words::{Class, Refusal};

/// The state of the frame that was sent last.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum HostLink {
    /// There is no connection.
    Disconnected {
        /// The time before which nothing is sent, even on the next connection.
        quiet_until: Duration,
        /// Whether the caller must resume before anything is sent.
        held: bool,
    },
    /// No frame is in flight.
    Idle {
        /// The time before which nothing is sent.
        quiet_until: Duration,
    },
    /// A frame is in flight.
    Awaiting(FrameInFlight),
    /// An error code came, or nothing: the frame is sent again.
    Resending {
        /// The frame that is sent again.
        batch: Batch,
        /// The number of times that the frame was sent.
        tries: SendCounts,
        /// The time at which the line has settled, and the frame is sent.
        not_before: Duration,
    },
    /// An error code came that may refer to the first half of the frame alone: the frame is not sent again, but its echo may
    /// still come.
    AwaitingRest {
        /// The frame whose echo may come.
        batch: Batch,
        /// The number of times that the frame was sent.
        tries: SendCounts,
        /// The time after which the echo cannot come any more.
        until: Duration,
    },
    /// A frame was refused for good, or its outcome is unknown: nothing is sent until the caller resumes.
    Held {
        /// The time before which nothing is sent.
        quiet_until: Duration,
    },
}

/// A frame, apart from its bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Batch {
    /// The number of the first instruction, from 0.
    pub first: u64,
    /// The number of instructions, from 1.
    pub count: u8,
    /// The command word of the first instruction: the one that is answered (§3(6)).
    pub word: u16,
    /// The controller's treatment of the instructions.
    pub class: Class,
}

/// A frame in flight.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct FrameInFlight {
    /// The frame, apart from its bytes.
    pub batch: Batch,
    /// The number of times that the frame was sent before, and their results.
    pub tries: SendCounts,
    /// The time by which the last byte of the frame has certainly been received.
    pub received_by: Duration,
    /// The time from which an error code refers to the whole frame.
    pub final_from: Duration,
    /// The time by which the frame has certainly been executed, if it is executed before it is answered.
    pub executed_by: Duration,
    /// The time at which the answer is overdue.
    pub deadline: Duration,
    /// Whether corrupt bytes came since the frame was sent.
    pub corrupt: bool,
}

/// The number of times that a frame was sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct SendCounts {
    /// The number of resends, because of an error code or silence.
    pub resends: u8,
    /// The number of earlier transmissions that brought no answer.
    pub unanswered: u8,
    /// The time at which a full queue counts as a refusal; `None` as long as it was not full.
    pub full_until: Option<Duration>,
}

/// The frame that is due.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum DueFrame {
    /// The next frame, for the first time.
    Next,
    /// The last frame, again.
    Again,
}

/// An action of the host after an input.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Action {
    /// The session has nothing to do.
    Nothing,
    /// Counts the frame, and drops the bytes that came before: they are not an answer to it.
    Sent(DueFrame),
    /// Reports the outcome of a frame.
    Report(Batch, Outcome),
    /// Reports an answer to no frame in flight.
    Unasked {
        /// The command word or error code of the answer.
        word: u16,
    },
}

/// The outcome of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Outcome {
    /// The controller has echoed the command word.
    Done {
        /// The number of times that the frame was sent again.
        resends: u8,
        /// The number of earlier transmissions that brought no answer.
        unanswered: u8,
    },
    /// None of the frame's instructions was accepted.
    Refused(Refusal),
    /// The frame may have been accepted or not.
    Unknown(UnknownReason),
}

/// The reason that an outcome is unknown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum UnknownReason {
    /// No byte came before the answer was overdue.
    Silence,
    /// Bytes came, but no answer.
    Corrupt,
    /// The answer was another word than the command's.
    OtherWord {
        /// The command word that was sent.
        expected: u16,
        /// The word that came back.
        found: u16,
    },
    /// "Bad frame" came so early that it may refer to the first half of the frame alone, and no echo followed. See
    /// [`controller_drops_partial`](crate::HostConfig::controller_drops_partial).
    PartialFrame,
    /// The execution of an immediate instruction failed: it may have had effects.
    ExecutionFailed,
    /// The connection was lost first.
    Disconnected,
}

impl fmt::Display for UnknownReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match *self {
            Self::Silence => "no answer in time",
            Self::Corrupt => "the answer was corrupt",
            Self::OtherWord { expected, found } => {
                return write!(f, "the answer was word {found:04X}h instead of {expected:04X}h");
            }
            Self::PartialFrame => "the controller may have rejected only a part of the frame",
            Self::ExecutionFailed => "the execution failed, and may have had effects",
            Self::Disconnected => "the connection was lost",
        })
    }
}

impl HostLink {
    /// Returns the time before which nothing is sent on the next connection, whether it waits for the caller, and the
    /// report.
    pub(super) fn disconnect(self, now: Duration, config: &HostConfig) -> (Duration, bool, Action) {
        let lost = |batch| Action::Report(batch, Outcome::Unknown(UnknownReason::Disconnected));
        match self {
            Self::Disconnected { quiet_until, held } => (quiet_until, held, Action::Nothing),
            Self::Idle { quiet_until } => (quiet_until, false, Action::Nothing),
            Self::Held { quiet_until } => (quiet_until, true, Action::Nothing),
            Self::Awaiting(sent) => (sent.settled_if_taken(now, config), true, lost(sent.batch)),
            Self::Resending { batch, not_before: until, .. } | Self::AwaitingRest { batch, until, .. } => {
                (until, true, lost(batch))
            }
        }
    }
}

impl Batch {
    pub(super) const fn done(self, tries: SendCounts, now: Duration) -> (HostLink, Action) {
        let SendCounts { resends, unanswered, .. } = tries;
        let done = Outcome::Done { resends, unanswered };
        (HostLink::Idle { quiet_until: now }, Action::Report(self, done))
    }

    pub(super) const fn unknown(self, reason: UnknownReason, quiet_until: Duration) -> (HostLink, Action) {
        (HostLink::Held { quiet_until }, Action::Report(self, Outcome::Unknown(reason)))
    }

    pub(super) const fn other_word(self, found: u16, quiet_until: Duration) -> (HostLink, Action) {
        self.unknown(UnknownReason::OtherWord { expected: self.word, found }, quiet_until)
    }
}

impl FrameInFlight {
    /// Creates a frame whose last byte leaves the port at `left` if nothing pauses.
    pub(super) fn new(batch: Batch, tries: SendCounts, left: Duration, config: &HostConfig) -> Self {
        let sent = Self {
            batch,
            tries,
            received_by: left,
            final_from: left,
            executed_by: left,
            deadline: left,
            corrupt: false,
        };
        let received_by = left.saturating_add(config.max_pause);
        Self { deadline: sent.transmitted(left, config).deadline, ..sent.transmitted(received_by, config) }
    }

    /// Returns a frame whose last byte has left the port.
    pub(super) fn transmitted(self, now: Duration, config: &HostConfig) -> Self {
        Self {
            received_by: now,
            final_from: now.saturating_add(config.reply_time),
            executed_by: now.saturating_add(config.execution(self.batch.class)),
            deadline: now.saturating_add(config.timeout(self.batch.class)),
            ..self
        }
    }

    pub(super) fn answered(
        self,
        now: Duration,
        word: u16,
        refusal: Option<Refusal>,
        config: &HostConfig,
    ) -> (HostLink, Action) {
        match refusal {
            // No command word is an error code as well.
            Some(refusal) => self.refused(now, refusal, config),
            None if word == self.batch.word || !config.keeps(Rule::CompareWord) => {
                self.batch.done(self.tries, now)
            }
            None => self.batch.other_word(word, self.settled_if_taken(now, config)),
        }
    }

    fn refused(mut self, now: Duration, refusal: Refusal, config: &HostConfig) -> (HostLink, Action) {
        let Self { batch, .. } = self;
        if refusal == Refusal::BadFrame && now < self.final_from && !config.controller_drops_partial {
            let until = self.settled_if_taken(now, config);
            return (HostLink::AwaitingRest { batch, tries: self.tries, until }, Action::Nothing);
        }
        let settled = now.max(self.received_by).saturating_add(config.settle);
        let (again, not_before) = match refusal {
            Refusal::QueueFull => (self.may_be_full(now, config), now.saturating_add(config.backoff)),
            Refusal::BadChecksum | Refusal::BadFrame => (self.may_resend(config), settled),
            // The same again would be refused again, or executed again.
            Refusal::UnknownCommand | Refusal::BadBatch | Refusal::BadParameters => {
                (!config.keeps(Rule::FinalCodes) && self.may_resend(config), settled)
            }
        };
        if again {
            return (HostLink::Resending { batch, tries: self.tries, not_before }, Action::Nothing);
        }
        match refusal {
            // The error code refers to the last transmission alone.
            _ if self.tries.unanswered > 0 && config.keeps(Rule::UnansweredIsUnknown) => {
                batch.unknown(UnknownReason::Silence, settled)
            }
            Refusal::BadParameters
                if batch.class == Class::Immediate && config.keeps(Rule::FailedIsUnknown) =>
            {
                batch.unknown(UnknownReason::ExecutionFailed, settled)
            }
            _ => (HostLink::Held { quiet_until: settled }, Action::Report(batch, Outcome::Refused(refusal))),
        }
    }

    pub(super) fn overdue(mut self, now: Duration, config: &HostConfig) -> (HostLink, Action) {
        let settled = self.settled_if_taken(now, config);
        if config.resend_on_silence && self.may_resend(config) {
            self.tries.unanswered = self.tries.unanswered.saturating_add(1);
            let Self { batch, tries, .. } = self;
            return (HostLink::Resending { batch, tries, not_before: settled }, Action::Nothing);
        }
        let reason = if self.corrupt { UnknownReason::Corrupt } else { UnknownReason::Silence };
        self.batch.unknown(reason, settled)
    }

    fn may_resend(&mut self, config: &HostConfig) -> bool {
        let again = self.tries.resends < config.resends;
        self.tries.resends += u8::from(again);
        again
    }

    fn may_be_full(&mut self, now: Duration, config: &HostConfig) -> bool {
        now < *self.tries.full_until.get_or_insert(now.saturating_add(config.full_timeout))
    }

    /// Returns the time by which every effect of this transmission has come, if the controller has accepted the frame,
    /// or may accept it.
    fn settled_if_taken(&self, now: Duration, config: &HostConfig) -> Duration {
        let outlast = config.keeps(Rule::OutlastExecution);
        let over = if outlast { self.executed_by } else { self.received_by };
        now.max(over).saturating_add(config.settle)
    }
}
