//! The central controller's end of a device's connections.

mod config;
mod event;
pub mod machine;

use core::time::Duration;

use robot_session::{Decoder as _, Encode as _, EventQueue, Session};

pub use self::config::CentralConfig;
#[doc(hidden)]
pub use self::config::CentralRule;
pub use self::event::{CentralEvent, Closing, Miss, Progress, Unfinished};
use self::machine::{CentralAction, CentralInput, CentralLink, CentralMachine};
use crate::decoder::Decoder;
use crate::error::{ConfigError, SessionError};
use crate::message::{Command, Reply};
use crate::pose::Pose;

/// The central controller's end of the connections to one device, whose axes are `P`: [`RobotPose`](crate::RobotPose),
/// [`PlatformPose`](crate::PlatformPose), or [`NoPose`](crate::NoPose) for one without axes.
///
/// [`request`](Self::request) a command and drive the session as [`Session`] requires; its outcome is an event, and then the next
/// one may be requested.
///
/// - One command is outstanding at a time: replies have no number, only their order shows whose they are. Hence everything but
///   one well-formed reply of the right kind, in time, ends the connection: [`CentralEvent::Closed`] gives the command that was
///   sent as unknown. Close the connection then and make a new one.
/// - A command is written by `poll_transmit` in one piece; its reply is awaited from then on.
/// - A request is refused while an outcome waits to be polled, and a connection is not begun while more than two do: no outcome
///   is ever lost.
/// - What is known of a motion belongs to its connection: after a new one a status is [`Progress::Still`] or
///   [`Progress::Moving`] until a motion is commanded.
#[derive(Debug, Clone)]
pub struct Central<P> {
    config: CentralConfig,
    machine: CentralMachine<P>,
    decoder: Decoder,
    events: EventQueue<CentralEvent<P>, OUTCOMES>,
    statistics: CentralStatistics,
}

/// The outcomes that can wait: a command's and its connection's, twice.
const OUTCOMES: usize = 4;

/// What a central controller's end has counted.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub struct CentralStatistics {
    /// Connections that were made.
    pub connections: u64,
    /// Commands that were sent.
    pub commands: u64,
    /// Lines that arrived, corrupt ones included.
    pub lines: u64,
    /// Commands whose outcome is unknown.
    pub unknown: u64,
    /// Inputs that the machine did not expect.
    pub unexpected: u64,
    /// Notices that were dropped because nobody polled them.
    pub dropped_notices: u64,
}

impl<P: Pose> Central<P> {
    /// An end without a connection.
    ///
    /// # Errors
    /// The configuration cannot work.
    pub fn new(config: CentralConfig) -> Result<Self, ConfigError> {
        config.check()?;
        Ok(Self {
            config,
            machine: CentralMachine::NEW,
            decoder: Decoder::new(config.accepts),
            events: EventQueue::new(),
            statistics: CentralStatistics::default(),
        })
    }

    /// Requests a command: `poll_transmit` gives it.
    ///
    /// # Errors
    /// The last command is not finished or its outcome not polled, there is no connection, or the command has no form on the
    /// wire. Nothing changes.
    pub fn request(&mut self, command: Command<P>) -> Result<(), SessionError> {
        if command.has_values() {
            command.in_dialect(self.config.writes).encode(&mut [0; 40])?;
        }
        if !self.events.has_room(OUTCOMES) {
            return Err(SessionError::Busy);
        }
        match self.machine.on(Duration::ZERO, CentralInput::Request(command), &self.config) {
            Ok(_) => Ok(()),
            Err(_) if matches!(self.machine.link, CentralLink::Down | CentralLink::Ended) => {
                Err(SessionError::NotConnected)
            }
            Err(_) => Err(SessionError::Busy),
        }
    }

    /// Aborts the command that is not finished, if there is one. If it was not sent, it will not be; if it was, its outcome is
    /// unknown and the connection has ended. To stop a motion that was agreed to, request [`Command::Stop`].
    pub fn abort(&mut self, now: Duration) {
        self.apply(now, CentralInput::Abort);
    }

    /// Whether a command may be requested.
    pub fn is_idle(&self) -> bool {
        matches!(self.machine.link, CentralLink::Idle) && self.events.has_room(OUTCOMES)
    }

    /// Whether there is a connection that has not ended.
    pub const fn is_connected(&self) -> bool {
        !matches!(self.machine.link, CentralLink::Down | CentralLink::Ended)
    }

    /// Whether the connection has ended, and is to be closed.
    pub const fn is_ended(&self) -> bool {
        matches!(self.machine.link, CentralLink::Ended)
    }

    /// Its state.
    pub const fn machine(&self) -> &CentralMachine<P> {
        &self.machine
    }

    /// How it was configured.
    pub const fn config(&self) -> &CentralConfig {
        &self.config
    }

    #[inline]
    fn apply(&mut self, now: Duration, input: CentralInput<P>) {
        match self.machine.on(now, input, &self.config) {
            Ok(CentralAction::None | CentralAction::Send(_)) => {}
            Ok(CentralAction::Report(event)) => {
                if let CentralEvent::Closed { unfinished: Unfinished::Unknown(_), .. } = event {
                    self.statistics.unknown += 1;
                }
                // A command is requested, and a connection begun, only where there is room for their outcomes.
                let _ = self.events.push_outcome(event);
            }
            Err(unexpected) => {
                self.statistics.unexpected += 1;
                self.events.push_notice(CentralEvent::Unexpected(unexpected));
            }
        }
    }
}

impl<P: Pose> Session for Central<P> {
    type Event = CentralEvent<P>;
    type Statistics = CentralStatistics;

    const MAX_INPUT: usize = 65536;
    const MAX_TRANSMIT: usize = Command::<P>::MAX_LEN;

    fn handle_connected(&mut self, now: Duration) {
        self.decoder.clear();
        self.statistics.connections += 1;
        // Two outcomes at most: the connection before, and this one.
        if self.events.has_room(2) {
            self.apply(now, CentralInput::Connected);
            self.events.push_notice(CentralEvent::Connected);
        } else {
            self.apply(now, CentralInput::Disconnected);
        }
    }

    fn handle_disconnected(&mut self, now: Duration) {
        self.apply(now, CentralInput::Disconnected);
    }

    #[inline]
    fn handle_input(&mut self, now: Duration, mut bytes: &[u8]) {
        loop {
            let taken = self.decoder.push(bytes);
            bytes = bytes.get(taken..).unwrap_or_default();
            while let Some(line) = self.decoder.next_frame() {
                let reply = line.and_then(|line| Reply::decode(line, &self.config.accepts));
                self.statistics.lines += 1;
                self.apply(now, reply.map_or_else(CentralInput::Corrupt, CentralInput::Reply));
            }
            if bytes.is_empty() {
                return;
            }
        }
    }

    fn handle_timeout(&mut self, now: Duration) {
        self.apply(now, CentralInput::Due);
    }

    fn poll_event(&mut self) -> Option<CentralEvent<P>> {
        self.events.pop()
    }

    fn poll_transmit(&mut self, now: Duration, out: &mut [u8]) -> Option<usize> {
        let CentralLink::Sending { command } = self.machine.link else { return None };
        let len = command.in_dialect(self.config.writes).encode(out).ok()?;
        self.apply(now, CentralInput::Transmit);
        self.statistics.commands += 1;
        Some(len)
    }

    fn poll_timeout(&self) -> Option<Duration> {
        self.machine.deadline()
    }

    fn statistics(&self) -> CentralStatistics {
        CentralStatistics { dropped_notices: self.events.dropped_notices(), ..self.statistics }
    }
}
