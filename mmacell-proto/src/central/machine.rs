//! Every rule of the central controller's end. Nothing here knows of bytes.
//!
//! The connection: one command is outstanding at a time, because replies have no number (§3).
//!
//! ```text
//!     Down ── connected ──► Idle ── request ──► Sending ── transmit ──► Awaiting
//!                            ▲                     │ abort                 │
//!                            └─────────────────────┴───────────────────────┤ its reply
//!                                                                          │
//!     Ended ◄── CLO agreed, silence, abort, anything but its reply ────────┘
//! ```
//!
//! Every transition of the connection that the model takes:
//!
#![doc = include_str!("../../diagrams/central.md")]

use core::time::Duration;

use robot_session::Unexpected;

use super::config::{CentralConfig, CentralRule as Rule};
use super::event::{CentralEvent as Event, Closing, Miss, Progress, Unfinished};
use crate::error::DecodeError;
use crate::message::{Command, Mode, Reply, Status};
use crate::pose::Pose;

/// The central controller's end of one device's connections.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct CentralMachine<P> {
    /// The connection and the command on it.
    pub link: CentralLink<P>,
    /// The motion that was commanded last on this connection.
    pub motion: Motion<P>,
}

/// The connection and the command on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum CentralLink<P> {
    /// There is no connection.
    Down,
    /// A command may be requested.
    Idle,
    /// A command is to be sent.
    Sending {
        /// The command.
        command: Command<P>,
    },
    /// A command was sent.
    Awaiting {
        /// The command.
        command: Command<P>,
        /// When its reply is overdue.
        deadline: Duration,
    },
    /// The connection has ended, and its owner is to close it.
    Ended,
}

/// The motion that was commanded last on this connection.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Motion<P> {
    /// The device has accepted a motion and has not been seen moving.
    Starting {
        /// Where to.
        target: Target<P>,
        /// When a status is asked for whose "at rest" is believed.
        believed_from: Duration,
    },
    /// It has been seen moving, or has had the time to begin.
    Moving {
        /// Where to.
        target: Target<P>,
    },
    /// It has accepted a halt and has not been seen at rest.
    Stopping,
    /// It is not known to move.
    Rest {
        /// Where it should be.
        target: Target<P>,
        /// Where it is, since it accepted a motion last.
        pose: Place<P>,
    },
}

/// Where a motion leads.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Target<P> {
    /// There is no motion.
    None,
    /// Only the device knows.
    Unknown,
    /// Here.
    At(P),
}

/// Where a device is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Place<P> {
    /// It is not known.
    Unknown,
    /// Here.
    At(P),
}

/// What happens at the central controller's end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum CentralInput<P> {
    /// A connection was made.
    Connected,
    /// The connection is gone.
    Disconnected,
    /// The caller requests a command.
    Request(Command<P>),
    /// The caller aborts the command.
    Abort,
    /// Bytes can be sent.
    Transmit,
    /// A well-formed reply.
    Reply(Reply<P>),
    /// A line that is no reply.
    Corrupt(DecodeError),
    /// The deadline may have come.
    Due,
}

/// What the session is to do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum CentralAction<P> {
    /// Nothing.
    None,
    /// Send this command.
    Send(Command<P>),
    /// Report this.
    Report(Event<P>),
}

type Step<P> = Result<CentralAction<P>, Unexpected>;

impl<P: Pose> CentralMachine<P> {
    /// Without a connection.
    pub const NEW: Self = Self { link: CentralLink::Down, motion: Motion::NONE };

