//! The host's machine: when it polls, which packet is the reply, and until when values may be used. No bytes, no clock.
//!
//! Packets have no number, and of a packet's values it is only known that they are newer than those of the reply before. So
//! a packet is the reply to the last poll if it comes within the time that the line takes and the longest delay; and its
//! values are proved not to be older than [`max_age`](HostConfig::max_age) if the poll of the reply before is not.
//!
//! A ball that is late by whole periods would seem to answer a later poll each time. Its first packets are missed, so the
//! next polls are farther apart than the others. Its packets follow the spacing of the polls, and so do not stay within the
//! times of replies.
//!
//! As the model has explored it:
#![doc = include_str!("../../diagrams/host.md")]

use core::time::Duration;

use robot_session::Unexpected;
use robot_session::end::{Expiry, Machine, is_due};

use super::config::{HostConfig, Rule};

/// The state of a host. Every time is a deadline.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum HostMachine {
    /// There is no connection.
    Disconnected,
    /// There is a connection, and the ball is polled.
    Connected(PollingState),
}

/// The state during a connection.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct PollingState {
    /// The state of the last poll, and the time of the next one.
    pub poll: Poll,
    /// The values of the last packet that was reported as new.
    pub values: Values,
    /// The time until which the next new values are proved not to be too old: the poll that the last reply answered,
    /// plus the longest age.
    pub proof_until: Duration,
}

/// The poll.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Poll {
    /// No reply is awaited.
    Idle {
        /// The time at which the next poll is due.
        due: Duration,
    },
    /// A poll was sent, and its reply is awaited.
    Waiting {
        /// The time from which a packet can be the reply.
        from: Duration,
        /// The time until which a packet can be the reply.
        until: Duration,
        /// The time at which the next poll is due.
        due: Duration,
        /// The time until which this poll's reply proves that the values after it are not too old.
        proof_until: Duration,
    },
}

/// The values of the last packet that was reported as new.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Values {
    /// The values are too old, or there were no values.
    Stale,
    /// The values may be used.
    Live {
        /// The time until which the values may be used.
        until: Duration,
    },
}

/// An input of the host.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Input {
    /// The port is open, perhaps again.
    Connected,
    /// The port is closed or lost.
    Disconnected,
    /// Time has passed: each timeout handles one expired deadline.
    Timeout,
    /// The poll that was due is sent.
    Sent,
    /// A good packet has come.
    Packet {
        /// Whether the ball marks the values as new.
        fresh: bool,
    },
}

/// A poll of the host: ENQ.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Enquiry;

/// An action of the host.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Action {
    /// The session has nothing to do.
    Nothing,
    /// Counts a poll that was sent.
    Sent,
    /// Reports the packet as the reply, its values to be used.
    New,
    /// Reports the packet as the reply, its values not to be used.
    Old,
    /// Reports that the packet is not a reply.
    Unasked,
    /// Reports that the poll had no reply.
    Missed,
    /// Reports that the values are too old.
    Stale,
    /// Reports the poll and the values that the connection's end has ended.
    Closed {
        /// Whether the poll has no reply.
        missed: bool,
        /// Whether the values are not to be used any more.
        stale: bool,
    },
}

impl Machine for HostMachine {
    const END: &'static str = "host";
    const EXPIRY: Expiry = Expiry::First;
    type Input = Input;
    type Action = Action;
    type Transmit = Enquiry;
    type Config = HostConfig;

    /// # Errors
    /// A packet without a connection, a poll that is not due.
    #[inline(always)] // where the input is known, little of it is left
    fn on(&mut self, now: Duration, input: Input, config: &HostConfig) -> Result<Action, Unexpected> {
        match (&mut *self, input) {
            (_, Input::Connected) => {
                Ok(self.close(Self::Connected(PollingState::begin(now, config)), config))
            }
            (_, Input::Disconnected) => Ok(self.close(Self::Disconnected, config)),
            (Self::Disconnected, Input::Timeout) => Ok(Action::Nothing),
            (Self::Connected(polling), Input::Timeout) => Ok(polling.expire(now, config)),
            (Self::Connected(polling), Input::Sent) if polling.transmits(now) => {
                Ok(polling.sent(now, config))
            }
            (Self::Connected(polling), Input::Packet { fresh }) => Ok(polling.packet(now, fresh, config)),
            (Self::Connected(_), Input::Sent) | (Self::Disconnected, Input::Sent | Input::Packet { .. }) => {
                Err(self.unexpected(&input))
            }
        }
    }

    fn transmit(&self, now: Duration, _config: &HostConfig) -> Option<Enquiry> {
        match self {
            Self::Disconnected => None,
            Self::Connected(polling) => polling.transmits(now).then_some(Enquiry),
        }
    }

    fn deadline(&self) -> Option<Duration> {
        let Self::Connected(polling) = self else { return None };
        let (Poll::Idle { due: poll } | Poll::Waiting { until: poll, .. }) = polling.poll;
        let next = match polling.values {
            Values::Live { until } => poll.min(until),
            Values::Stale => poll,
        };
        (next < Duration::MAX).then_some(next)
    }

