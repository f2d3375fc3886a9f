//! The host's machine: which request is under way, and until when its reply may come. No bytes, no clock.

use core::time::Duration;

use robot_session::Unexpected;
use robot_session::end::{Expiry, Machine, is_due};

use super::config::{HostConfig, Rule};

/// The state of a host. Every time is a deadline.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum HostMachine {
    /// No connection.
    Disconnected,
    /// No request is open.
    Idle,
    /// A request is to be sent.
    Asking {
        /// The requested register.
        register: u8,
    },
    /// The reply is awaited.
    Waiting {
        /// The requested register.
        register: u8,
        /// The deadline of the reply.
        until: Duration,
    },
}

/// An input of the host.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Input {
    /// The connection was made, perhaps again.
    Connected,
    /// The connection is lost or closed.
    Disconnected,
    /// Time has passed.
    Timeout,
    /// The caller requests a register.
    Get {
        /// The requested register.
        register: u8,
    },
    /// The request that was due is sent.
    Sent,
    /// The value of a register has come.
    Value {
        /// The register.
        register: u8,
    },
}

/// A request of the host.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Request {
    /// The requested register.
    pub register: u8,
}

/// An action of the host.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Action {
    /// Nothing.
    Nothing,
    /// Counts a request.
    Sent,
    /// Reports the value as the reply.
    Report {
        /// The register.
        register: u8,
    },
    /// Reports that the value is not a reply.
    Unasked {
        /// The register.
        register: u8,
    },
    /// Reports that the request has no reply.
    TimedOut {
        /// The requested register.
        register: u8,
    },
}

impl Machine for HostMachine {
    const END: &'static str = "host";
    const EXPIRY: Expiry = Expiry::First;
    type Input = Input;
    type Action = Action;
    type Transmit = Request;
    type Config = HostConfig;

    /// # Errors
    /// A request while there is no connection or another one is under way, a line without a connection.
    fn on(&mut self, now: Duration, input: Input, config: &HostConfig) -> Result<Action, Unexpected> {
        match (*self, input) {
            (_, Input::Connected) => Ok(self.close(Self::Idle)),
            (_, Input::Disconnected) => Ok(self.close(Self::Disconnected)),
            (Self::Waiting { until, .. }, Input::Timeout) if is_due(until, now) => Ok(self.close(Self::Idle)),
            (_, Input::Timeout) => Ok(Action::Nothing),
            (Self::Idle, Input::Get { register }) => {
                *self = Self::Asking { register };
                Ok(Action::Nothing)
            }
            (Self::Asking { register }, Input::Sent) => {
                *self = Self::Waiting { register, until: now.saturating_add(config.timeout) };
                Ok(Action::Sent)
            }
            (Self::Waiting { register, .. }, Input::Value { register: found })
                if found == register || !config.keeps(Rule::MatchRegister) =>
            {
                *self = Self::Idle;
                Ok(Action::Report { register: found })
            }
            (Self::Idle | Self::Asking { .. } | Self::Waiting { .. }, Input::Value { register }) => {
                Ok(Action::Unasked { register })
            }
            (Self::Disconnected | Self::Asking { .. } | Self::Waiting { .. }, Input::Get { .. })
            | (Self::Disconnected, Input::Value { .. })
            | (Self::Disconnected | Self::Idle | Self::Waiting { .. }, Input::Sent) => {
                Err(self.unexpected(&input))
            }
        }
    }

    fn transmit(&self, _now: Duration, _config: &HostConfig) -> Option<Request> {
        match *self {
            Self::Asking { register } => Some(Request { register }),
            Self::Disconnected | Self::Idle | Self::Waiting { .. } => None,
        }
    }

    fn deadline(&self) -> Option<Duration> {
        match *self {
            Self::Waiting { until, .. } if until < Duration::MAX => Some(until),
            _ => None,
        }
    }

    fn expires(&self, now: Duration) -> bool {
        matches!(*self, Self::Waiting { until, .. } if is_due(until, now))
    }

    fn each_time(&mut self, mut f: impl FnMut(&mut Duration)) {
        if let Self::Waiting { until, .. } = self {
            f(until);
        }
    }

    fn name(&self) -> &'static str {
        match self {
            Self::Disconnected => "Disconnected",
            Self::Idle => "Idle",
            Self::Asking { .. } => "Asking",
            Self::Waiting { .. } => "Waiting",
        }
    }
}

impl HostMachine {
    /// Goes to a state without a request.
    fn close(&mut self, to: Self) -> Action {
        match core::mem::replace(self, to) {
            Self::Asking { register } | Self::Waiting { register, .. } => Action::TimedOut { register },
            Self::Disconnected | Self::Idle => Action::Nothing,
        }
    }
}

robot_session::inputs!(Input: Get, Sent, Value);