    /// Takes an input, and returns what is to be done.
    ///
    /// # Errors
    /// The state does not allow this input, and nothing has changed: a request while another command is not finished or
    /// without a connection, bytes without a connection.
    #[inline]
    pub fn on(&mut self, now: Duration, input: CentralInput<P>, config: &CentralConfig) -> Step<P> {
        use CentralAction as A;
        use CentralInput as I;
        use CentralLink as L;
        Ok(match (&self.link, &input) {
            (&L::Awaiting { command, .. }, I::Reply(reply)) => self.reply(now, command, reply, config),
            (&L::Sending { command }, I::Transmit) => {
                self.link = L::Awaiting { command, deadline: now.saturating_add(config.timeout) };
                self.ask(now, command);
                A::Send(command)
            }
            (L::Idle, &I::Request(command)) => {
                self.link = L::Sending { command };
                A::None
            }
            (L::Awaiting { deadline, .. }, I::Due) if now >= *deadline => self.end(Closing::Timeout, config),
            (&L::Sending { command }, I::Abort) => {
                self.link = L::Idle;
                A::Report(Event::Aborted { command })
            }
            (&L::Awaiting { command, .. }, I::Abort) if !config.keeps(Rule::AbortEnds) => {
                self.link = L::Idle;
                A::Report(Event::Aborted { command })
            }
            (L::Awaiting { .. }, I::Abort) => self.end(Closing::Aborted, config),
            (L::Idle | L::Sending { .. }, I::Reply(_)) if !config.keeps(Rule::StrayEnds) => A::None,
            // The next one could be taken for another command's.
            (L::Idle | L::Sending { .. }, I::Reply(_)) => self.end(Closing::Mismatch, config),
            (L::Idle | L::Sending { .. } | L::Awaiting { .. }, I::Corrupt(error)) => {
                self.end(Closing::Malformed(*error), config)
            }
            (L::Down | L::Ended, I::Connected) => {
                self.open(config);
                A::None
            }
            (L::Idle | L::Sending { .. } | L::Awaiting { .. }, I::Connected) => {
                let action = self.end(Closing::Disconnected, config);
                self.open(config);
                action
            }
            (L::Down | L::Ended, I::Disconnected) => {
                self.link = L::Down;
                A::None
            }
            (L::Idle | L::Sending { .. } | L::Awaiting { .. }, I::Disconnected) => {
                let action = self.end(Closing::Disconnected, config);
                self.link = L::Down;
                action
            }
            // What still arrives on a connection that has ended.
            (L::Ended, I::Reply(_) | I::Corrupt(_)) => A::None,
            (L::Down | L::Idle | L::Sending { .. } | L::Awaiting { .. } | L::Ended, I::Due) => A::None,
            (L::Down | L::Idle | L::Awaiting { .. } | L::Ended, I::Transmit) => A::None,
            (L::Down | L::Idle | L::Ended, I::Abort) => A::None,
            (L::Down | L::Sending { .. } | L::Awaiting { .. } | L::Ended, I::Request(_))
            | (L::Down, I::Reply(_) | I::Corrupt(_)) => {
                return Err(Unexpected { state: self.name(), input: input.name() });
            }
        })
    }

    /// When [`CentralInput::Due`] is to come.
    pub const fn deadline(&self) -> Option<Duration> {
        match self.link {
            CentralLink::Awaiting { deadline, .. } => Some(deadline),
            CentralLink::Down | CentralLink::Idle | CentralLink::Sending { .. } | CentralLink::Ended => None,
        }
    }

    /// Every time in the state; each is a deadline.
    pub fn each_time(&mut self, mut f: impl FnMut(&mut Duration)) {
        if let CentralLink::Awaiting { deadline, .. } = &mut self.link {
            f(deadline);
        }
        if let Motion::Starting { believed_from, .. } = &mut self.motion {
            f(believed_from);
        }
    }