    fn expires(&self, now: Duration) -> bool {
        match self {
            Self::Disconnected => false,
            Self::Connected(polling) => polling.expires(now),
        }
    }

    fn each_time(&mut self, mut f: impl FnMut(&mut Duration)) {
        let Self::Connected(polling) = self else { return };
        match &mut polling.poll {
            Poll::Idle { due } => f(due),
            Poll::Waiting { from, until, due, proof_until } => {
                [from, until, due, proof_until].into_iter().for_each(&mut f);
            }
        }
        if let Values::Live { until } = &mut polling.values {
            f(until);
        }
        f(&mut polling.proof_until);
    }

    fn name(&self) -> &'static str {
        let Self::Connected(polling) = self else { return "Disconnected" };
        match (polling.poll, polling.values) {
            (Poll::Idle { .. }, Values::Stale) => "IdleStale",
            (Poll::Idle { .. }, Values::Live { .. }) => "IdleLive",
            (Poll::Waiting { .. }, Values::Stale) => "WaitingStale",
            (Poll::Waiting { .. }, Values::Live { .. }) => "WaitingLive",
        }
    }
}

impl HostMachine {
    /// Returns the time until which the values of the last packet reported as new may be used; `None` if they are
    /// stale.
    pub fn live_until(&self) -> Option<Duration> {
        match self {
            Self::Connected(PollingState { values: Values::Live { until }, .. }) => Some(*until),
            Self::Connected(PollingState { values: Values::Stale, .. }) | Self::Disconnected => None,
        }
    }

    /// Goes to a state without the previous poll and values.
    fn close(&mut self, mut to: Self, config: &HostConfig) -> Action {
        let Self::Connected(was) = *self else {
            *self = to;
            return Action::Nothing;
        };
        if let (Self::Connected(polling), false) = (&mut to, config.keeps(Rule::ForgetReply)) {
            polling.proof_until = was.proof_until;
        }
        *self = to;
        let missed = matches!(was.poll, Poll::Waiting { .. });
        let stale = matches!(was.values, Values::Live { .. });
        if (missed || stale) && config.keeps(Rule::ReportEnd) {
            Action::Closed { missed, stale }
        } else {
            Action::Nothing
        }
    }
}

impl PollingState {
    fn begin(now: Duration, config: &HostConfig) -> Self {
        let drain = if config.keeps(Rule::DrainFirst) { config.quiet() } else { Duration::ZERO };
        Self {
            poll: Poll::Idle { due: now.saturating_add(drain) },
            values: Values::Stale,
            proof_until: Duration::ZERO,
        }
    }

    fn transmits(&self, now: Duration) -> bool {
        matches!(self.poll, Poll::Idle { due } if is_due(due, now))
    }

    fn sent(&mut self, now: Duration, config: &HostConfig) -> Action {
        let due = now.saturating_add(config.period);
        let until = now.saturating_add(config.reply_window());
        self.poll = Poll::Waiting {
            from: now.saturating_add(config.earliest_reply()),
            until: if config.keeps(Rule::AwaitReply) { until } else { until.min(due) },
            due,
            proof_until: now.saturating_add(config.max_age),
        };
        Action::Sent
    }

    fn packet(&mut self, now: Duration, fresh: bool, config: &HostConfig) -> Action {
        let Poll::Waiting { from, until, due, proof_until } = self.poll else { return Action::Unasked };
        let is_early = now < from && config.keeps(Rule::NotBefore);
        let is_late = is_due(until, now);
        if is_early || is_late {
            return Action::Unasked;
        }
        let proved = if config.keeps(Rule::ProveAge) { self.proof_until } else { proof_until };
        self.poll = Poll::Idle { due };
        self.proof_until = proof_until;
        if (!fresh && config.keeps(Rule::OldIsNotNew)) || is_due(proved, now) {
            return Action::Old;
        }
        let until = if config.keeps(Rule::AgeFromPoll) { proved } else { now.saturating_add(config.max_age) };
        self.values = Values::Live { until };
        Action::New
    }

    fn expires(&self, now: Duration) -> bool {
        matches!(self.poll, Poll::Waiting { until, .. } if is_due(until, now))
            || matches!(self.values, Values::Live { until } if is_due(until, now))
    }

    fn expire(&mut self, now: Duration, config: &HostConfig) -> Action {
        match (self.poll, self.values) {
            (Poll::Waiting { until, due, .. }, _) if is_due(until, now) => {
                let uneven = config.keeps(Rule::Uneven);
                let due = if uneven { due.max(now).saturating_add(config.spread()) } else { due };
                self.poll = Poll::Idle { due };
                Action::Missed
            }
            (_, Values::Live { until }) if is_due(until, now) => {
                self.values = Values::Stale;
                Action::Stale
            }
            (Poll::Waiting { .. } | Poll::Idle { .. }, Values::Live { .. } | Values::Stale) => {
                Action::Nothing
            }
        }
    }
}

robot_session::inputs!(Input: Sent, Packet { fresh: true } as "Packet(fresh)", Packet { fresh: false } as "Packet(old)");
