//! The device's end of the connections.

mod config;
mod event;
pub mod machine;

use core::time::Duration;

use robot_session::end::{Core, End, EventQueue, QueueSpace};
use robot_session::{Decoder as _, Encode as _};

pub use self::config::DeviceConfig;
#[doc(hidden)]
pub use self::config::Rule;
pub use self::event::{DeviceClosing, DeviceEvent, Order, Rejection};
use self::machine::{Action, DeviceLink, DeviceMachine, Input};
use crate::decoder::LineDecoder;
use crate::error::{ConfigError, SessionError};
use crate::frame::Line;
use crate::message::{Command, ErrorCode, Reply, Status};
use crate::pose::Pose;

/// The end of a device with axes, [`RobotPose`](crate::RobotPose) or [`PlatformPose`](crate::PlatformPose), or without,
/// [`NoPose`](crate::NoPose).
///
/// Drive it as [`Session`](robot_session::Session) requires. Answer each [`DeviceEvent::Asked`] with
/// [`accept`](Self::accept) or [`refuse`](Self::refuse), and report the progress of the axes: [`set_pose`](Self::set_pose),
/// [`arrived`](Self::arrived), [`fail`](Self::fail).
///
/// Every line gets exactly one reply (§3). The session answers a status automatically, and refuses with
/// [`refusal`](DeviceConfig::refusal) a command that is unknown, malformed, or invalid now; the owner refuses other commands
/// with any error number. There are no deadlines at this end. A command is read when the reply to the previous one has been
/// sent, and until then the session does not accept input: a central controller that does not wait loses no command until it
/// disconnects, and commands that were not read by then are not executed. Further input may wait too, up to
/// [`BACKLOG`](Self::BACKLOG) bytes; more ends the connection.
///
/// A new connection replaces the previous one at once, even if its loss was not reported: the previous one may be
/// half open. Its commands are not answered on the new one; motions continue.
///
/// Decisions on points that the source leaves open: a motion is refused during another one, with the servo motors off, or
/// out of the range of a status; an error stops the motion, switches the servo motors off, shows in the status, and is
/// cleared by a reset; a reset is answered at once, switches the servo motors on and goes home; a device that refuses a
/// command does not latch an error.
#[derive(Debug, Clone)]
pub struct Device<P: Pose> {
    core: Core<DeviceMachine<P>, LineDecoder<BACKLOG>, EventQueue<DeviceEvent<P>, 8>, DeviceStatistics>,
}

const BACKLOG: usize = 512;

robot_session::counters! {
    /// Counters of a device's end.
    pub struct DeviceStatistics {
        /// Connections that were made.
        pub connections: u64,
        /// Lines that were read, corrupt ones included.
        pub lines: u64,
        /// Replies that were sent.
        pub replies: u64,
        /// Commands that the protocol itself refused.
        pub rejected: u64,
    }
}

impl<P: Pose> Device<P> {
    /// The bytes that wait for the replies before them, at most.
    pub const BACKLOG: usize = BACKLOG;

    /// Creates a device without a connection, with its servo motors off, its override at 100 %, and its pose unknown.
    ///
    /// # Errors
    /// The configuration is invalid.
    pub fn new(config: DeviceConfig) -> Result<Self, ConfigError> {
        config.check()?;
        Ok(Self { core: Core::new(config, DeviceMachine::NEW, LineDecoder::new(config.accepts)) })
    }

    /// Accepts the order that is pending: `OK`. Execute the order only if this succeeds.
    ///
    /// # Errors
    /// This order is not pending (the connection is gone, or it has been answered), or it has become impossible since it was
    /// requested, and is refused.
    pub fn accept(&mut self, order: Order<P>) -> Result<(), SessionError> {
        match self.core.on(Duration::ZERO, Input::Accept(order)) {
            Ok(Action::Report(event)) => {
                self.report(event);
                Err(SessionError::NotPossible)
            }
            Ok(_) => Ok(()),
            Err(_) => Err(SessionError::NotPending),
        }
    }

