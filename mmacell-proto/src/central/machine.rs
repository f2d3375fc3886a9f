//! Every rule of the central controller's end. Bytes are decoded elsewhere.
//!
//! The connection: one command is outstanding at a time, because replies have no number (§3).
//!
//! ```text
//!     Down ── connected ──► Idle ── request ──► Sending ──── sent ────► Awaiting
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
use robot_session::end::{Expiry, Machine, is_due};

use super::config::{CentralConfig, Rule};
use super::event::{CentralEvent as Event, CloseReason, MissReason, Progress, Unfinished};
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
    /// There is no connection, and commands are refused.
    Down,
    /// A command may be requested.
    Idle,
    /// A command is to be sent.
    Sending {
        /// The command that is due.
        command: Command<P>,
    },
    /// A command was sent, and its reply is awaited.
    Awaiting {
        /// The command that was sent.
        command: Command<P>,
        /// The time at which the reply is overdue.
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
        /// The goal of the motion.
        target: Target<P>,
        /// The time from which a status may report "at rest".
        believed_from: Duration,
    },
    /// The device has been seen moving, or has had the time to begin.
    Moving {
        /// The goal of the motion.
        target: Target<P>,
    },
    /// The device has accepted a halt and has not been seen at rest.
    Stopping,
    /// The device is not known to move.
    Rest {
        /// The goal of the last motion: the pose that the device is expected to have.
        target: Target<P>,
        /// The pose of the device since it accepted a motion last.
        pose: KnownPose<P>,
    },
}

/// The goal of a motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Target<P> {
    /// There is no motion to have a goal.
    None,
    /// A pose that only the device knows.
    Unknown,
    /// A pose, which the device's status is compared with.
    At(P),
}

/// The pose of a device.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum KnownPose<P> {
    /// The pose is not known.
    Unknown,
    /// A known pose.
    At(P),
}

/// An input at the central controller's end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Input<P> {
    /// The caller has made a connection.
    Connected,
    /// The caller reports that the connection is gone.
    Disconnected,
    /// A deadline may have passed.
    Timeout,
    /// The caller requests a command.
    Request(Command<P>),
    /// The caller aborts the command.
    Abort,
    /// A well-formed reply has come.
    Reply(Reply<P>),
    /// A line that is not a reply.
    Corrupt(DecodeError),
    /// The command that was due is sent.
    Sent,
}

/// An action for the session.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Action<P> {
    /// The session has nothing to do.
    Nothing,
    /// The connection begins: the caller gets an event.
    Connected {
        /// The event to report about the previous connection; `None` if there is nothing to report.
        before: Option<Event<P>>,
    },
    /// The reply to the sent command is awaited.
    Sent,
    /// Reports an event to the caller.
    Report(Event<P>),
}

robot_session::inputs!(Input<P: Pose>: Request, Abort, Reply, Corrupt, Sent);

impl<P: Pose> Machine for CentralMachine<P> {
    const END: &'static str = "central";
    /// A reply that has waited for a late caller still counts.
    const EXPIRY: Expiry = Expiry::Last;
    type Input = Input<P>;
    type Action = Action<P>;
    type Transmit = Command<P>;
    type Config = CentralConfig;

    /// # Errors
    /// A request while another command is not finished or without a connection, bytes without a connection, a command sent
    /// that was not due.
    #[inline(always)] // where the input is known, little of it is left
    fn on(
        &mut self,
        now: Duration,
        input: Input<P>,
        config: &CentralConfig,
    ) -> Result<Action<P>, Unexpected> {
        use Action as A;
        use CentralLink as L;
        use Input as I;
        Ok(match (&self.link, &input) {
            (&L::Awaiting { command, .. }, I::Reply(reply)) => self.reply(now, command, reply, config),
            (&L::Sending { command }, I::Sent) => {
                self.link = L::Awaiting { command, deadline: now.saturating_add(config.timeout) };
                self.ask(now, command);
                A::Sent
            }
            (L::Idle, &I::Request(command)) => {
                self.link = L::Sending { command };
                A::Nothing
            }
            (L::Awaiting { deadline, .. }, I::Timeout) if is_due(*deadline, now) => {
                A::Report(self.end(CloseReason::Timeout, config))
            }
            (&L::Sending { command }, I::Abort) => {
                self.link = L::Idle;
                A::Report(Event::Aborted { command })
            }
            (&L::Awaiting { command, .. }, I::Abort) if !config.keeps(Rule::AbortEnds) => {
                self.link = L::Idle;
                A::Report(Event::Aborted { command })
            }
            (L::Awaiting { .. }, I::Abort) => A::Report(self.end(CloseReason::Aborted, config)),
            (L::Idle | L::Sending { .. }, I::Reply(_)) if !config.keeps(Rule::StrayEnds) => A::Nothing,
            // The next one could be taken for another command's.
            (L::Idle | L::Sending { .. }, I::Reply(_)) => A::Report(self.end(CloseReason::Mismatch, config)),
            (L::Idle | L::Sending { .. } | L::Awaiting { .. }, I::Corrupt(error)) => {
                A::Report(self.end(CloseReason::Malformed(*error), config))
            }
            (L::Down | L::Ended, I::Connected) => {
                self.open(config);
                A::Connected { before: None }
            }
            (L::Idle | L::Sending { .. } | L::Awaiting { .. }, I::Connected) => {
                let before = Some(self.end(CloseReason::Disconnected, config));
                self.open(config);
                A::Connected { before }
            }
            (L::Down | L::Ended, I::Disconnected) => {
                self.link = L::Down;
                A::Nothing
            }
            (L::Idle | L::Sending { .. } | L::Awaiting { .. }, I::Disconnected) => {
                let event = self.end(CloseReason::Disconnected, config);
                self.link = L::Down;
                A::Report(event)
            }
            // Ignore lines that still arrive on a connection that has ended.
            (L::Ended, I::Reply(_) | I::Corrupt(_)) => A::Nothing,
            (L::Down | L::Idle | L::Sending { .. } | L::Awaiting { .. } | L::Ended, I::Timeout) => A::Nothing,
            (L::Down | L::Idle | L::Ended, I::Abort) => A::Nothing,
            (L::Down | L::Sending { .. } | L::Awaiting { .. } | L::Ended, I::Request(_))
            | (L::Down, I::Reply(_) | I::Corrupt(_))
            | (L::Down | L::Idle | L::Awaiting { .. } | L::Ended, I::Sent) => {
                return Err(self.unexpected(&input));
            }
        })
    }

