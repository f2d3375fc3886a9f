//! The device's end of a connection.

use core::time::Duration;

use crate::outgoing::Outgoing;
use crate::state::{DeviceEvent, DeviceState};
use crate::{Command, DecodeError, Decoder, Dialect, ErrorCode, Mode, Pose, Reply, Status};

/// The end of a device with axes: [`RobotPose`](crate::RobotPose) or [`PlatformPose`](crate::PlatformPose).
///
/// 1. [`connect`](Self::connect) when a controller has connected,
/// 2. hand what arrives to [`handle_input`](Self::handle_input), which stops behind each line,
/// 3. write what [`poll_transmit`](Self::poll_transmit) gives and obey what [`poll_event`](Self::poll_event) gives, until both
///    give `None`; then hand over the rest,
/// 4. tell it how the axes do: [`set_pose`](Self::set_pose), [`arrived`](Self::arrived), [`fail`](Self::fail).
///
/// Every line gets exactly one reply, at once (§3): `ER+00001` when it is unknown, malformed, or not possible now. There are
/// no deadlines at this end, hence no timeouts. Input is not taken while a reply or an event waits, so nothing overflows and
/// a controller that does not wait for replies loses nothing.
///
/// What the source leaves open is decided thus: a motion is refused while another goes on, with the servo motors off, or out
/// of the range that a status can tell; an error stops the motion, switches the servo motors off, shows in the status, and is
/// cleared by a reset; a reset is answered at once, switches the servo motors on and goes home; whoever refuses a command
/// does not latch an error.
#[derive(Debug, Clone)]
pub struct Device<P> {
    dialect: Dialect,
    decoder: Decoder,
    open: bool,
    outgoing: Outgoing<50>,
    event: Option<Event<P>>,
    state: DeviceState,
    pose: P,
    percent: u8,
    error: ErrorCode,
}

/// What the axes are to do, or what happened at the device's end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Event<P> {
    /// Switch the servo motors; off stops the motion too.
    Servo {
        /// On.
        on: bool,
    },
    /// Go at this speed from now on.
    Override {
        /// 0 to 100 %.
        percent: u8,
    },
    /// Go there, then say [`Device::arrived`]. A relative motion has been added up.
    Move {
        /// Where.
        target: P,
    },
    /// Stop, then say [`Device::arrived`].
    Stop,
    /// Switch the servo motors on, leave any other motion, go home, then say [`Device::arrived`].
    Home,
    /// The controller closes the connection; the reply is still to be written.
    Closed,
    /// A command was refused.
    Rejected {
        /// Why.
        reason: Rejection,
    },
}

/// Why a device refuses a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Rejection {
    /// It cannot be read.
    #[error(transparent)]
    Malformed(#[from] DecodeError),
    /// It is for vision or gripper.
    #[error("this device has neither camera nor gripper")]
    NotMine,
    /// Not in this state.
    #[error("not possible while {0:?}")]
    NotNow(DeviceState),
    /// A relative motion that leads out of the range of a coordinate.
    #[error("the motion leads out of range")]
    OutOfRange,
}

impl<P: Pose> Device<P> {
    /// A device with its servo motors off, its axes here and its override at 100 %.
    pub fn new(pose: P, dialect: Dialect) -> Self {
        Self {
            dialect,
            decoder: Decoder::new(dialect),
            open: true,
            outgoing: Outgoing::new(),
            event: None,
            state: DeviceState::Off,
            pose,
            percent: 100,
            error: ErrorCode::None,
        }
    }

    /// A new connection: what was half heard or half said is forgotten. The device stays as it is.
    pub fn connect(&mut self) {
        self.decoder = Decoder::new(self.dialect);
        self.outgoing.clear();
        self.open = true;
    }

