//! The host's machine: whether a request is to be answered, when, and whether there is a pose to answer it with. No bytes, no
//! clock.
//!
//! As the model has explored it:
#![doc = include_str!("../../diagrams/host.md")]

use core::time::Duration;

use robot_session::{Expiry, Machine, Unexpected, is_due};

use super::config::{HostConfig, Rule};

/// The state of a host. Every time is a deadline.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct HostMachine {
    /// The line.
    pub link: Link,
    /// The pose of the arm.
    pub pose: Pose,
}

/// The line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Link {
    /// No connection.
    Disconnected,
    /// Nothing is asked for.
    Ready {
        /// From when on a packet may be sent.
        from: Duration,
    },
    /// A packet is asked for, once or more often.
    Asked {
        /// From when on it may be sent.
        from: Duration,
    },
}

/// The pose of the arm.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Pose {
    /// There was none, or it is too old.
    Unknown,
    /// It may be sent.
    Known {
        /// Until then.
        until: Duration,
    },
}

/// What happens to a host.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Input {
    /// The port is open, perhaps again.
    Connected,
    /// The port is closed or lost.
    Disconnected,
    /// Time has passed.
    Timeout,
    /// The caller has a new pose.
    Pose,
    /// ENQ has come.
    Enquiry,
    /// The packet that was due is sent.
    Sent,
}

/// What the host sends: the newest pose.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Answer;

/// What the host does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Action {
    /// Nothing.
    Nothing,
    /// Reports a request.
    Accept,
    /// Reports a request that has no packet of its own.
    Ignore,
    /// Reports the packet that was sent.
    Sent,
    /// Reports that the pose is too old.
    Stale,
}

impl HostMachine {
    /// A host that knows no pose, without a connection.
    pub const NEW: Self = Self { link: Link::Disconnected, pose: Pose::Unknown };

    fn transmits(&self, now: Duration) -> bool {
        match (self.link, self.pose) {
            (Link::Asked { from }, Pose::Known { until }) => is_due(from, now) && !is_due(until, now),
            (
                Link::Disconnected | Link::Ready { .. } | Link::Asked { .. },
                Pose::Unknown | Pose::Known { .. },
            ) => false,
        }
    }

    fn expire(&mut self, now: Duration) -> Action {
        if self.expires(now) {
            self.pose = Pose::Unknown;
            return Action::Stale;
        }
        Action::Nothing
    }
}

impl Machine for HostMachine {
    const END: &'static str = "host";
    const EXPIRY: Expiry = Expiry::First;
    type Input = Input;
    type Action = Action;
    type Transmit = Answer;
    type Config = HostConfig;

    /// # Errors
    /// A request without a connection, a packet that is not due.
    fn on(&mut self, now: Duration, input: Input, config: &HostConfig) -> Result<Action, Unexpected> {
        match (self.link, input) {
            (link, Input::Connected) => {
                let interval =
                    if config.rules.keeps(Rule::DrainFirst) { config.interval } else { Duration::ZERO };
                let from = now.saturating_add(interval);
                let is_kept = matches!(link, Link::Asked { .. }) && !config.rules.keeps(Rule::ForgetRequest);
                self.link = if is_kept { Link::Asked { from } } else { Link::Ready { from } };
                Ok(Action::Nothing)
            }
            (Link::Asked { .. }, Input::Disconnected) if !config.rules.keeps(Rule::ForgetRequest) => {
                Ok(Action::Nothing)
            }
            (_, Input::Disconnected) => {
                self.link = Link::Disconnected;
                Ok(Action::Nothing)
            }
            (_, Input::Timeout) => Ok(self.expire(now)),
            (_, Input::Pose) => {
                let max_age = if config.rules.keeps(Rule::Expire) { config.max_age } else { Duration::MAX };
                self.pose = Pose::Known { until: now.saturating_add(max_age) };
                Ok(Action::Nothing)
            }
            (Link::Ready { from }, Input::Enquiry) => {
                self.link = Link::Asked { from };
                Ok(Action::Accept)
            }
            (Link::Asked { .. }, Input::Enquiry) => Ok(Action::Ignore),
            (Link::Asked { .. }, Input::Sent) if self.transmits(now) => {
                let interval = if config.rules.keeps(Rule::Pace) { config.interval } else { Duration::ZERO };
                self.link = Link::Ready { from: now.saturating_add(interval) };
                Ok(Action::Sent)
            }
            (Link::Disconnected, Input::Enquiry)
            | (Link::Disconnected | Link::Ready { .. } | Link::Asked { .. }, Input::Sent) => {
                Err(self.unexpected(&input))
            }
        }
    }

    fn transmit(&self, now: Duration, _config: &HostConfig) -> Option<Answer> {
        self.transmits(now).then_some(Answer)
    }

    fn deadline(&self) -> Option<Duration> {
        let next = match (self.link, self.pose) {
            (_, Pose::Unknown) => return None,
            (Link::Asked { from }, Pose::Known { until }) => from.min(until),
            (Link::Disconnected | Link::Ready { .. }, Pose::Known { until }) => until,
        };
        (next < Duration::MAX).then_some(next)
    }

    fn expires(&self, now: Duration) -> bool {
        matches!(self.pose, Pose::Known { until } if is_due(until, now))
    }

    fn each_time(&mut self, mut f: impl FnMut(&mut Duration)) {
        if let Link::Ready { from } | Link::Asked { from } = &mut self.link {
            f(from);
        }
        if let Pose::Known { until } = &mut self.pose {
            f(until);
        }
    }

    fn name(&self) -> &'static str {
        match (self.link, self.pose) {
            (Link::Disconnected, Pose::Unknown) => "DisconnectedUnknown",
            (Link::Disconnected, Pose::Known { .. }) => "DisconnectedKnown",
            (Link::Ready { .. }, Pose::Unknown) => "ReadyUnknown",
            (Link::Ready { .. }, Pose::Known { .. }) => "ReadyKnown",
            (Link::Asked { .. }, Pose::Unknown) => "AskedUnknown",
            (Link::Asked { .. }, Pose::Known { .. }) => "AskedKnown",
        }
    }
}

robot_session::inputs!(Input: Pose, Enquiry, Sent);