    #[inline]
    fn transmit(&self, _now: Duration, _config: &CentralConfig) -> Option<Command<P>> {
        if let CentralLink::Sending { command } = self.link { Some(command) } else { None }
    }

    #[inline]
    fn deadline(&self) -> Option<Duration> {
        match self.link {
            CentralLink::Awaiting { deadline, .. } if deadline < Duration::MAX => Some(deadline),
            CentralLink::Awaiting { .. }
            | CentralLink::Down
            | CentralLink::Idle
            | CentralLink::Sending { .. }
            | CentralLink::Ended => None,
        }
    }

    #[inline]
    fn expires(&self, now: Duration) -> bool {
        self.deadline().is_some_and(|deadline| now >= deadline)
    }

    fn each_time(&mut self, mut f: impl FnMut(&mut Duration)) {
        if let CentralLink::Awaiting { deadline, .. } = &mut self.link {
            f(deadline);
        }
        if let Motion::Starting { believed_from, .. } = &mut self.motion {
            f(believed_from);
        }
    }

    fn name(&self) -> &'static str {
        match self.link {
            CentralLink::Down => "Down",
            CentralLink::Idle => "Idle",
            CentralLink::Sending { .. } => "Sending",
            CentralLink::Awaiting { .. } => "Awaiting",
            CentralLink::Ended => "Ended",
        }
    }
}

impl<P: Pose> CentralMachine<P> {
    /// Without a connection.
    pub const NEW: Self = Self { link: CentralLink::Down, motion: Motion::NONE };

    fn open(&mut self, config: &CentralConfig) {
        self.link = CentralLink::Idle;
        if config.keeps(Rule::ForgetMotion) {
            self.motion = Motion::NONE;
        }
    }

    fn end(&mut self, reason: CloseReason, config: &CentralConfig) -> Event<P> {
        let unfinished = match self.link {
            CentralLink::Sending { command } => Unfinished::NotSent(command),
            CentralLink::Awaiting { command, .. } if config.keeps(Rule::UnknownWhenSent) => {
                Unfinished::Unknown(command)
            }
            CentralLink::Awaiting { command, .. } => Unfinished::NotSent(command),
            CentralLink::Down | CentralLink::Idle | CentralLink::Ended => Unfinished::Nothing,
        };
        self.link = CentralLink::Ended;
        Event::Closed { reason, unfinished }
    }

    fn reply(
        &mut self,
        now: Duration,
        command: Command<P>,
        reply: &Reply<P>,
        config: &CentralConfig,
    ) -> Action<P> {
        let event = match (&command, reply) {
            (_, &Reply::Error { error }) => Event::Refused { command, error },
            (Command::Status, Reply::Status(status)) => {
                Event::Status { status: *status, motion: self.observe(status, config) }
            }
            (Command::Status, Reply::Ok) | (_, Reply::Status(_)) => {
                return Action::Report(self.end(CloseReason::Mismatch, config));
            }
            (Command::Close, Reply::Ok) => {
                self.link = CentralLink::Ended;
                let (reason, unfinished) = (CloseReason::Agreed, Unfinished::Nothing);
                return Action::Report(Event::Closed { reason, unfinished });
            }
            (_, Reply::Ok) => {
                self.agree(now, command, config);
                Event::Done { command }
            }
        };
        self.link = CentralLink::Idle;
        Action::Report(event)
    }

    /// Called when the device has agreed to a command.
    fn agree(&mut self, now: Duration, command: Command<P>, config: &CentralConfig) {
        let believed_from = now.saturating_add(config.settle);
        self.motion = match (command, self.motion) {
            (Command::Move { mode: Mode::Absolute, pose }, _) => {
                Motion::Starting { target: Target::At(pose), believed_from }
            }
            (
                Command::Move { mode: Mode::Relative, pose: by },
                Motion::Rest { pose: KnownPose::At(pose), .. },
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

    /// Called when a status is requested. A status is not older than its request: a status that is requested late enough is
    /// accepted, however long its reply takes.
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
                    (_, progress) => (Motion::Rest { target, pose: KnownPose::At(status.pose) }, progress),
                }
            }
        };
        self.motion = motion;
        progress
    }
}

impl<P> Motion<P> {
    /// A state in which nothing is known.
    pub const NONE: Self = Self::Rest { target: Target::None, pose: KnownPose::Unknown };
}

impl<P: Pose> Target<P> {
    /// Returns the progress of a device at rest.
    fn judge(self, status: &Status<P>, config: &CentralConfig) -> Progress {
        let servo = status.servo || !config.keeps(Rule::ServoOn);
        match self {
            Self::None => Progress::Still,
            Self::Unknown | Self::At(_) if !servo => Progress::Missed(MissReason::ServoOff),
            Self::Unknown => Progress::Still,
            Self::At(pose) if status.pose.is_near(pose, config.tolerance) => Progress::Arrived,
            Self::At(_) => Progress::Missed(MissReason::Elsewhere),
        }
    }
}
