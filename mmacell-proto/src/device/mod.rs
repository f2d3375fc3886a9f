//! The device's end of the connections.

mod backlog;
mod config;
mod event;
pub mod machine;

use core::time::Duration;

use robot_session::{Decoder as _, Encode as _, EventQueue, Session};

use self::backlog::Backlog;
pub use self::config::DeviceConfig;
#[doc(hidden)]
pub use self::config::DeviceRule;
pub use self::event::{DeviceClosing, DeviceEvent, Order, Rejection};
use self::machine::{DeviceAction, DeviceInput, DeviceLink, DeviceMachine};
use crate::decoder::Decoder;
use crate::error::{ConfigError, SessionError};
use crate::message::{Command, ErrorCode, Reply, Status};
use crate::pose::Pose;

/// The end of a device with axes, [`RobotPose`](crate::RobotPose) or [`PlatformPose`](crate::PlatformPose), or without,
/// [`NoPose`](crate::NoPose).
///
/// Drive it as [`Session`] requires. Answer each [`DeviceEvent::Asked`] with [`accept`](Self::accept) or
/// [`refuse`](Self::refuse), and report what the axes do: [`set_pose`](Self::set_pose), [`arrived`](Self::arrived),
/// [`fail`](Self::fail).
///
/// Every line gets exactly one reply (§3). The session answers a status by itself, and refuses with
/// [`refusal`](DeviceConfig::refusal) what is unknown, malformed, or not possible now; whatever else the owner refuses, with any
/// error number. There are no deadlines at this end. A command is read when the reply to the one before has been sent: a central
/// controller that does not wait loses nothing, until more than [`BACKLOG`](Self::BACKLOG) bytes wait, which ends the connection,
/// or until it hangs up: what was not read then is not obeyed.
///
/// A new connection takes the place of the one before at once, also where nobody has reported that one gone: the one before may
/// be half open. Nothing of it is answered on the new one; what the axes do goes on.
///
/// What the source leaves open is decided thus: a motion is refused while another goes on, with the servo motors off, or out
/// of the range that a status can hold; an error stops the motion, switches the servo motors off, shows in the status, and is
/// cleared by a reset; a reset is answered at once, switches the servo motors on and goes home; whoever refuses a command
/// does not latch an error.
#[derive(Debug, Clone)]
pub struct Device<P> {
    config: DeviceConfig,
    machine: DeviceMachine<P>,
    decoder: Decoder,
    backlog: Backlog<512>,
    events: EventQueue<DeviceEvent<P>, 8>,
    statistics: DeviceStatistics,
}

/// What a device's end has counted.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub struct DeviceStatistics {
    /// Connections that were made.
    pub connections: u64,
    /// Lines that were read, corrupt ones included.
    pub lines: u64,
    /// Replies that were sent.
    pub replies: u64,
    /// Commands that the protocol itself refused.
    pub rejected: u64,
    /// Inputs that the machine did not expect.
    pub unexpected: u64,
    /// Notices that were dropped because nobody polled them.
    pub dropped_notices: u64,
}

impl<P: Pose> Device<P> {
    /// The bytes that wait for the replies before them, at most.
    pub const BACKLOG: usize = 512;

    /// A device without a connection, with its servo motors off, its override at 100 %, and its pose unknown.
    ///
    /// # Errors
    /// The configuration cannot work.
    pub fn new(config: DeviceConfig) -> Result<Self, ConfigError> {
        config.check()?;
        Ok(Self {
            config,
            machine: DeviceMachine::NEW,
            decoder: Decoder::new(config.accepts),
            backlog: Backlog::new(),
            events: EventQueue::new(),
            statistics: DeviceStatistics::default(),
        })
    }

    /// Accepts the order that is pending: `OK`. The order is to be carried out if this succeeds, and not otherwise.
    ///
    /// # Errors
    /// This order is not pending (the connection is gone, or it has been answered), or it has become impossible since it was
    /// asked for, and is refused.
    pub fn accept(&mut self, order: Order<P>) -> Result<(), SessionError> {
        match self.machine.on(DeviceInput::Accept(order), &self.config) {
            Ok(DeviceAction::Report(event)) => {
                self.report(event);
                Err(SessionError::NotPossible)
            }
            Ok(DeviceAction::None | DeviceAction::Send(_) | DeviceAction::Leave) => Ok(()),
            Err(_) => Err(SessionError::NotPending),
        }
    }

    /// Refuses the order that is pending: `ER` and this number.
    ///
    /// # Errors
    /// This order is not pending, or the number has no form on the wire. Nothing changes.
    pub fn refuse(&mut self, order: Order<P>, error: ErrorCode) -> Result<(), SessionError> {
        Reply::<P>::Error { error }.in_dialect(self.config.writes).encode(&mut [0; 16])?;
        match self.machine.on(DeviceInput::Refuse(order, error), &self.config) {
            Ok(_) => Ok(()),
            Err(_) => Err(SessionError::NotPending),
        }
    }

    /// The axes are here now. A pose that has no form on the wire is taken as unknown: a status is refused then.
    pub fn set_pose(&mut self, pose: P) {
        self.apply(DeviceInput::Pose(pose.has_form().then_some(pose)));
    }

    /// The axes are at rest.
    pub fn arrived(&mut self) {
        self.apply(DeviceInput::Arrived);
    }