    /// The name of the connection's state.
    pub const fn name(&self) -> &'static str {
        match self.link {
            CentralLink::Down => "Down",
            CentralLink::Idle => "Idle",
            CentralLink::Sending { .. } => "Sending",
            CentralLink::Awaiting { .. } => "Awaiting",
            CentralLink::Ended => "Ended",
        }
    }

    fn open(&mut self, config: &CentralConfig) {
        self.link = CentralLink::Idle;
        if config.keeps(Rule::ForgetMotion) {
            self.motion = Motion::NONE;
        }
    }

    fn end(&mut self, reason: Closing, config: &CentralConfig) -> CentralAction<P> {
        let unfinished = match self.link {
            CentralLink::Sending { command } => Unfinished::NotSent(command),
            CentralLink::Awaiting { command, .. } if config.keeps(Rule::UnknownWhenSent) => {
                Unfinished::Unknown(command)
            }
            CentralLink::Awaiting { command, .. } => Unfinished::NotSent(command),
            CentralLink::Down | CentralLink::Idle | CentralLink::Ended => Unfinished::Nothing,
        };
        self.link = CentralLink::Ended;
        CentralAction::Report(Event::Closed { reason, unfinished })
    }

    fn reply(
        &mut self,
        now: Duration,
        command: Command<P>,
        reply: &Reply<P>,
        config: &CentralConfig,
    ) -> CentralAction<P> {
        let event = match (&command, reply) {
            (_, &Reply::Error { error }) => Event::Refused { command, error },
            (Command::Status, Reply::Status(status)) => {
                Event::Status { status: *status, motion: self.observe(status, config) }
            }
            (Command::Status, Reply::Ok) | (_, Reply::Status(_)) => {
                return self.end(Closing::Mismatch, config);
            }
            (Command::Close, Reply::Ok) => {
                self.link = CentralLink::Ended;
                let (reason, unfinished) = (Closing::Agreed, Unfinished::Nothing);
                return CentralAction::Report(Event::Closed { reason, unfinished });
            }
            (_, Reply::Ok) => {
                self.agree(now, command, config);
                Event::Done { command }
            }
        };
        self.link = CentralLink::Idle;
        CentralAction::Report(event)
    }

    /// The device has agreed to a command.
    fn agree(&mut self, now: Duration, command: Command<P>, config: &CentralConfig) {
        let believed_from = now.saturating_add(config.settle);
        self.motion = match (command, self.motion) {
            (Command::Move { mode: Mode::Absolute, pose }, _) => {
                Motion::Starting { target: Target::At(pose), believed_from }
            }
            (
                Command::Move { mode: Mode::Relative, pose: by },
                Motion::Rest { pose: Place::At(pose), .. },
            ) => {
                let target = pose.plus(by).map_or(Target::Unknown, Target::At);
                Motion::Starting { target, believed_from }
            }
            (Command::Move { mode: Mode::Relative, .. } | Command::Reset, _) => {
                Motion::Starting { target: Target::Unknown, believed_from }
            }
            (Command::Stop | Command::Servo { on: false }, motion) if !config.keeps(Rule::ForgetTarget) => {
                motion
            }
            (Command::Stop | Command::Servo { on: false }, Motion::Rest { pose, .. }) => {
                Motion::Rest { target: Target::None, pose }
            }
            (
                Command::Stop | Command::Servo { on: false },
                Motion::Starting { .. } | Motion::Moving { .. } | Motion::Stopping,
            ) => Motion::Stopping,
            (
                Command::Status
                | Command::Servo { on: true }
                | Command::Override { .. }
                | Command::Close
                | Command::Acquire { .. }
                | Command::Grip { .. },
                motion,
            ) => motion,
        };
    }

    /// A status is not older than the question: one that is asked for late enough is believed, however long its reply takes.
    fn ask(&mut self, now: Duration, command: Command<P>) {
        if let (Command::Status, Motion::Starting { target, believed_from }) = (command, self.motion)
            && now >= believed_from
        {
            self.motion = Motion::Moving { target };
        }
    }

    fn observe(&mut self, status: &Status<P>, config: &CentralConfig) -> Progress {
        let (motion, progress) = match (self.motion, status.moving) {
            (Motion::Stopping, true) => (Motion::Stopping, Progress::Stopping),
            (
                Motion::Starting { target, .. } | Motion::Moving { target } | Motion::Rest { target, .. },
                true,
            ) => (Motion::Moving { target }, Progress::Moving),
            (motion, false) => {
                let target = match motion {
                    Motion::Starting { target, .. }
                    | Motion::Moving { target }
                    | Motion::Rest { target, .. } => target,
                    Motion::Stopping => Target::None,
                };
                match (motion, target.judge(status, config)) {
                    (Motion::Starting { .. }, Progress::Still | Progress::Missed(_)) => {
                        (motion, Progress::Starting)
                    }
                    (_, progress) => (Motion::Rest { target, pose: Place::At(status.pose) }, progress),
                }
            }
        };
        self.motion = motion;
        progress
    }
}

impl<P> Motion<P> {
    /// Nothing is known.
    pub const NONE: Self = Self::Rest { target: Target::None, pose: Place::Unknown };
}

impl<P: Pose> Target<P> {
    /// What it means that a device is at rest.
    fn judge(self, status: &Status<P>, config: &CentralConfig) -> Progress {
        let servo = status.servo || !config.keeps(Rule::ServoOn);
        match self {
            Self::None => Progress::Still,
            Self::Unknown | Self::At(_) if !servo => Progress::Missed(Miss::ServoOff),
            Self::Unknown => Progress::Still,
            Self::At(pose) if status.pose.is_near(pose, config.tolerance) => Progress::Arrived,
            Self::At(_) => Progress::Missed(Miss::Elsewhere),
        }
    }
}

impl<P> CentralInput<P> {
    /// The name of the input.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Connected => "Connected",
            Self::Disconnected => "Disconnected",
            Self::Request(_) => "Request",
            Self::Abort => "Abort",
            Self::Transmit => "Transmit",
            Self::Reply(_) => "Reply",
            Self::Corrupt(_) => "Corrupt",
            Self::Due => "Due",
        }
    }
}
