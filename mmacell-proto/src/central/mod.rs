//! The central controller's end of a device's connections.

mod config;
mod event;
pub mod machine;

use core::time::Duration;

use robot_session::end::{Core, End, EventQueue, QueueSpace};
use robot_session::{Decoder as _, Encode as _};

pub use self::config::CentralConfig;
#[doc(hidden)]
pub use self::config::Rule;
pub use self::event::{CentralEvent, CloseReason, MissReason, Progress, Unfinished};
use self::machine::{Action, CentralLink, CentralMachine, Input};
use crate::decoder::Decoder;
use crate::error::{ConfigError, SessionError};
use crate::message::{Command, Reply};
use crate::pose::Pose;

/// The central controller's end of the connections to one device, whose axes are `P`: [`RobotPose`](crate::RobotPose),
/// [`PlatformPose`](crate::PlatformPose), or [`NoPose`](crate::NoPose) for one without axes.
///
/// [`request`](Self::request) a command and drive the session as [`Session`](robot_session::Session) requires; its outcome
/// is an event, and then the next one may be requested.
///
/// - One command is outstanding at a time: replies have no number, and are matched by their order. Hence everything except
///   one well-formed, timely reply of the right kind ends the connection: [`CentralEvent::Closed`] reports the command that was
///   sent as unknown. Close the connection then and make a new one.
/// - A command is written by `poll_transmit` in one piece; its reply is awaited from then on.
/// - A request is refused while an outcome waits to be polled, and a connection is not begun while more than two do: no outcome
///   is ever lost.
/// - The knowledge about a motion ends with its connection: after a new one a status is [`Progress::Still`] or
///   [`Progress::Moving`] until a motion is commanded.
#[derive(Debug, Clone)]
pub struct Central<P: Pose> {
    core: Core<CentralMachine<P>, Decoder, EventQueue<CentralEvent<P>, OUTCOMES>, CentralStatistics>,
}

/// The outcomes that can wait: a command's and its connection's, twice.
const OUTCOMES: usize = 4;

robot_session::counters! {
    /// Counters of a central controller's end.
    pub struct CentralStatistics {
        /// Connections that were made.
        pub connections: u64,
        /// Commands that were sent.
        pub commands: u64,
        /// Lines that arrived, corrupt ones included.
        pub lines: u64,
        /// Commands whose outcome is unknown.
        pub unknown: u64,
    }
}

impl<P: Pose> Central<P> {
    /// Creates an end without a connection.
    ///
    /// # Errors
    /// The configuration is invalid.
    pub fn new(config: CentralConfig) -> Result<Self, ConfigError> {
        config.check()?;
        Ok(Self { core: Core::new(config, CentralMachine::NEW, Decoder::new(config.accepts)) })
    }

    /// Requests a command, which `poll_transmit` then writes.
    ///
    /// # Errors
    /// The last command has no outcome yet or it was not fetched, there is no connection, or the command cannot be
    /// encoded. Nothing changes.
    pub fn request(&mut self, command: Command<P>) -> Result<(), SessionError> {
        if command.has_values() {
            command.in_dialect(self.core.config.writes).encode(&mut [0; 40])?;
        }
        if !self.core.events.has_room(OUTCOMES) {
            return Err(SessionError::Busy);
        }
        self.ask(Duration::ZERO, Input::Request(command)).map_err(|_| match self.core.machine.link {
            CentralLink::Down | CentralLink::Ended => SessionError::NotConnected,
            _ => SessionError::Busy,
        })
    }

    /// Aborts the command that is not finished, if there is one. If it was not sent, it will not be; if it was, its outcome is
    /// unknown and the connection has ended. To stop a motion that was agreed to, request [`Command::Stop`].
    pub fn abort(&mut self, now: Duration) {
        self.advance(now, Input::Abort, None);
    }

    /// Returns whether a command may be requested.
    pub fn is_idle(&self) -> bool {
        matches!(self.core.machine.link, CentralLink::Idle) && self.core.events.has_room(OUTCOMES)
    }

    /// Returns whether the connection is open.
    pub const fn is_connected(&self) -> bool {
        !matches!(self.core.machine.link, CentralLink::Down | CentralLink::Ended)
    }

    /// Returns whether the session has ended the connection, which must be closed.
    pub const fn is_ended(&self) -> bool {
        matches!(self.core.machine.link, CentralLink::Ended)
    }

    fn report(&mut self, event: CentralEvent<P>) {
        if let CentralEvent::Closed { unfinished: Unfinished::Unknown(_), .. } = event {
            self.core.statistics.unknown += 1;
        }
        self.core.push_outcome(event);
    }
}

impl<P: Pose> End for Central<P> {
    type Machine = CentralMachine<P>;
    type Decoder = Decoder;
    type Events = EventQueue<CentralEvent<P>, OUTCOMES>;
    type Statistics = CentralStatistics;
    type Payload = ();

    const LINK: &'static str = "mmacell-proto";
    const END: &'static str = "central";
    const MAX_INPUT: usize = 4096;
    const MAX_TRANSMIT: usize = Command::<P>::MAX_LEN;
    /// Two outcomes at most: the connection before, and this one.
    const QUEUE_SPACE: QueueSpace = QueueSpace { connect: 2, ..QueueSpace::NONE };

    robot_session::core!(CentralEvent::Unexpected);

    fn discards_after(&self) -> Option<Duration> {
        Some(self.core.config.timeout)
    }

    #[inline]
    fn next_input(&mut self) -> Option<(Input<P>, Option<()>)> {
        let line = self.core.decoder.next_frame()?;
        let reply = line.and_then(|line| Reply::decode(line, &self.core.config.accepts));
        self.core.statistics.lines += 1;
        Some((reply.map_or_else(Input::Corrupt, Input::Reply), None))
    }

    #[inline]
    fn act(&mut self, _now: Duration, action: Action<P>, _: Option<()>) {
        match action {
            Action::Nothing => {}
            Action::Connected { before } => {
                self.core.statistics.connections += 1;
                if let Some(closed) = before {
                    self.report(closed);
                }
                self.core.events.push_notice(CentralEvent::Connected);
            }
            Action::Sent => self.core.statistics.commands += 1,
            Action::Report(event) => self.report(event),
        }
    }

    #[inline]
    fn write(&mut self, _now: Duration, command: Command<P>, out: &mut [u8]) -> Option<(usize, Input<P>)> {
        Some((command.in_dialect(self.core.config.writes).encode(out).ok()?, Input::Sent))
    }
}