    /// Takes bytes up to the end of a line, and says how many; none while a reply or an event waits.
    #[must_use = "the rest is to be handed over again"]
    pub fn handle_input(&mut self, _now: Duration, bytes: &[u8]) -> usize {
        if !self.open {
            return bytes.len();
        }
        let mut taken = 0;
        while self.outgoing.is_empty() && self.event.is_none() {
            let rest = bytes.get(taken..).unwrap_or_default();
            let Some(piece) = rest.split_inclusive(|byte| *byte == b'\n').next() else { break };
            taken += self.decoder.push(piece);
            if let Some(line) = self.decoder.next_frame() {
                let command = line.and_then(|line| Command::decode(line, &self.dialect));
                self.obey(command);
            }
        }
        taken
    }

    /// Bytes to write to the connection, as many as fit.
    pub fn poll_transmit(&mut self, _now: Duration, buffer: &mut [u8]) -> Option<usize> {
        self.outgoing.take(buffer)
    }

    /// The next event.
    pub fn poll_event(&mut self) -> Option<Event<P>> {
        self.event.take()
    }

    /// The axes stand here now.
    pub fn set_pose(&mut self, pose: P) {
        self.pose = pose;
    }

    /// The axes stand.
    pub fn arrived(&mut self) {
        self.apply(DeviceEvent::Arrived);
    }

    /// An error has occurred; it shows in the status until a reset.
    pub fn fail(&mut self, error: ErrorCode) {
        self.error = error;
        self.apply(DeviceEvent::Failed);
    }

    /// What the device says of itself.
    pub fn status(&self) -> Status<P> {
        Status {
            moving: self.state.moving(),
            pose: self.pose,
            servo: self.state.servo(),
            percent: self.percent,
            error: self.error,
        }
    }

    /// The state of the device.
    pub fn state(&self) -> DeviceState {
        self.state
    }

    fn obey(&mut self, command: Result<Command<P>, DecodeError>) {
        let reply = match self.try_obey(command) {
            Ok(Some(status)) => Reply::Status(status),
            Ok(None) => Reply::Ok,
            Err(reason) => {
                self.event = Some(Event::Rejected { reason });
                Reply::Error { error: ErrorCode::Generic }
            }
        };
        // A pose that the owner has set out of range has no status.
        let refusal = Reply::<P>::Error { error: ErrorCode::Generic };
        if self.outgoing.fill(|buffer| reply.encode(buffer)).is_err() {
            let _ = self.outgoing.fill(|buffer| refusal.encode(buffer));
        }
    }

    fn try_obey(&mut self, command: Result<Command<P>, DecodeError>) -> Result<Option<Status<P>>, Rejection> {
        let event = match command? {
            Command::Status => return Ok(Some(self.status())),
            Command::Servo { on: true } => self.admit(DeviceEvent::ServoOn, Event::Servo { on: true })?,
            Command::Servo { on: false } => self.admit(DeviceEvent::ServoOff, Event::Servo { on: false })?,
            Command::Override { percent } => {
                self.percent = percent;
                Event::Override { percent }
            }
            Command::Move { mode, pose } => {
                let target = match mode {
                    Mode::Absolute => pose,
                    Mode::Relative => self.pose.plus(pose).ok_or(Rejection::OutOfRange)?,
                };
                self.admit(DeviceEvent::Move, Event::Move { target })?
            }
            Command::Stop => self.admit(DeviceEvent::Stop, Event::Stop)?,
            Command::Reset => {
                self.error = ErrorCode::None;
                self.admit(DeviceEvent::Reset, Event::Home)?
            }
            Command::Close => {
                self.open = false;
                Event::Closed
            }
            Command::Acquire { .. } | Command::Grip { .. } => return Err(Rejection::NotMine),
        };
        self.event = Some(event);
        Ok(None)
    }

    /// The state changes before the reply goes out: a status asked for behind `OK` says that the device moves.
    fn admit(&mut self, event: DeviceEvent, then: Event<P>) -> Result<Event<P>, Rejection> {
        self.state = self.state.next(event).ok_or(Rejection::NotNow(self.state))?;
        Ok(then)
    }

    fn apply(&mut self, event: DeviceEvent) {
        self.state = self.state.next(event).unwrap_or(self.state);
    }
}
