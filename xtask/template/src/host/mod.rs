//! The host, which asks.

mod config;
pub mod machine;

use core::time::Duration;

use robot_session::end::{Core, CoreOf, End, EventQueue, QueueSpace};
use robot_session::{Decoder as _, Encode as _, Session as _, Unexpected};

pub use config::HostConfig;
#[doc(hidden)]
pub use config::Rule;

use crate::decoder::Decoder;
use crate::error::{ConfigError, DecodeError, SessionError};
use crate::message::Message;
use machine::{Action, HostMachine, Input, Request};

/// The host: one request at a time, each with one outcome.
///
/// The order of calls is the [`Session`](robot_session::Session)'s.
#[derive(Debug, Clone)]
pub struct Host {
    core: CoreOf<Self>,
}

/// The events of the host.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "event", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum HostEvent {
    /// The reply to the request.
    Value {
        /// The register.
        register: u8,
        /// The value of the register.
        value: i32,
    },
    /// No reply came in time, or the connection was lost.
    TimedOut {
        /// The requested register.
        register: u8,
    },
    /// A notice: a value that is not a reply.
    Unasked {
        /// The register.
        register: u8,
        /// The value of the register.
        value: i32,
    },
    /// A notice: corrupt bytes.
    #[cfg_attr(feature = "serde", serde(serialize_with = "robot_session::under::error"))]
    Corrupt(DecodeError),
    /// A notice: a line came without a connection.
    Unexpected(Unexpected),
}

robot_session::counters! {
    /// Counters of a host.
    pub struct HostStatistics {
        /// Requests sent.
        pub requests: u64,
        /// Requests without a reply.
        pub timed_out: u64,
        /// Decode errors.
        pub corrupt: u64,
    }
}

impl Host {
    /// Creates a host without a connection.
    ///
    /// # Errors
    /// [`ConfigError::Timeout`].
    pub fn new(config: HostConfig) -> Result<Self, ConfigError> {
        config.check()?;
        let core = Core::new(config, HostMachine::Disconnected, Decoder::new());
        Ok(Self { core })
    }

    /// Asks for the value of a register.
    ///
    /// # Errors
    /// [`SessionError::NotConnected`]; [`SessionError::Busy`] while the request before, or eight events, wait. Nothing has
    /// changed.
    pub fn get(&mut self, now: Duration, register: u8) -> Result<(), SessionError> {
        self.handle_timeout(now); // a request whose time is over is none
        if !self.core.events.has_room(1) {
            return Err(SessionError::Busy);
        }
        match self.core.on(now, Input::Get { register }) {
            Ok(_) => Ok(()),
            Err(_) if self.core.machine == HostMachine::Disconnected => Err(SessionError::NotConnected),
            Err(_) => Err(SessionError::Busy),
        }
    }
}

impl End for Host {
    type Machine = HostMachine;
    type Decoder = Decoder;
    type Events = EventQueue<HostEvent, 8>;
    type Statistics = HostStatistics;
    type Payload = i32;

    const LINK: &'static str = "toy-link";
    const END: &'static str = "host";
    const MAX_INPUT: usize = 64;
    const MAX_TRANSMIT: usize = Message::MAX_LEN;
    /// The outcome of a request.
    const QUEUE_SPACE: QueueSpace = QueueSpace { connect: 0, read: 0, transmit: 1 };

    robot_session::core!(HostEvent::Unexpected);

    fn next_input(&mut self) -> Option<(Input, Option<i32>)> {
        loop {
            match self.core.decoder.next_frame()? {
                Ok(Message::Value { register, value }) => {
                    return Some((Input::Value { register }, Some(value)));
                }
                // Another host's, or an echo.
                Ok(Message::Get { .. }) => {}
                Err(error) => {
                    self.core.statistics.corrupt += 1;
                    self.core.events.push_notice(HostEvent::Corrupt(error));
                }
            }
        }
    }

    fn act(&mut self, _now: Duration, action: Action, value: Option<i32>) {
        match (action, value) {
            (Action::Report { register }, Some(value)) => {
                self.core.push_outcome(HostEvent::Value { register, value })
            }
            (Action::Unasked { register }, Some(value)) => {
                self.core.events.push_notice(HostEvent::Unasked { register, value });
            }
            (Action::TimedOut { register }, _) => {
                self.core.statistics.timed_out += 1;
                self.core.push_outcome(HostEvent::TimedOut { register });
            }
            (Action::Sent, _) => self.core.statistics.requests += 1,
            (Action::Nothing | Action::Report { .. } | Action::Unasked { .. }, _) => {}
        }
    }

    fn write(&mut self, _now: Duration, request: Request, out: &mut [u8]) -> Option<(usize, Input)> {
        let Request { register } = request;
        Some((Message::Get { register }.encode(out).ok()?, Input::Sent))
    }
}