    /// Refuses the order that is pending: `ER` and this number.
    ///
    /// # Errors
    /// This order is not pending, or the number has no form on the wire. Nothing changes.
    pub fn refuse(&mut self, order: Order<P>, error: ErrorCode) -> Result<(), SessionError> {
        Reply::<P>::Error { error }.in_dialect(self.core.config.writes).encode(&mut [0; 16])?;
        self.ask(Duration::ZERO, Input::Refuse(order, error)).map_err(|_| SessionError::NotPending)
    }

    /// Sets the pose of the axes. A pose that cannot be encoded is treated as unknown, and a status is then refused.
    pub fn set_pose(&mut self, pose: P) {
        self.advance(Duration::ZERO, Input::Pose(pose.has_form().then_some(pose)), None);
    }

    /// Called when the axes are at rest.
    pub fn arrived(&mut self) {
        self.advance(Duration::ZERO, Input::Arrived, None);
    }

    /// Called when an error has occurred; the status shows it until a reset. A number without a form on the wire is shown as
    /// [`ErrorCode::Generic`].
    pub fn fail(&mut self, error: ErrorCode) {
        let error = if error.has_form(&self.core.config.writes) { error } else { ErrorCode::Generic };
        self.advance(Duration::ZERO, Input::Failed(error), None);
    }

    /// Returns the device's status; `None` while its pose is unknown.
    pub fn status(&self) -> Option<Status<P>> {
        self.core.machine.status()
    }

    /// Returns whether the session has ended the connection, which must be closed.
    pub const fn is_ended(&self) -> bool {
        matches!(self.core.machine.link, DeviceLink::Ended)
    }

    fn report(&mut self, event: DeviceEvent<P>) {
        match event {
            DeviceEvent::Asked { .. } | DeviceEvent::Closed { .. } => self.core.push_outcome(event),
            DeviceEvent::Rejected { .. } => {
                self.core.statistics.rejected += 1;
                self.core.events.push_notice(event);
            }
            DeviceEvent::Unexpected(_) => self.core.events.push_notice(event),
        }
    }
}

impl<P: Pose> End for Device<P> {
    type Machine = DeviceMachine<P>;
    type Decoder = LineDecoder<BACKLOG>;
    type Events = EventQueue<DeviceEvent<P>, 8>;
    type Statistics = DeviceStatistics;
    type Payload = ();

    const LINK: &'static str = "mmacell-proto";
    const END: &'static str = "device";
    /// The bytes that fit beside the beginning of a line.
    const MAX_INPUT: usize = BACKLOG - Line::MAX_LEN;
    const MAX_TRANSMIT: usize = Reply::<P>::MAX_LEN;
    /// An order and the end of the connection.
    const QUEUE_SPACE: QueueSpace = QueueSpace { connect: 2, read: 2, transmit: 0 };

    robot_session::core!(DeviceEvent::Unexpected);

    #[inline]
    fn next_input(&mut self) -> Option<(Input<P>, Option<()>)> {
        let line = self.core.decoder.next_frame()?;
        let command = line.and_then(|line| Command::decode(line, &self.core.config.accepts));
        self.core.statistics.lines += 1;
        Some((command.map_or_else(Input::Corrupt, Input::Command), None))
    }

    #[inline]
    fn act(&mut self, _now: Duration, action: Action<P>, _: Option<()>) {
        match action {
            Action::Nothing => {}
            Action::Connected => self.core.statistics.connections += 1,
            Action::Sent => self.core.statistics.replies += 1,
            Action::Left => {
                self.core.statistics.replies += 1;
                self.report(DeviceEvent::Closed { reason: DeviceClosing::Agreed });
            }
            Action::Report(event) => self.report(event),
        }
    }

    #[inline]
    fn write(&mut self, _now: Duration, reply: Reply<P>, out: &mut [u8]) -> Option<(usize, Input<P>)> {
        Some((reply.in_dialect(self.core.config.writes).encode(out).ok()?, Input::Sent))
    }

    fn overrun(&mut self, now: Duration) {
        self.advance(now, Input::Overrun, None);
        self.core.decoder.clear();
    }
}
