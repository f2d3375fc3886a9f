//! Everything that the host decides, with all that it depends on.

use core::time::Duration;

use robot_session::Unexpected;
use robot_session::end::{Expiry, Machine, is_due};

use super::config::{HostConfig, Rule};
pub use super::link::{Action, Batch, DueFrame, FrameInFlight, HostLink, Outcome, SendCounts, UnknownReason};
use crate::words::{Class, Refusal};

/// The host's machine: one frame at a time, and the next only after the answer to the last (§3(5)).
///
/// Every time in the state is a deadline, which is compared with the current time alone.
///
#[doc = include_str!("../../diagrams/host.md")]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct HostMachine {
    /// The frame that was sent last.
    pub link: HostLink,
    /// The frame that is being filled; `None` before its first instruction.
    pub next: Option<Batch>,
}

/// An input of the host.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Input {
    /// The caller has opened the line.
    Connected,
    /// The caller reports that the line is gone.
    Disconnected,
    /// The caller adds an instruction to the next frame.
    Submit {
        /// The number of the instruction, from 0.
        ticket: u64,
        /// The command word of the instruction.
        word: u16,
        /// The controller's treatment of the instruction.
        class: Class,
    },
    /// The caller takes back the instructions of the next frame.
    TakeBack,
    /// The frame that was due is put on the line.
    Sent {
        /// The time that the bytes of the frame take on the line.
        line: Duration,
    },
    /// The last byte of the frame has left the port.
    Transmitted,
    /// A whole answer has come.
    Answer {
        /// The command word or error code of the answer.
        word: u16,
        /// The meaning of the word as an error code; `None` if it is not an error code.
        refusal: Option<Refusal>,
    },
    /// Bytes that are not an answer.
    Corrupt,
    /// A deadline may have passed.
    Timeout,
    /// The caller continues after a refusal or an unknown outcome.
    Resume,
}

impl Machine for HostMachine {
    const END: &'static str = "host";
    const EXPIRY: Expiry = Expiry::BeforeTransmit;
    type Input = Input;
    type Action = Action;
    type Transmit = DueFrame;
    type Config = HostConfig;

    /// # Errors
    /// An input that the state does not allow. Neither line nor controller can cause one.
    #[inline(always)] // where the input is known, little of it is left
    fn on(&mut self, now: Duration, input: Input, config: &HostConfig) -> Result<Action, Unexpected> {
        use {Action::Nothing, HostLink as Is, Input as On};
        let (link, action) = match (&self.link, input) {
            (link, On::Connected) => {
                let (quiet_until, held, action) = link.disconnect(now, config);
                let drain = if config.keeps(Rule::DrainFirst) { config.drain() } else { Duration::ZERO };
                let quiet_until = quiet_until.max(now.saturating_add(drain));
                (if held { Is::Held { quiet_until } } else { Is::Idle { quiet_until } }, action)
            }
            (link, On::Disconnected) => {
                let (quiet_until, held, action) = link.disconnect(now, config);
                (Is::Disconnected { quiet_until, held }, action)
            }
            (_, On::Submit { ticket, word, class }) if self.has_room(class, config) => {
                let next = self.next.unwrap_or(Batch { first: ticket, count: 0, word, class });
                self.next = Some(Batch { count: next.count.saturating_add(1), ..next });
                return Ok(Nothing);
            }
            (_, On::TakeBack) => {
                self.next = None;
                return Ok(Nothing);
            }
            (link, On::Sent { line }) => {
                let (due, batch, tries) = match (self.due(now), link, self.next) {
                    (Some(due @ DueFrame::Next), _, Some(next)) => (due, next, SendCounts::default()),
                    (Some(due @ DueFrame::Again), Is::Resending { batch, tries, .. }, _) => {
                        (due, *batch, *tries)
                    }
                    _ => return Err(self.unexpected(&input)),
                };
                self.next = self.next.filter(|next| *next != batch);
                let sent = FrameInFlight::new(batch, tries, now.saturating_add(line), config);
                (Is::Awaiting(sent), Action::Sent(due))
            }
            (Is::Awaiting(sent), On::Transmitted) => (Is::Awaiting(sent.transmitted(now, config)), Nothing),
            (Is::Awaiting(sent), On::Answer { word, refusal }) => sent.answered(now, word, refusal, config),
            (Is::Awaiting(sent), On::Corrupt) => {
                (Is::Awaiting(FrameInFlight { corrupt: true, ..*sent }), Nothing)
            }
            (Is::Awaiting(sent), On::Timeout) => sent.overdue(now, config),
            (
                Is::Resending { batch, tries, not_before: until } | Is::AwaitingRest { batch, tries, until },
                On::Answer { word, refusal },
            ) => match refusal {
                _ if word == batch.word && config.keeps(Rule::ConfirmLate) => batch.done(*tries, now),
                None => batch.other_word(word, (*until).max(now.saturating_add(config.settle))),
                // The same corruption is answered a second time.
                Some(_) => return Ok(Nothing),
            },
            (Is::AwaitingRest { batch, until, .. }, On::Timeout) => {
                batch.unknown(UnknownReason::PartialFrame, *until)
            }
            (Is::Idle { .. } | Is::Held { .. }, On::Answer { word, .. }) => {
                return Ok(Action::Unasked { word });
            }
            (Is::Held { quiet_until }, On::Resume) => (Is::Idle { quiet_until: *quiet_until }, Nothing),
            (Is::Disconnected { quiet_until, held: true }, On::Resume) => {
                (Is::Disconnected { quiet_until: *quiet_until, held: false }, Nothing)
            }
            (
                Is::Idle { .. } | Is::Resending { .. } | Is::AwaitingRest { .. } | Is::Held { .. },
                On::Corrupt | On::Timeout | On::Transmitted,
            )
            | (Is::Disconnected { .. }, On::Timeout | On::Transmitted) => return Ok(Nothing),
            (_, On::Submit { .. })
            | (Is::Disconnected { .. }, On::Answer { .. } | On::Corrupt)
            | (
                Is::Disconnected { held: false, .. }
                | Is::Idle { .. }
                | Is::Awaiting(_)
                | Is::Resending { .. }
                | Is::AwaitingRest { .. },
                On::Resume,
            ) => return Err(self.unexpected(&input)),
        };
        self.link = link;
        Ok(action)
    }

