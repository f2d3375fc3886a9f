//! Every rule of the device's end. Nothing here knows of bytes, and nothing of time: a device has no deadlines.
//!
//! The connection: a command is read when the reply to the previous one has been sent.
//!
//! ```text
//!     Down ── connected ──► Idle ── command ──► Asked ── accept, refuse ──► Answering
//!                            ▲ └── status, refused by the protocol ───────────┘ │
//!                            └─────────────────── sent ─────────────────────────┘
//!     Asked ── accept CLO ──► Leaving ── sent ──► Ended
//! ```
//!
//! The axes (§4.2 to §4.7):
//!
//! ```text
//!     Off ── servo on ──► Still ── move ──► Moving ── stop ──► Stopping
//!      ▲                  │ ▲ ▲              │ arrived            │ arrived
//!      └──── servo off ───┘ │ └──────────────┴────────────────────┘
//!                           │
//!     reset leads from everywhere to Moving, homewards; failed to Fault, which only a reset leaves
//! ```
//!
//! Every transition of the connection that the model takes:
//!
#![doc = include_str!("../../diagrams/device.md")]

use core::time::Duration;

use robot_session::Unexpected;
use robot_session::end::{Expiry, Machine};

use super::config::{DeviceConfig, Rule};
use super::event::{DeviceClosing, DeviceEvent as Event, Order, Rejection};
use crate::error::DecodeError;
use crate::message::{Command, ErrorCode, Mode, Reply, Status};
use crate::pose::Pose;

/// The end of a device.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct DeviceMachine<P> {
    /// The connection and the command on it.
    pub link: DeviceLink<P>,
    /// The state of the axes.
    pub axes: Axes,
    /// The pose of the axes; `None` if it is unknown or has no form on the wire.
    pub pose: Option<P>,
    /// The override: the speed of all motions, 0 to 100 %.
    pub percent: u8,
}

/// The connection and the command on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum DeviceLink<P> {
    /// There is no connection.
    Down,
    /// A command can be read.
    Idle,
    /// The owner has to accept or refuse an order.
    Asked {
        /// The order that waits.
        order: Order<P>,
    },
    /// A reply is to be sent.
    Answering {
        /// The reply that is due.
        reply: Reply<P>,
    },
    /// The reply to `CLO` is to be sent, and then the connection ends.
    Leaving,
    /// The connection has ended, and its owner is to close it.
    Ended,
}

/// The state of the axes.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub enum Axes {
    /// The servo motors are off.
    #[default]
    Off,
    /// The servo motors are on, and the axes are at rest.
    Still,
    /// The axes are in a motion, or on the way home.
    Moving,
    /// The axes are stopping, and not at rest yet.
    Stopping,
    /// An error occurred: at rest, servo motors off.
    Fault {
        /// The error that the status shows.
        error: ErrorCode,
    },
}

/// An input at the device's end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Input<P> {
    /// The caller has made a connection.
    Connected,
    /// The caller reports that the connection is gone.
    Disconnected,
    /// A deadline may have passed.
    Timeout,
    /// A well-formed command has come.
    Command(Command<P>),
    /// A line that is not a command.
    Corrupt(DecodeError),
    /// More commands than can be kept.
    Overrun,
    /// The owner accepts an order.
    Accept(Order<P>),
    /// The owner refuses an order.
    Refuse(Order<P>, ErrorCode),
    /// The reply that was due is sent.
    Sent,
    /// The new pose of the axes; `None` if it is unknown or has no form on the wire.
    Pose(Option<P>),
    /// The axes are at rest.
    Arrived,
    /// An error of the device occurred.
    Failed(ErrorCode),
}

/// An action for the session.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Action<P> {
    /// The session has nothing to do.
    Nothing,
    /// The connection begins.
    Connected,
    /// The next command can be read.
    Sent,
    /// The reply to `CLO` was sent: it reports the end of the connection.
    Left,
    /// Reports an event to the owner.
    Report(Event<P>),
}

robot_session::inputs!(
    Input<P: Pose>: Command, Corrupt, Overrun, Accept, Refuse, Sent, Pose, Arrived, Failed
);

impl<P: Pose> Machine for DeviceMachine<P> {
    const END: &'static str = "device";
    const EXPIRY: Expiry = Expiry::Last;
    type Input = Input<P>;
    type Action = Action<P>;
    type Transmit = Reply<P>;
    type Config = DeviceConfig;

