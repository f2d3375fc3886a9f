//! The host's machine: whether a request is to be answered, when, and whether there is a pose to answer it with. No bytes, no
//! clock.
//!
//! As the model has explored it:
#![doc = include_str!("../../diagrams/host.md")]

use core::time::Duration;

use robot_session::Unexpected;
use robot_session::end::{Expiry, Machine, is_due};

use super::config::{HostConfig, Rule};
use crate::flow::Flow;

/// The state of a host. Every time is a deadline.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct HostMachine {
    /// The connection, and the requests on it.
    pub link: Link,
    /// The pose of the arm.
    pub pose: Pose,
    /// Whether the workstation holds the line: never without a connection.
    pub flow: Flow,
}

/// The line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Link {
    /// There is no connection.
    Disconnected,
    /// No reply is requested.
    Ready {
        /// The time from which a packet may be sent.
        from: Duration,
    },
    /// A packet is requested, once or more often.
    Asked {
        /// The time from which the packet may be sent.
        from: Duration,
    },
}

/// The pose of the arm.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Pose {
    /// No pose was set, or it is too old.
    Unknown,
    /// The pose may be sent.
    Known {
        /// The time until which the pose may be sent.
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
    /// A deadline may have passed.
    Timeout,
    /// The caller has a new pose.
    Pose,
    /// The workstation has sent ENQ: it requests a packet.
    Enquiry,
    /// The workstation has sent XOFF: it holds the line.
    Xoff,
    /// The workstation has sent XON: it releases the line.
    Xon,
    /// The packet that was due is sent.
    Sent,
    /// The packet cannot be sent on a line with XON and XOFF.
    Unsendable,
}

/// An answer of the host: the newest pose.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Answer;

/// An action of the host.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Action {
    /// The session has nothing to do.
    Nothing,
    /// Reports a request that will get a packet of its own.
    Accept,
    /// Reports a request that does not get a packet of its own.
    Ignore,
    /// Reports the packet that was sent.
    Sent,
    /// Reports the packet that cannot be sent.
    Unsendable,
    /// Reports that the pose is too old.
    Stale,
    /// Reports that no XON has come.
    HoldEnded,
}

impl HostMachine {
    /// A host without a pose and without a connection.
    pub const NEW: Self = Self { link: Link::Disconnected, pose: Pose::Unknown, flow: Flow::Free };

    fn transmits(&self, now: Duration) -> bool {
        match (self.link, self.pose) {
            (Link::Asked { from }, Pose::Known { until }) => {
                self.flow == Flow::Free && is_due(from, now) && !is_due(until, now)
            }
            (
                Link::Disconnected | Link::Ready { .. } | Link::Asked { .. },
                Pose::Unknown | Pose::Known { .. },
            ) => false,
        }
    }

    fn expire(&mut self, now: Duration) -> Action {
        if matches!(self.pose, Pose::Known { until } if is_due(until, now)) {
            self.pose = Pose::Unknown;
            return Action::Stale;
        }
        if self.flow.is_over(now) {
            self.flow = Flow::Free;
            return Action::HoldEnded;
        }
        Action::Nothing
    }

    fn forget_hold(&mut self, config: &HostConfig) {
        if config.keeps(Rule::ForgetHold) {
            self.flow = Flow::Free;
        }
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
                self.forget_hold(config);
                let interval = if config.keeps(Rule::DrainFirst) { config.interval } else { Duration::ZERO };
                let from = now.saturating_add(interval);
                let is_kept = matches!(link, Link::Asked { .. }) && !config.keeps(Rule::ForgetRequest);
                self.link = if is_kept { Link::Asked { from } } else { Link::Ready { from } };
                Ok(Action::Nothing)
            }
            (Link::Asked { .. }, Input::Disconnected) if !config.keeps(Rule::ForgetRequest) => {
                Ok(Action::Nothing)
            }
            (_, Input::Disconnected) => {
                self.forget_hold(config);
                self.link = Link::Disconnected;
                Ok(Action::Nothing)
            }
            (_, Input::Timeout) => Ok(self.expire(now)),
            (_, Input::Pose) => {
                let max_age = if config.keeps(Rule::Expire) { config.max_age } else { Duration::MAX };
                self.pose = Pose::Known { until: now.saturating_add(max_age) };
                Ok(Action::Nothing)
            }
            (Link::Ready { from }, Input::Enquiry) => {
                self.link = Link::Asked { from };
                Ok(Action::Accept)
            }
            (Link::Asked { .. }, Input::Enquiry) => Ok(Action::Ignore),
            (Link::Ready { .. } | Link::Asked { .. }, Input::Xoff) => {
                let most = if config.keeps(Rule::EndHold) { config.max_hold } else { Duration::MAX };
                if config.keeps(Rule::Hold) {
                    self.flow.hold(now.saturating_add(most), config.keeps(Rule::Prolong));
                }
                Ok(Action::Nothing)
            }
            (Link::Ready { .. } | Link::Asked { .. }, Input::Xon) => {
                if config.keeps(Rule::Resume) {
                    self.flow = Flow::Free;
                }
                Ok(Action::Nothing)
            }
            (Link::Asked { .. }, Input::Sent | Input::Unsendable) if self.transmits(now) => {
                let interval = if config.keeps(Rule::Pace) { config.interval } else { Duration::ZERO };
                self.link = Link::Ready { from: now.saturating_add(interval) };
                Ok(if input == Input::Sent { Action::Sent } else { Action::Unsendable })
            }
            (Link::Disconnected, Input::Enquiry | Input::Xoff | Input::Xon)
            | (
                Link::Disconnected | Link::Ready { .. } | Link::Asked { .. },
                Input::Sent | Input::Unsendable,
            ) => Err(self.unexpected(&input)),
        }
    }

    fn transmit(&self, now: Duration, _config: &HostConfig) -> Option<Answer> {
        self.transmits(now).then_some(Answer)
    }

    fn deadline(&self) -> Option<Duration> {
        let next = match (self.link, self.pose) {
            (_, Pose::Unknown) => Duration::MAX,
            (Link::Asked { from }, Pose::Known { until }) if self.flow == Flow::Free => from.min(until),
            (Link::Disconnected | Link::Ready { .. } | Link::Asked { .. }, Pose::Known { until }) => until,
        };
        Some(next.min(self.flow.until())).filter(|next| *next < Duration::MAX)
    }

    fn expires(&self, now: Duration) -> bool {
        matches!(self.pose, Pose::Known { until } if is_due(until, now)) || self.flow.is_over(now)
    }

    fn each_time(&mut self, mut f: impl FnMut(&mut Duration)) {
        if let Link::Ready { from } | Link::Asked { from } = &mut self.link {
            f(from);
        }
        if let Pose::Known { until } = &mut self.pose {
            f(until);
        }
        if let Flow::Held { until } = &mut self.flow {
            f(until);
        }
    }

    /// Returns the state's name, which does not show whether XOFF stops the line.
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

robot_session::inputs!(Input: Pose, Enquiry, Xoff, Xon, Sent, Unsendable);