    /// An error has occurred; it shows in the status until a reset. A number that has no form on the wire shows as
    /// [`ErrorCode::Generic`].
    pub fn fail(&mut self, error: ErrorCode) {
        let error = if error.has_form(&self.config.writes) { error } else { ErrorCode::Generic };
        self.apply(DeviceInput::Failed(error));
    }

    /// What the device reports of itself; `None` while its pose is not known.
    pub fn status(&self) -> Option<Status<P>> {
        self.machine.status()
    }

    /// Whether the connection has ended, and is to be closed.
    pub const fn is_ended(&self) -> bool {
        matches!(self.machine.link, DeviceLink::Ended)
    }

    /// Its state.
    pub const fn machine(&self) -> &DeviceMachine<P> {
        &self.machine
    }

    /// How it was configured.
    pub const fn config(&self) -> &DeviceConfig {
        &self.config
    }

    /// Reads lines as long as the machine takes them and their outcomes, an order and the end of the connection, have room.
    #[inline]
    fn read(&mut self) {
        while self.reads() {
            if self.read_line() {
                continue;
            }
            let taken = self.decoder.push(self.backlog.bytes());
            if taken == 0 {
                return;
            }
            self.backlog.drop_first(taken);
        }
    }

    /// The same from bytes that need not wait; what is left of them.
    #[inline]
    fn read_from<'a>(&mut self, mut bytes: &'a [u8]) -> &'a [u8] {
        while self.reads() {
            if self.read_line() {
                continue;
            }
            let taken = self.decoder.push(bytes);
            if taken == 0 {
                break;
            }
            bytes = bytes.get(taken..).unwrap_or_default();
        }
        bytes
    }

    #[inline]
    fn reads(&self) -> bool {
        self.machine.reads() && self.events.has_room(2)
    }

    #[inline]
    fn read_line(&mut self) -> bool {
        if self.decoder.held() == 0 {
            return false;
        }
        let Some(line) = self.decoder.next_frame() else { return false };
        let command = line.and_then(|line| Command::decode(line, &self.config.accepts));
        self.statistics.lines += 1;
        self.apply(command.map_or_else(DeviceInput::Corrupt, DeviceInput::Command));
        true
    }

    #[inline]
    fn apply(&mut self, input: DeviceInput<P>) {
        match self.machine.on(input, &self.config) {
            Ok(DeviceAction::None | DeviceAction::Send(_)) => {}
            Ok(DeviceAction::Leave) => self.report(DeviceEvent::Closed { reason: DeviceClosing::Agreed }),
            Ok(DeviceAction::Report(event)) => self.report(event),
            Err(unexpected) => {
                self.statistics.unexpected += 1;
                self.events.push_notice(DeviceEvent::Unexpected(unexpected));
            }
        }
    }

    fn report(&mut self, event: DeviceEvent<P>) {
        match event {
            DeviceEvent::Asked { .. } | DeviceEvent::Closed { .. } => {
                // A line is read, and a connection begun, only where there is room for their outcomes.
                let _ = self.events.push_outcome(event);
            }
            DeviceEvent::Rejected { .. } => {
                self.statistics.rejected += 1;
                self.events.push_notice(event);
            }
            DeviceEvent::Unexpected(_) => self.events.push_notice(event),
        }
    }
}

impl<P: Pose> Session for Device<P> {
    type Event = DeviceEvent<P>;
    type Statistics = DeviceStatistics;

    const MAX_INPUT: usize = 65536;
    const MAX_TRANSMIT: usize = Reply::<P>::MAX_LEN;

    fn handle_connected(&mut self, _now: Duration) {
        self.decoder.clear();
        self.backlog.clear();
        self.statistics.connections += 1;
        let input = if self.events.has_room(2) { DeviceInput::Connected } else { DeviceInput::Disconnected };
        self.apply(input);
    }

    fn handle_disconnected(&mut self, _now: Duration) {
        self.decoder.clear();
        self.backlog.clear();
        self.apply(DeviceInput::Disconnected);
    }

    #[inline]
    fn handle_input(&mut self, _now: Duration, mut bytes: &[u8]) {
        if self.backlog.is_empty() {
            bytes = self.read_from(bytes);
        }
        while !bytes.is_empty() {
            let taken = self.backlog.fill(self.decoder.held(), bytes);
            bytes = bytes.get(taken..).unwrap_or_default();
            self.read();
            if taken == 0 && !bytes.is_empty() {
                self.apply(DeviceInput::Overrun);
                self.decoder.clear();
                return self.backlog.clear();
            }
        }
    }

    fn handle_timeout(&mut self, _now: Duration) {}

    fn poll_event(&mut self) -> Option<DeviceEvent<P>> {
        let event = self.events.pop()?;
        self.read();
        Some(event)
    }

    fn poll_transmit(&mut self, _now: Duration, out: &mut [u8]) -> Option<usize> {
        let reply = self.machine.pending()?;
        let len = reply.in_dialect(self.config.writes).encode(out).ok()?;
        self.apply(DeviceInput::Transmit);
        self.statistics.replies += 1;
        self.read();
        Some(len)
    }

    fn poll_timeout(&self) -> Option<Duration> {
        None
    }

    fn statistics(&self) -> DeviceStatistics {
        DeviceStatistics { dropped_notices: self.events.dropped_notices(), ..self.statistics }
    }
}