    /// # Errors
    /// A command that is read while another one is not answered or without a connection, an order accepted or refused that is not
    /// pending, a reply sent that was not due.
    #[inline]
    fn on(
        &mut self,
        _now: Duration,
        input: Input<P>,
        config: &DeviceConfig,
    ) -> Result<Action<P>, Unexpected> {
        use Action as A;
        use DeviceLink as L;
        use Input as I;
        Ok(match (&self.link, &input) {
            (L::Idle, &I::Command(command)) => match self.read(command, config) {
                Ok(action) => action,
                Err(reason) => self.reject(reason, config),
            },
            (L::Idle, &I::Corrupt(error)) => self.reject(Rejection::Malformed(error), config),
            (L::Answering { .. }, I::Sent) => {
                self.link = L::Idle;
                A::Sent
            }
            (L::Leaving, I::Sent) => {
                self.link = L::Ended;
                A::Left
            }
            (&L::Asked { order }, I::Accept(accepted))
                if order == *accepted || !config.keeps(Rule::AcceptPending) =>
            {
                self.accept(order, config)
            }
            (L::Asked { order }, &I::Refuse(refused, error)) if *order == refused => {
                self.link = L::Answering { reply: Reply::Error { error } };
                A::Nothing
            }
            (L::Answering { .. } | L::Leaving | L::Asked { .. }, I::Connected)
                if !config.keeps(Rule::TakeOver) =>
            {
                A::Nothing
            }
            (
                L::Down | L::Idle | L::Asked { .. } | L::Answering { .. } | L::Leaving | L::Ended,
                I::Connected,
            ) => {
                self.link = L::Idle;
                A::Connected
            }
            (
                L::Down | L::Idle | L::Asked { .. } | L::Answering { .. } | L::Leaving | L::Ended,
                I::Disconnected,
            ) => {
                self.link = L::Down;
                A::Nothing
            }
            (L::Idle | L::Asked { .. } | L::Answering { .. } | L::Leaving, I::Overrun) => {
                self.link = L::Ended;
                A::Report(Event::Closed { reason: DeviceClosing::Overrun })
            }
            (
                L::Down | L::Idle | L::Asked { .. } | L::Answering { .. } | L::Leaving | L::Ended,
                I::Pose(pose),
            ) => {
                self.pose = *pose;
                A::Nothing
            }
            (
                L::Down | L::Idle | L::Asked { .. } | L::Answering { .. } | L::Leaving | L::Ended,
                I::Arrived,
            ) => {
                self.axes = self.axes.arrived();
                A::Nothing
            }
            (
                L::Down | L::Idle | L::Asked { .. } | L::Answering { .. } | L::Leaving | L::Ended,
                I::Failed(error),
            ) => {
                self.axes = Axes::Fault { error: *error };
                A::Nothing
            }
            (
                L::Down | L::Idle | L::Asked { .. } | L::Answering { .. } | L::Leaving | L::Ended,
                I::Timeout,
            ) => A::Nothing,
            // Ignore lines that still arrive on a connection that has ended.
            (L::Ended, I::Command(_) | I::Corrupt(_) | I::Overrun) => A::Nothing,
            (L::Down | L::Asked { .. } | L::Answering { .. } | L::Leaving, I::Command(_) | I::Corrupt(_))
            | (L::Down, I::Overrun)
            | (L::Down | L::Idle | L::Asked { .. } | L::Ended, I::Sent)
            | (
                L::Down | L::Idle | L::Asked { .. } | L::Answering { .. } | L::Leaving | L::Ended,
                I::Accept(_) | I::Refuse(..),
            ) => {
                return Err(self.unexpected(&input));
            }
        })
    }

    #[inline]
    fn transmit(&self, _now: Duration, _config: &DeviceConfig) -> Option<Reply<P>> {
        match self.link {
            DeviceLink::Answering { reply } => Some(reply),
            DeviceLink::Leaving => Some(Reply::Ok),
            DeviceLink::Down | DeviceLink::Idle | DeviceLink::Asked { .. } | DeviceLink::Ended => None,
        }
    }

    fn deadline(&self) -> Option<Duration> {
        None
    }

    fn expires(&self, _now: Duration) -> bool {
        false
    }

    /// Returns whether commands are read: a command is read when the reply to the previous one has been sent.
    #[inline]
    fn reads(&self) -> bool {
        matches!(self.link, DeviceLink::Idle | DeviceLink::Ended | DeviceLink::Down)
    }

    fn each_time(&mut self, _: impl FnMut(&mut Duration)) {}

    fn name(&self) -> &'static str {
        match self.link {
            DeviceLink::Down => "Down",
            DeviceLink::Idle => "Idle",
            DeviceLink::Asked { .. } => "Asked",
            DeviceLink::Answering { .. } => "Answering",
            DeviceLink::Leaving => "Leaving",
            DeviceLink::Ended => "Ended",
        }
    }
}

impl<P: Pose> DeviceMachine<P> {
    /// Without a connection, servo motors off, the override at 100 %, its pose unknown.
    pub const NEW: Self = Self { link: DeviceLink::Down, axes: Axes::Off, pose: None, percent: 100 };

    /// Returns the device's status; `None` while its pose is unknown.
    pub fn status(&self) -> Option<Status<P>> {
        Some(Status {
            moving: self.axes.moving(),
            pose: self.pose?,
            servo: self.axes.servo(),
            percent: self.percent,
            error: self.axes.error(),
        })
    }

