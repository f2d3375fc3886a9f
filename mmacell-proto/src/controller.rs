//! The controller's end of a connection.

use core::time::Duration;

use crate::outgoing::Outgoing;
use crate::state::{Connection, ConnectionEvent, Motion, MotionEvent};
use crate::{Command, DecodeError, Decoder, Dialect, ErrorCode, Mode, Pose, Reply, SessionError, Status};

/// The controller's end of one connection, to a device whose axes are `P`: [`RobotPose`](crate::RobotPose),
/// [`PlatformPose`](crate::PlatformPose), or [`NoPose`](crate::NoPose) for one without axes.
///
/// 1. [`send`](Self::send) a command,
/// 2. write what [`poll_transmit`](Self::poll_transmit) gives until it gives `None`,
/// 3. hand what arrives to [`handle_input`](Self::handle_input), and call [`handle_timeout`](Self::handle_timeout) when the
///    time of [`poll_timeout`](Self::poll_timeout) has come,
/// 4. take the events until [`poll_event`](Self::poll_event) gives `None`; then the next command may be sent.
///
/// One command is outstanding at a time: replies have no number, only their order tells whose they are. Hence everything but
/// one well-formed reply of the right kind, in time, closes the session: the command that was under way is handed back as
/// unknown, and the caller closes the connection and begins a new one with a new session. The event queue cannot overflow:
/// `send` refuses while events wait, and a closed session hears nothing.
#[derive(Debug, Clone)]
pub struct Controller<P> {
    config: Config,
    decoder: Decoder,
    connection: Connection,
    command: Option<Command<P>>,
    deadline: Option<Duration>,
    outgoing: Outgoing<38>,
    events: [Option<Event<P>>; 2],
    motion: Motion,
    believed_from: Duration,
    target: Option<P>,
    pose: Option<P>,
}

/// What the source leaves open at the controller's end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Config {
    /// What is accepted of replies. Default: strict.
    pub dialect: Dialect,
    /// How long a reply may take. The source says "immediately" (§3) and gives no figure. Default: 1 s.
    pub timeout: Duration,
    /// How soon after the start of a motion a status "standing" is not believed, unless the device stands at the target or
    /// has been seen moving: the status may be older than the motion. Nobody knows how long a real controller takes to begin.
    /// Default: 100 ms.
    pub settle: Duration,
    /// How far from its target a device stands at it, in units of the last digit: 1 µm, 0.1 mrad. Default: 10.
    pub tolerance: u32,
}

/// What happened at the controller's end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Event<P> {
    /// The device has done it, or has started it. Of a [`Command::Close`], [`Event::Closed`] follows.
    Done {
        /// What it was told.
        command: Command<P>,
    },
    /// The device has not done it.
    Refused {
        /// What it was told.
        command: Command<P>,
        /// Why not.
        error: ErrorCode,
    },
    /// The reply to a [`Command::Status`].
    Status {
        /// As the device says.
        status: Status<P>,
        /// As the controller believes: a motion has ended only when this is [`Motion::Still`].
        motion: Motion,
    },
    /// The session is closed; close the connection.
    Closed {
        /// Why.
        reason: Closing,
        /// The command that was under way: it may have been executed or not.
        unknown: Option<Command<P>>,
    },
}

/// Why a session closed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Closing {
    /// The device agreed to a [`Command::Close`].
    Agreed,
    /// No reply in time.
    Timeout,
    /// The connection broke.
    Disconnected,
    /// A line that is no reply of such a device.
    Malformed(DecodeError),
    /// A good reply to nothing, or of another kind than the command has.
    Unexpected,
}

impl<P: Pose> Controller<P> {
    /// A session over a connection that has just been opened.
    pub fn new(config: Config) -> Self {
        Self {
            config,
            decoder: Decoder::new(config.dialect),
            connection: Connection::Idle,
            command: None,
            deadline: None,
            outgoing: Outgoing::new(),
            events: [None, None],
            motion: Motion::Still,
            believed_from: Duration::ZERO,
            target: None,
            pose: None,
        }
    }

    /// Begins to send a command.
    ///
    /// # Errors
    /// The last command is not done with, the session is closed, or the command has no form on the wire. Nothing changes.
    pub fn send(&mut self, command: Command<P>) -> Result<(), SessionError> {
        let event = match command {
            Command::Close => ConnectionEvent::SendClose,
            _ => ConnectionEvent::Send,
        };
        if self.connection == Connection::Closed {
            return Err(SessionError::Closed);
        }
        let next = self.connection.next(event).filter(|_| self.events[0].is_none());
        let next = next.ok_or(SessionError::Busy)?;
        self.outgoing.fill(|buffer| command.encode(buffer))?;
        self.connection = next;
        self.command = Some(command);
        Ok(())
    }

    /// Bytes to write to the connection, as many as fit. The reply is awaited from the last of them on.
    pub fn poll_transmit(&mut self, now: Duration, buffer: &mut [u8]) -> Option<usize> {
        let len = self.outgoing.take(buffer)?;
        if self.outgoing.is_empty() {
            self.deadline = Some(now.saturating_add(self.config.timeout));
        }
        Some(len)
    }