    fn transmit(&self, now: Duration, _config: &HostConfig) -> Option<DueFrame> {
        self.due(now)
    }

    fn deadline(&self) -> Option<Duration> {
        let deadline = match self.link {
            HostLink::Disconnected { .. } | HostLink::Held { .. } => None,
            HostLink::Idle { quiet_until } => self.next.map(|_| quiet_until),
            HostLink::Awaiting(sent) => Some(sent.deadline),
            HostLink::Resending { not_before: at, .. } | HostLink::AwaitingRest { until: at, .. } => Some(at),
        };
        deadline.filter(|at| *at < Duration::MAX)
    }

    fn expires(&self, now: Duration) -> bool {
        match self.link {
            HostLink::Awaiting(sent) => is_due(sent.deadline, now),
            HostLink::AwaitingRest { until, .. } => is_due(until, now),
            HostLink::Disconnected { .. }
            | HostLink::Idle { .. }
            | HostLink::Resending { .. }
            | HostLink::Held { .. } => false,
        }
    }

    /// Returns true while an answer is awaited: an incomplete answer shows that bytes came.
    fn cuts(&self) -> bool {
        matches!(self.link, HostLink::Awaiting(_))
    }

    fn each_time(&mut self, mut f: impl FnMut(&mut Duration)) {
        match &mut self.link {
            HostLink::Disconnected { quiet_until: at, .. }
            | HostLink::Idle { quiet_until: at }
            | HostLink::Held { quiet_until: at } => f(at),
            HostLink::Awaiting(sent) => {
                f(&mut sent.received_by);
                f(&mut sent.final_from);
                f(&mut sent.executed_by);
                f(&mut sent.deadline);
                sent.tries.full_until.iter_mut().for_each(f);
            }
            HostLink::Resending { tries, not_before: at, .. }
            | HostLink::AwaitingRest { tries, until: at, .. } => {
                f(at);
                tries.full_until.iter_mut().for_each(f);
            }
        }
    }

    fn name(&self) -> &'static str {
        match self.link {
            HostLink::Disconnected { held: false, .. } => "Disconnected",
            HostLink::Disconnected { held: true, .. } => "DisconnectedHeld",
            HostLink::Idle { .. } => "Idle",
            HostLink::Awaiting(_) => "Awaiting",
            HostLink::Resending { .. } => "Resending",
            HostLink::AwaitingRest { .. } => "AwaitingRest",
            HostLink::Held { .. } => "Held",
        }
    }
}

impl HostMachine {
    /// A host without a connection that has sent nothing yet.
    pub const NEW: Self =
        Self { link: HostLink::Disconnected { quiet_until: Duration::ZERO, held: false }, next: None };

    /// Returns whether an answer with this word belongs to the query that was sent last.
    pub fn is_asked(&self, word: u16) -> bool {
        match self.link {
            HostLink::Awaiting(FrameInFlight { batch, .. })
            | HostLink::Resending { batch, .. }
            | HostLink::AwaitingRest { batch, .. } => batch.class == Class::Query && batch.word == word,
            HostLink::Disconnected { .. } | HostLink::Idle { .. } | HostLink::Held { .. } => false,
        }
    }

    /// Returns whether a frame was sent whose answer may still come.
    pub const fn is_in_flight(&self) -> bool {
        matches!(
            self.link,
            HostLink::Awaiting(_) | HostLink::Resending { .. } | HostLink::AwaitingRest { .. }
        )
    }

    /// Returns whether the next frame can take an instruction of this class: interpreted ones share a frame, others alone
    /// (§3(6)).
    pub fn has_room(&self, class: Class, config: &HostConfig) -> bool {
        self.next.is_none_or(|next| {
            (next.class, class) == (Class::Interpreted, Class::Interpreted) && next.count < config.batch
        })
    }

    /// Returns the frame to put on the line.
    #[inline]
    fn due(&self, now: Duration) -> Option<DueFrame> {
        match self.link {
            HostLink::Idle { quiet_until } if is_due(quiet_until, now) => self.next.map(|_| DueFrame::Next),
            HostLink::Resending { not_before, .. } if is_due(not_before, now) => Some(DueFrame::Again),
            HostLink::Disconnected { .. }
            | HostLink::Idle { .. }
            | HostLink::Awaiting(_)
            | HostLink::Resending { .. }
            | HostLink::AwaitingRest { .. }
            | HostLink::Held { .. } => None,
        }
    }
}

robot_session::inputs!(
    Input: Submit, TakeBack, Sent, Transmitted,
    Answer { refusal: None } as "Answer", Answer { refusal: Some(_) } as "ErrorCode", Corrupt, Resume,
);
