//! The host's machine: whether a request is to be answered, when, and whether there is a pose to answer it with. No bytes, no
//! clock.
//!
//! As the model has explored it:
#![doc = include_str!("../../diagrams/host.md")]

use core::time::Duration;

use robot_session::Unexpected;

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
    Timer,
    /// The caller has a new pose.
    Pose,
    /// ENQ has come.
    Enquiry,
    /// A packet that [is to be sent](HostMachine::transmits) can be sent.
    Answer,
}

/// What the host does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Action {
    /// Nothing.
    None,
    /// Reports a request.
    Accept,
    /// Reports a request that has no packet of its own.
    Ignore,
    /// Sends the newest pose.
    Transmit,
    /// Reports that the pose is too old.
    Stale,
}

impl HostMachine {
    /// A host that knows no pose, without a connection.
    pub const NEW: Self = Self { link: Link::Disconnected, pose: Pose::Unknown };

    /// Moves the machine.
    ///
    /// # Errors
    /// A request without a connection, a packet that is not to be sent. Nothing has changed then.
    pub fn on(&mut self, now: Duration, input: Input, config: &HostConfig) -> Result<Action, Unexpected> {
        match (self.link, input) {
            (link, Input::Connected) => {
                let interval = if config.keeps(Rule::DrainFirst) { config.interval } else { Duration::ZERO };
                let from = now.saturating_add(interval);
                let is_kept = matches!(link, Link::Asked { .. }) && !config.keeps(Rule::ForgetRequest);
                self.link = if is_kept { Link::Asked { from } } else { Link::Ready { from } };
                Ok(Action::None)
            }
            (Link::Asked { .. }, Input::Disconnected) if !config.keeps(Rule::ForgetRequest) => {
                Ok(Action::None)
            }
            (_, Input::Disconnected) => {
                self.link = Link::Disconnected;
                Ok(Action::None)
            }
            (_, Input::Timer) => Ok(self.expire(now)),
            (_, Input::Pose) => {
                let max_age = if config.keeps(Rule::Expire) { config.max_age } else { Duration::MAX };
                self.pose = Pose::Known { until: now.saturating_add(max_age) };
                Ok(Action::None)
            }
            (Link::Ready { from }, Input::Enquiry) => {
                self.link = Link::Asked { from };
                Ok(Action::Accept)
            }
            (Link::Asked { .. }, Input::Enquiry) => Ok(Action::Ignore),
            (Link::Asked { .. }, Input::Answer) if self.transmits(now) => {
                let interval = if config.keeps(Rule::Pace) { config.interval } else { Duration::ZERO };
                self.link = Link::Ready { from: now.saturating_add(interval) };
                Ok(Action::Transmit)
            }
            (Link::Disconnected, Input::Enquiry)
            | (Link::Disconnected | Link::Ready { .. } | Link::Asked { .. }, Input::Answer) => {
                Err(Unexpected { state: self.name(), input: input.name() })
            }
        }
    }

    /// Whether a packet is to be sent.
    pub fn transmits(&self, now: Duration) -> bool {
        match (self.link, self.pose) {
            (Link::Asked { from }, Pose::Known { until }) => is_due(from, now) && !is_due(until, now),
            (
                Link::Disconnected | Link::Ready { .. } | Link::Asked { .. },
                Pose::Unknown | Pose::Known { .. },
            ) => false,
        }
    }

    /// When [`Input::Timer`] or [`Input::Answer`] is to come.
    pub fn deadline(&self) -> Option<Duration> {
        let next = match (self.link, self.pose) {
            (_, Pose::Unknown) => return None,
            (Link::Asked { from }, Pose::Known { until }) => from.min(until),
            (Link::Disconnected | Link::Ready { .. }, Pose::Known { until }) => until,
        };
        (next < Duration::MAX).then_some(next)
    }

    /// Visits every time.
    pub fn each_time(&mut self, mut f: impl FnMut(&mut Duration)) {
        if let Link::Ready { from } | Link::Asked { from } = &mut self.link {
            f(from);
        }
        if let Pose::Known { until } = &mut self.pose {
            f(until);
        }
    }

    /// The state's name.
    pub fn name(&self) -> &'static str {
        match (self.link, self.pose) {
            (Link::Disconnected, Pose::Unknown) => "DisconnectedUnknown",
            (Link::Disconnected, Pose::Known { .. }) => "DisconnectedKnown",
            (Link::Ready { .. }, Pose::Unknown) => "ReadyUnknown",
            (Link::Ready { .. }, Pose::Known { .. }) => "ReadyKnown",
            (Link::Asked { .. }, Pose::Unknown) => "AskedUnknown",
            (Link::Asked { .. }, Pose::Known { .. }) => "AskedKnown",
        }
    }

    fn expire(&mut self, now: Duration) -> Action {
        match self.pose {
            Pose::Known { until } if is_due(until, now) => {
                self.pose = Pose::Unknown;
                Action::Stale
            }
            Pose::Known { .. } | Pose::Unknown => Action::None,
        }
    }
}

impl Input {
    /// The input's name.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Connected => "Connected",
            Self::Disconnected => "Disconnected",
            Self::Timer => "Timer",
            Self::Pose => "Pose",
            Self::Enquiry => "Enquiry",
            Self::Answer => "Answer",
        }
    }
}

/// `Duration::MAX` is never.
fn is_due(deadline: Duration, now: Duration) -> bool {
    now >= deadline && deadline < Duration::MAX
}
