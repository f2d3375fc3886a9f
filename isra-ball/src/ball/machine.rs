//! The ball's machine: whether a poll is to be answered, and whether its values are new. No bytes, no clock, no deadlines.
//!
//! As the model has explored it:
#![doc = include_str!("../../diagrams/ball.md")]

use core::time::Duration;

use robot_session::Unexpected;
use robot_session::end::{Expiry, Machine};

use super::config::{BallConfig, Rule};

/// The state of a ball.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct BallMachine {
    /// The connection, and the poll on it.
    pub link: Link,
    /// Whether the sensor has new values.
    pub values: Values,
}

/// The line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Link {
    /// There is no connection.
    Disconnected,
    /// No reply is requested.
    Ready,
    /// A reply is to be sent.
    Replying,
}

/// The values of the sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Values {
    /// The values were sent before, or none were measured.
    Old,
    /// The values were measured since the last reply.
    New,
}

/// An input of the ball.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Input {
    /// The port is open, perhaps again.
    Connected,
    /// The port is closed or lost.
    Disconnected,
    /// Time has passed: nothing comes due.
    Timeout,
    /// The sensor has new values.
    Measured,
    /// The host has sent ENQ: it polls.
    Enquiry,
    /// The reply that was due is sent.
    Sent,
}

/// A reply of the ball with its values.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Reply {
    /// Whether the values are new.
    pub fresh: bool,
}

/// An action of the ball.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Action {
    /// The session has nothing to do.
    Nothing,
    /// Reports a poll that does not get a reply of its own.
    Ignore,
    /// Reports the values that were sent.
    Sent {
        /// Whether the values are new.
        fresh: bool,
    },
}

impl BallMachine {
    /// A ball that has measured nothing, without a connection.
    pub const NEW: Self = Self { link: Link::Disconnected, values: Values::Old };

    fn go(&mut self, link: Link) -> Action {
        self.link = link;
        Action::Nothing
    }
}

impl Machine for BallMachine {
    const END: &'static str = "ball";
    const EXPIRY: Expiry = Expiry::First;
    type Input = Input;
    type Action = Action;
    type Transmit = Reply;
    type Config = BallConfig;

    /// # Errors
    /// A poll without a connection, an unsolicited reply.
    fn on(&mut self, _now: Duration, input: Input, config: &BallConfig) -> Result<Action, Unexpected> {
        match (self.link, input) {
            (Link::Disconnected | Link::Ready | Link::Replying, Input::Timeout) => Ok(Action::Nothing),
            (Link::Replying, Input::Connected | Input::Disconnected) if !config.keeps(Rule::ForgetPoll) => {
                Ok(Action::Nothing)
            }
            (_, Input::Connected) => Ok(self.go(Link::Ready)),
            (_, Input::Disconnected) => Ok(self.go(Link::Disconnected)),
            (_, Input::Measured) => {
                self.values = Values::New;
                Ok(Action::Nothing)
            }
            (Link::Ready, Input::Enquiry) => Ok(self.go(Link::Replying)),
            (Link::Replying, Input::Enquiry) => Ok(Action::Ignore),
            (Link::Replying, Input::Sent) => {
                let fresh = self.values == Values::New;
                self.link = Link::Ready;
                if config.keeps(Rule::MarkOld) {
                    self.values = Values::Old;
                }
                Ok(Action::Sent { fresh })
            }
            (Link::Disconnected, Input::Enquiry) | (Link::Disconnected | Link::Ready, Input::Sent) => {
                Err(self.unexpected(&input))
            }
        }
    }

    fn transmit(&self, _now: Duration, _config: &BallConfig) -> Option<Reply> {
        (self.link == Link::Replying).then_some(Reply { fresh: self.values == Values::New })
    }

    /// Returns `None`: the ball waits for ENQ without a timeout.
    fn deadline(&self) -> Option<Duration> {
        None
    }

    fn expires(&self, _now: Duration) -> bool {
        false
    }

    fn each_time(&mut self, _f: impl FnMut(&mut Duration)) {}

    fn name(&self) -> &'static str {
        match (self.link, self.values) {
            (Link::Disconnected, Values::Old) => "DisconnectedOld",
            (Link::Disconnected, Values::New) => "DisconnectedNew",
            (Link::Ready, Values::Old) => "ReadyOld",
            (Link::Ready, Values::New) => "ReadyNew",
            (Link::Replying, Values::Old) => "ReplyingOld",
            (Link::Replying, Values::New) => "ReplyingNew",
        }
    }
}

robot_session::inputs!(Input: Measured, Enquiry, Sent);
