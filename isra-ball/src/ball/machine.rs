//! The ball's machine: whether a poll is to be answered, and whether its values are new. No bytes, no clock, no deadlines.
//!
//! As the model has explored it:
#![doc = include_str!("../../diagrams/ball.md")]

use core::time::Duration;

use robot_session::Unexpected;

use super::config::{BallConfig, Rule};

/// The state of a ball.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct BallMachine {
    /// The line.
    pub link: Link,
    /// The values of the sensor.
    pub values: Values,
}

/// The line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Link {
    /// No connection.
    Disconnected,
    /// Nothing is asked for.
    Ready,
    /// A reply is to be sent.
    Replying,
}

/// The values of the sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Values {
    /// Sent before, or none were measured.
    Old,
    /// Measured since the last reply.
    New,
}

/// What happens to a ball.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Input {
    /// The port is open, perhaps again.
    Connected,
    /// The port is closed or lost.
    Disconnected,
    /// The sensor has new values.
    Measured,
    /// ENQ has come.
    Enquiry,
    /// A reply that [is to be sent](BallMachine::transmits) can be sent.
    Reply,
}

/// What the ball does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Action {
    /// Nothing.
    None,
    /// Reports a poll that has no reply of its own.
    Ignore,
    /// Sends the values.
    Transmit {
        /// Whether they are new.
        fresh: bool,
    },
}

impl BallMachine {
    /// A ball that has measured nothing, without a connection.
    pub const NEW: Self = Self { link: Link::Disconnected, values: Values::Old };

    /// Moves the machine.
    ///
    /// # Errors
    /// A poll without a connection, a reply that nobody asked for. Nothing has changed then.
    pub fn on(&mut self, _now: Duration, input: Input, config: &BallConfig) -> Result<Action, Unexpected> {
        match (self.link, input) {
            (Link::Replying, Input::Connected) if !config.keeps(Rule::ForgetPoll) => Ok(Action::None),
            (_, Input::Connected) => Ok(self.go(Link::Ready)),
            (Link::Replying, Input::Disconnected) if !config.keeps(Rule::ForgetPoll) => Ok(Action::None),
            (_, Input::Disconnected) => Ok(self.go(Link::Disconnected)),
            (_, Input::Measured) => {
                self.values = Values::New;
                Ok(Action::None)
            }
            (Link::Ready, Input::Enquiry) => Ok(self.go(Link::Replying)),
            (Link::Replying, Input::Enquiry) => Ok(Action::Ignore),
            (Link::Replying, Input::Reply) => {
                self.link = Link::Ready;
                let fresh = self.values == Values::New;
                if config.keeps(Rule::MarkOld) {
                    self.values = Values::Old;
                }
                Ok(Action::Transmit { fresh })
            }
            (Link::Disconnected, Input::Enquiry) | (Link::Disconnected | Link::Ready, Input::Reply) => {
                Err(Unexpected { state: self.name(), input: input.name() })
            }
        }
    }

    /// Whether a reply is to be sent.
    pub fn transmits(&self) -> bool {
        self.link == Link::Replying
    }

    /// Never: the ball waits for ENQ.
    pub fn deadline(&self) -> Option<Duration> {
        None
    }

    /// Visits every time: there is none.
    pub fn each_time(&mut self, _f: impl FnMut(&mut Duration)) {}

    /// The state's name.
    pub fn name(&self) -> &'static str {
        match (self.link, self.values) {
            (Link::Disconnected, Values::Old) => "DisconnectedOld",
            (Link::Disconnected, Values::New) => "DisconnectedNew",
            (Link::Ready, Values::Old) => "ReadyOld",
            (Link::Ready, Values::New) => "ReadyNew",
            (Link::Replying, Values::Old) => "ReplyingOld",
            (Link::Replying, Values::New) => "ReplyingNew",
        }
    }

    fn go(&mut self, link: Link) -> Action {
        self.link = link;
        Action::None
    }
}

impl Input {
    /// The input's name.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Connected => "Connected",
            Self::Disconnected => "Disconnected",
            Self::Measured => "Measured",
            Self::Enquiry => "Enquiry",
            Self::Reply => "Reply",
        }
    }
}