    fn read(&mut self, command: Command<P>, config: &DeviceConfig) -> Result<Action<P>, Rejection> {
        let order = match command {
            Command::Status => {
                let status = self.status().ok_or(Rejection::NoPose)?;
                self.link = DeviceLink::Answering { reply: Reply::Status(status) };
                return Ok(Action::Nothing);
            }
            Command::Servo { on } => Order::Servo { on },
            Command::Override { percent } => Order::Override { percent },
            Command::Move { mode: Mode::Absolute, pose } => Order::Move { target: pose },
            Command::Move { mode: Mode::Relative, pose: by } => {
                let from = self.pose.ok_or(Rejection::NoPose)?;
                Order::Move { target: from.plus(by).ok_or(Rejection::OutOfRange)? }
            }
            Command::Stop => Order::Stop,
            Command::Reset => Order::Home,
            Command::Close => Order::Close,
            Command::Acquire { camera } => Order::Acquire { camera },
            Command::Grip { gripper, open } => Order::Grip { gripper, open },
        };
        self.axes.after(order, config).ok_or(Rejection::NotNow { state: self.axes.name() })?;
        self.link = DeviceLink::Asked { order };
        Ok(Action::Report(Event::Asked { order }))
    }

    fn accept(&mut self, order: Order<P>, config: &DeviceConfig) -> Action<P> {
        let possible = self.axes.after(order, config);
        let axes = match possible {
            Some(axes) => axes,
            None if config.keeps(Rule::AcceptPossible) => {
                return self.reject(Rejection::NotNow { state: self.axes.name() }, config);
            }
            None => Axes::Moving,
        };
        // The state changes before the reply is sent: a status requested after `OK` shows that the device moves.
        self.axes = axes;
        if let Order::Override { percent } = order {
            self.percent = percent;
        }
        self.link = match order {
            Order::Close => DeviceLink::Leaving,
            Order::Servo { .. }
            | Order::Override { .. }
            | Order::Move { .. }
            | Order::Stop
            | Order::Home
            | Order::Acquire { .. }
            | Order::Grip { .. } => DeviceLink::Answering { reply: Reply::Ok },
        };
        Action::Nothing
    }

    fn reject(&mut self, reason: Rejection, config: &DeviceConfig) -> Action<P> {
        self.link = DeviceLink::Answering { reply: Reply::Error { error: config.refusal } };
        Action::Report(Event::Rejected { reason })
    }
}

impl Axes {
    /// Returns the state of the axes after an order; `None` if they cannot execute it, which the source leaves open.
    pub fn after<P>(self, order: Order<P>, config: &DeviceConfig) -> Option<Self> {
        Some(match (self, order) {
            (Self::Off | Self::Still, Order::Servo { on: true }) => Self::Still,
            (Self::Moving | Self::Stopping, Order::Servo { on: true }) => self,
            (Self::Fault { .. }, Order::Servo { on: true } | Order::Move { .. }) => return None,
            (Self::Off | Self::Still | Self::Moving | Self::Stopping, Order::Servo { on: false }) => {
                Self::Off
            }
            (Self::Still, Order::Move { .. }) => Self::Moving,
            (Self::Moving | Self::Stopping, Order::Move { .. }) if !config.keeps(Rule::OneMotion) => {
                Self::Moving
            }
            (Self::Off, Order::Move { .. }) if !config.keeps(Rule::ServoFirst) => Self::Moving,
            (Self::Off | Self::Moving | Self::Stopping, Order::Move { .. }) => return None,
            (Self::Off | Self::Still | Self::Fault { .. }, Order::Stop)
            | (Self::Fault { .. }, Order::Servo { on: false }) => self,
            (Self::Moving | Self::Stopping, Order::Stop) => Self::Stopping,
            (Self::Off | Self::Still | Self::Moving | Self::Stopping | Self::Fault { .. }, Order::Home) => {
                Self::Moving
            }
            (
                Self::Off | Self::Still | Self::Moving | Self::Stopping | Self::Fault { .. },
                Order::Override { .. } | Order::Close | Order::Acquire { .. } | Order::Grip { .. },
            ) => self,
        })
    }

    /// Returns whether the servo motors are on.
    pub const fn servo(self) -> bool {
        matches!(self, Self::Still | Self::Moving | Self::Stopping)
    }

    /// Returns whether a motion is under way.
    pub const fn moving(self) -> bool {
        matches!(self, Self::Moving | Self::Stopping)
    }

    /// Returns the error that the status shows.
    pub const fn error(self) -> ErrorCode {
        match self {
            Self::Fault { error } => error,
            Self::Off | Self::Still | Self::Moving | Self::Stopping => ErrorCode::None,
        }
    }

    /// Returns the name of the state.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Off => "Off",
            Self::Still => "Still",
            Self::Moving => "Moving",
            Self::Stopping => "Stopping",
            Self::Fault { .. } => "Fault",
        }
    }

    const fn arrived(self) -> Self {
        match self {
            Self::Moving | Self::Stopping => Self::Still,
            Self::Off | Self::Still | Self::Fault { .. } => self,
        }
    }
}
