//! The device's machine: whether a request is to be answered. No bytes, no clock, no deadlines.

use core::time::Duration;

use robot_session::Unexpected;
use robot_session::end::{Expiry, Machine};

use super::config::{DeviceConfig, Rule};

/// The state of a device.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum DeviceMachine {
    /// No connection.
    Disconnected,
    /// No request is open.
    Ready,
    /// The caller has the request.
    Asked {
        /// The requested register.
        register: u8,
    },
    /// The reply is to be sent.
    Replying {
        /// The register of the reply.
        register: u8,
    },
}

/// An input of the device.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Input {
    /// The connection was made, perhaps again.
    Connected,
    /// The connection is lost or closed.
    Disconnected,
    /// Time has passed: nothing comes due.
    Timeout,
    /// A request has come.
    Get {
        /// The requested register.
        register: u8,
    },
    /// The caller has given the value.
    Answered,
    /// The reply that was due is sent.
    Sent,
}

/// A reply of the device: the value that the caller has given.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Reply {
    /// The register.
    pub register: u8,
}

/// An action of the device.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Action {
    /// Nothing.
    Nothing,
    /// Reports a request.
    Ask {
        /// The requested register.
        register: u8,
    },
    /// Counts a reply.
    Sent,
}

impl Machine for DeviceMachine {
    const END: &'static str = "device";
    const EXPIRY: Expiry = Expiry::First;
    type Input = Input;
    type Action = Action;
    type Transmit = Reply;
    type Config = DeviceConfig;

    /// # Errors
    /// A request without a connection or before the reply to the last one, an unsolicited answer.
    fn on(&mut self, _now: Duration, input: Input, config: &DeviceConfig) -> Result<Action, Unexpected> {
        let (to, action) = match (*self, input) {
            (state, Input::Timeout) => (state, Action::Nothing),
            (state @ (Self::Asked { .. } | Self::Replying { .. }), Input::Connected)
                if !config.keeps(Rule::ForgetRequest) =>
            {
                (state, Action::Nothing)
            }
            (_, Input::Connected) => (Self::Ready, Action::Nothing),
            (_, Input::Disconnected) => (Self::Disconnected, Action::Nothing),
            (Self::Ready, Input::Get { register }) => (Self::Asked { register }, Action::Ask { register }),
            (Self::Asked { register }, Input::Answered) => (Self::Replying { register }, Action::Nothing),
            (Self::Replying { .. }, Input::Sent) => (Self::Ready, Action::Sent),
            (Self::Disconnected | Self::Asked { .. } | Self::Replying { .. }, Input::Get { .. })
            | (Self::Disconnected | Self::Ready | Self::Replying { .. }, Input::Answered)
            | (Self::Disconnected | Self::Ready | Self::Asked { .. }, Input::Sent) => {
                return Err(self.unexpected(&input));
            }
        };
        *self = to;
        Ok(action)
    }

    fn transmit(&self, _now: Duration, _config: &DeviceConfig) -> Option<Reply> {
        match *self {
            Self::Replying { register } => Some(Reply { register }),
            Self::Disconnected | Self::Ready | Self::Asked { .. } => None,
        }
    }

    /// Returns `None`: the device waits for a request without a timeout.
    fn deadline(&self) -> Option<Duration> {
        None
    }

    fn expires(&self, _now: Duration) -> bool {
        false
    }

    /// Returns false while a request is executed: the next requests wait.
    fn reads(&self) -> bool {
        !matches!(self, Self::Asked { .. } | Self::Replying { .. })
    }

    fn each_time(&mut self, _f: impl FnMut(&mut Duration)) {}

    fn name(&self) -> &'static str {
        match self {
            Self::Disconnected => "Disconnected",
            Self::Ready => "Ready",
            Self::Asked { .. } => "Asked",
            Self::Replying { .. } => "Replying",
        }
    }
}

robot_session::inputs!(Input: Get, Answered, Sent);
