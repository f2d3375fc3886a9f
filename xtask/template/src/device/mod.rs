//! The device, which answers.

mod config;
pub mod machine;

use core::time::Duration;

use robot_session::end::{Core, CoreOf, End, EventQueue, QueueSpace};
use robot_session::{Decoder as _, Encode as _, Unexpected};

pub use config::DeviceConfig;
#[doc(hidden)]
pub use config::Rule;

use crate::decoder::Decoder;
use crate::error::{DecodeError, SessionError};
use crate::message::Message;
use machine::{Action, DeviceMachine, Input, Reply};

/// The device: answers each request, one after the other.
///
/// The order of calls is the [`Session`](robot_session::Session)'s; [`answer`](Self::answer) after each
/// [`DeviceEvent::Asked`]. Requests that come meanwhile wait.
#[derive(Debug, Clone)]
pub struct Device {
    core: CoreOf<Self>,
    /// The value that is to be sent.
    value: i32,
}

/// An event of the device.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "event", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum DeviceEvent {
    /// A request: [`Device::answer`] it.
    Asked {
        /// The requested register.
        register: u8,
    },
    /// A notice: corrupt bytes.
    #[cfg_attr(feature = "serde", serde(serialize_with = "robot_session::under::error"))]
    Corrupt(DecodeError),
    /// A notice: a request came without a connection.
    Unexpected(Unexpected),
}

robot_session::counters! {
    /// The counts of a device.
    pub struct DeviceStatistics {
        /// Replies sent.
        pub replies: u64,
        /// Decode errors.
        pub corrupt: u64,
    }
}

impl Device {
    /// Creates a device without a connection.
    pub fn new(config: DeviceConfig) -> Self {
        let core = Core::new(config, DeviceMachine::Disconnected, Decoder::new());
        Self { core, value: 0 }
    }

    /// Answers the request with the value of its register.
    ///
    /// # Errors
    /// [`SessionError::NotAsked`]: nothing has changed.
    pub fn answer(&mut self, value: i32) -> Result<(), SessionError> {
        self.ask(Duration::ZERO, Input::Answered).map_err(|_| SessionError::NotAsked)?;
        self.value = value;
        Ok(())
    }
}

impl End for Device {
    type Machine = DeviceMachine;
    type Decoder = Decoder;
    type Events = EventQueue<DeviceEvent, 8>;
    type Statistics = DeviceStatistics;
    type Payload = ();

    const LINK: &'static str = "toy-link";
    const END: &'static str = "device";
    const MAX_INPUT: usize = 32;
    const MAX_TRANSMIT: usize = Message::MAX_LEN;
    const QUEUE_SPACE: QueueSpace = QueueSpace { connect: 0, read: 1, transmit: 0 };

    robot_session::core!(DeviceEvent::Unexpected);

    fn next_input(&mut self) -> Option<(Input, Option<()>)> {
        loop {
            match self.core.decoder.next_frame()? {
                Ok(Message::Get { register }) => return Some((Input::Get { register }, None)),
                // Another device's, or an echo.
                Ok(Message::Value { .. }) => {}
                Err(error) => {
                    self.core.statistics.corrupt += 1;
                    self.core.events.push_notice(DeviceEvent::Corrupt(error));
                }
            }
        }
    }

    fn act(&mut self, _now: Duration, action: Action, _: Option<()>) {
        match action {
            Action::Nothing => {}
            Action::Ask { register } => self.core.push_outcome(DeviceEvent::Asked { register }),
            Action::Sent => self.core.statistics.replies += 1,
        }
    }

    fn write(&mut self, _now: Duration, reply: Reply, out: &mut [u8]) -> Option<(usize, Input)> {
        let message = Message::Value { register: reply.register, value: self.value };
        Some((message.encode(out).ok()?, Input::Sent))
    }
}