    /// Bytes that have arrived. All are taken.
    pub fn handle_input(&mut self, now: Duration, mut bytes: &[u8]) {
        while self.connection != Connection::Closed {
            let taken = self.decoder.push(bytes);
            bytes = bytes.get(taken..).unwrap_or_default();
            while self.connection != Connection::Closed {
                let Some(line) = self.decoder.next_frame() else { break };
                let reply = line.and_then(|line| Reply::decode(line, &self.config.dialect));
                self.handle_reply(now, reply);
            }
            if bytes.is_empty() {
                return;
            }
        }
    }

    /// The time has come that [`poll_timeout`](Self::poll_timeout) gave.
    pub fn handle_timeout(&mut self, now: Duration) {
        if self.deadline.is_some_and(|deadline| deadline <= now) {
            self.close(Closing::Timeout);
        }
    }

    /// The connection has ended.
    pub fn handle_disconnect(&mut self) {
        if self.connection != Connection::Closed {
            self.close(Closing::Disconnected);
        }
    }

    /// The next event.
    pub fn poll_event(&mut self) -> Option<Event<P>> {
        let [first, second] = &mut self.events;
        core::mem::replace(first, second.take())
    }

    /// When to call [`handle_timeout`](Self::handle_timeout).
    pub fn poll_timeout(&self) -> Option<Duration> {
        self.deadline
    }

    /// The connection.
    pub fn connection(&self) -> Connection {
        self.connection
    }

    /// Whether the device moves, as far as its replies tell.
    pub fn motion(&self) -> Motion {
        self.motion
    }

    fn handle_reply(&mut self, now: Duration, reply: Result<Reply<P>, DecodeError>) {
        let reply = match reply {
            Ok(reply) => reply,
            Err(error) => return self.close(Closing::Malformed(error)),
        };
        // A reply to a command that has not gone out whole is a reply to nothing.
        let command = self.command.filter(|_| self.outgoing.is_empty());
        let (event, next) = match (command, reply) {
            (Some(command), Reply::Error { error }) => {
                (Event::Refused { command, error }, ConnectionEvent::Refused)
            }
            (Some(Command::Status), Reply::Status(status)) => {
                self.observe(now, &status);
                (Event::Status { status, motion: self.motion }, ConnectionEvent::Done)
            }
            (None, _) | (Some(Command::Status), Reply::Ok) | (Some(_), Reply::Status(_)) => {
                return self.close(Closing::Unexpected);
            }
            (Some(command), Reply::Ok) => {
                self.note(now, &command);
                (Event::Done { command }, ConnectionEvent::Done)
            }
        };
        self.command = None;
        self.deadline = None;
        self.push_event(event);
        self.connection = self.connection.next(next).unwrap_or(Connection::Closed);
        if self.connection == Connection::Closed {
            self.push_event(Event::Closed { reason: Closing::Agreed, unknown: None });
        }
    }

    /// What the device has just agreed to.
    fn note(&mut self, now: Duration, command: &Command<P>) {
        let event = match command {
            Command::Move { .. } | Command::Reset => MotionEvent::Started,
            Command::Stop | Command::Servo { on: false } => MotionEvent::Halted,
            _ => return,
        };
        self.motion = self.motion.next(event);
        self.believed_from = now.saturating_add(self.config.settle);
        // Where the device stands is known again from the next status on.
        let pose = self.pose.take();
        self.target = match *command {
            Command::Move { mode: Mode::Absolute, pose } => Some(pose),
            Command::Move { mode: Mode::Relative, pose: by } => pose.and_then(|pose| pose.plus(by)),
            _ => None,
        };
    }

    fn observe(&mut self, now: Duration, status: &Status<P>) {
        let there = self.target.is_some_and(|target| status.pose.is_near(target, self.config.tolerance));
        let event = match status.moving {
            true => MotionEvent::SeenMoving,
            false if there || now >= self.believed_from => MotionEvent::SeenStill,
            false => MotionEvent::SeenStillTooSoon,
        };
        self.motion = self.motion.next(event);
        self.pose = Some(status.pose);
    }

    fn close(&mut self, reason: Closing) {
        self.connection = self.connection.next(ConnectionEvent::Broken).unwrap_or(Connection::Closed);
        self.deadline = None;
        self.outgoing.clear();
        let unknown = self.command.take();
        self.push_event(Event::Closed { reason, unknown });
    }

    /// At most two events wait: that of a command, and `Closed`, behind which nothing comes.
    fn push_event(&mut self, event: Event<P>) {
        if let Some(free) = self.events.iter_mut().find(|slot| slot.is_none()) {
            *free = Some(event);
        }
    }
}

impl Config {
    /// The documented defaults.
    pub const DEFAULT: Self = Self {
        dialect: Dialect::STRICT,
        timeout: Duration::from_secs(1),
        settle: Duration::from_millis(100),
        tolerance: 10,
    };
}

impl Default for Config {
    fn default() -> Self {
        Self::DEFAULT
    }
}
