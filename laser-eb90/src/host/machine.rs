//! Everything that the host decides, with all that it depends on.

use core::time::Duration;

use robot_session::Unexpected;

use super::config::{HostConfig, HostRule};
pub use super::link::{Batch, HostAction, HostLink, Outcome, Sent, Tries, UnknownReason};
use crate::words::{Class, Refusal};

/// The host's machine: one frame at a time, and the next only after the answer to the last (§3(5)).
///
/// Every time in it is a deadline, and is compared with now and nothing else.
///
#[doc = include_str!("../../diagrams/host.md")]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct HostMachine {
    /// The frame that was sent last.
    pub link: HostLink,
    /// The frame that is being filled; the first instruction begins it.
    pub next: Option<Batch>,
}

/// What happens to the host.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum HostInput {
    /// The line was opened.
    Connected,
    /// The line is gone.
    Disconnected,
    /// The caller adds an instruction to the next frame.
    Submit {
        /// Its number.
        ticket: u64,
        /// Its command word.
        word: u16,
        /// How the controller treats it.
        class: Class,
    },
    /// The caller takes back what is in the next frame.
    TakeBack,
    /// The frame that is [due](HostMachine::due) is put on the line.
    Transmit {
        /// The time that it takes there.
        line: Duration,
    },
    /// Its last byte has left the port.
    Transmitted,
    /// An answer.
    Answer {
        /// Its word.
        word: u16,
        /// What the word means as an error code.
        refusal: Option<Refusal>,
    },
    /// Bytes that are no answer.
    Corrupt,
    /// The time of [`HostMachine::deadline`] has come.
    Timeout,
    /// The caller goes on after a refusal or an unknown outcome.
    Resume,
}

/// Which frame is due.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Due {
    /// The next one.
    Next,
    /// The last one, again.
    Again,
}

impl HostMachine {
    /// A host without a connection that has sent nothing yet.
    pub const NEW: Self =
        Self { link: HostLink::Disconnected { quiet_until: Duration::ZERO, held: false }, next: None };

    /// Takes an input; returns what the host does.
    ///
    /// # Errors
    /// An input that the state does not allow: nothing has changed. Neither line nor controller can cause one.
    #[inline(always)] // where the input is known, little of it is left
    pub fn on(
        &mut self,
        now: Duration,
        input: HostInput,
        config: &HostConfig,
    ) -> Result<HostAction, Unexpected> {
        use {HostAction::Nothing, HostInput as On, HostLink as Is};
        let (link, action) = match (&self.link, input) {
            (link, On::Connected) => {
                let (quiet_until, held, action) = link.disconnect(now, config);
                let drain = if config.keeps(HostRule::DrainFirst) { config.drain() } else { Duration::ZERO };
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
            (link, On::Transmit { line }) => {
                let (batch, tries) = match (self.due(now), link, self.next) {
                    (Some(Due::Next), _, Some(next)) => (next, Tries::default()),
                    (Some(Due::Again), Is::Resending { batch, tries, .. }, _) => (*batch, *tries),
                    _ => return self.unexpected(input),
                };
                self.next = self.next.filter(|next| *next != batch);
                (
                    Is::Awaiting(Sent::new(batch, tries, now.saturating_add(line), config)),
                    HostAction::Transmit,
                )
            }
            (Is::Awaiting(sent), On::Transmitted) => (Is::Awaiting(sent.transmitted(now, config)), Nothing),
            (Is::Awaiting(sent), On::Answer { word, refusal }) => sent.answered(now, word, refusal, config),
            (Is::Awaiting(sent), On::Corrupt) => (Is::Awaiting(Sent { corrupt: true, ..*sent }), Nothing),
            (Is::Awaiting(sent), On::Timeout) if now >= sent.deadline => sent.overdue(now, config),
            (
                Is::Resending { batch, tries, not_before: until } | Is::AwaitingRest { batch, tries, until },
                On::Answer { word, refusal },
            ) => match refusal {
                _ if word == batch.word && config.keeps(HostRule::ConfirmLate) => batch.done(*tries, now),
                None => batch.other_word(word, (*until).max(now.saturating_add(config.settle))),
                // The same corruption is answered a second time.
                Some(_) => return Ok(Nothing),
            },
            (Is::AwaitingRest { batch, until, .. }, On::Timeout) if now >= *until => {
                batch.unknown(UnknownReason::PartialFrame, *until)
            }
            (Is::Idle { .. } | Is::Held { .. }, On::Answer { word, .. }) => {
                return Ok(HostAction::Unasked { word });
            }
            (Is::Held { quiet_until }, On::Resume) => (Is::Idle { quiet_until: *quiet_until }, Nothing),
            (Is::Disconnected { quiet_until, held: true }, On::Resume) => {
                (Is::Disconnected { quiet_until: *quiet_until, held: false }, Nothing)
            }
            (
                Is::Idle { .. } | Is::Resending { .. } | Is::AwaitingRest { .. } | Is::Held { .. },
                On::Corrupt | On::Timeout | On::Transmitted,
            )
            | (Is::Awaiting(_), On::Timeout)
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
            ) => return self.unexpected(input),
        };
        self.link = link;
        Ok(action)
    }

    /// When the host wants [`HostInput::Timeout`] or may send; `None` if only bytes or the caller can make something happen.
    pub fn deadline(&self) -> Option<Duration> {
        match self.link {
            HostLink::Disconnected { .. } | HostLink::Held { .. } => None,
            HostLink::Idle { quiet_until } => self.next.map(|_| quiet_until),
            HostLink::Awaiting(sent) => Some(sent.deadline),
            HostLink::Resending { not_before: at, .. } | HostLink::AwaitingRest { until: at, .. } => Some(at),
        }
    }

    /// The frame that is to be put on the line.
    pub fn due(&self, now: Duration) -> Option<Due> {
        match self.link {
            HostLink::Idle { quiet_until } if now >= quiet_until => self.next.map(|_| Due::Next),
            HostLink::Resending { not_before, .. } if now >= not_before => Some(Due::Again),
            HostLink::Disconnected { .. }
            | HostLink::Idle { .. }
            | HostLink::Awaiting(_)
            | HostLink::Resending { .. }
            | HostLink::AwaitingRest { .. }
            | HostLink::Held { .. } => None,
        }
    }

    /// Whether the next frame can take an instruction of this class: interpreted ones travel together, others alone (§3(6)).
    pub fn has_room(&self, class: Class, config: &HostConfig) -> bool {
        self.next.is_none_or(|next| {
            (next.class, class) == (Class::Interpreted, Class::Interpreted) && next.count < config.batch
        })
    }

    /// Every time in the machine: each is a deadline.
    pub fn each_time(&mut self, mut f: impl FnMut(&mut Duration)) {
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

    /// The state's name.
    pub const fn name(&self) -> &'static str {
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

    #[cold]
    const fn unexpected<T>(&self, input: HostInput) -> Result<T, Unexpected> {
        Err(Unexpected { state: self.name(), input: input.name() })
    }
}

impl HostInput {
    /// The input's name.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Connected => "Connected",
            Self::Disconnected => "Disconnected",
            Self::Submit { .. } => "Submit",
            Self::TakeBack => "TakeBack",
            Self::Transmit { .. } => "Transmit",
            Self::Transmitted => "Transmitted",
            Self::Answer { refusal: None, .. } => "Answer",
            Self::Answer { refusal: Some(_), .. } => "ErrorCode",
            Self::Corrupt => "Corrupt",
            Self::Timeout => "Timeout",
            Self::Resume => "Resume",
        }
    }
}
