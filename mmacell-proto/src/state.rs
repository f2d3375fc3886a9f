//! Every transition of the sessions. Nothing here knows of bytes.
//!
//! The connection, as the controller keeps it: one outstanding command (§3).
//!
//! ```text
//!          send                     send CLO
//!        ┌────────────── Idle ──────────────────┐
//!        ▼                ▲ ▲                   ▼
//!     Waiting ────────────┘ └────────────── Leaving
//!        │     OK or ER           ER            │ OK
//!        │                                      ▼
//!        └────────── broken ───────────────► Closed
//! ```
//!
//! Whether the device moves, as the controller believes: `OK` to a motion says that it has started, but the first status
//! behind it may still say that the device stands (§4.4).
//!
//! ```text
//!     Still ── started ──► Starting ── seen moving ──► Moving
//!       ▲                     │ seen still, and that is believed │ seen still
//!       └─────────────────────┴──────────────────────────────────┘
//!                 (a halt leads to Stopping, where seen still is always believed)
//! ```
//!
//! The device (§4.2 to §4.7):
//!
//! ```text
//!     Off ── servo on ──► Still ── move ──► Moving ── stop ──► Stopping
//!      ▲                  │ ▲ ▲              │ arrived            │ arrived
//!      └──── servo off ───┘ │ └──────────────┴────────────────────┘
//!                           │
//!     reset leads from everywhere to Moving, homewards; failed to Fault, which only a reset leaves
//! ```

/// The connection, as the controller keeps it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Connection {
    /// A command may be sent.
    Idle,
    /// A command is outstanding.
    Waiting,
    /// `CLO` is outstanding.
    Leaving,
    /// Nothing is sent or heard any more.
    Closed,
}

/// What happens to the connection.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ConnectionEvent {
    /// The caller sends a command other than `CLO`.
    Send,
    /// The caller sends `CLO`.
    SendClose,
    /// The device answers `OK`, with the data that belong to the command.
    Done,
    /// The device answers `ER`.
    Refused,
    /// No reply in time, something that is no such reply, or the end of the connection: replies cannot be matched again.
    Broken,
}

impl Connection {
    /// Every state.
    pub const ALL: [Self; 4] = [Self::Idle, Self::Waiting, Self::Leaving, Self::Closed];

    /// The state behind an event; `None` when the caller asks for what is not possible now.
    pub const fn next(self, event: ConnectionEvent) -> Option<Self> {
        use ConnectionEvent as E;
        Some(match (self, event) {
            (Self::Idle, E::Send) => Self::Waiting,
            (Self::Idle, E::SendClose) => Self::Leaving,
            (Self::Waiting | Self::Leaving | Self::Closed, E::Send | E::SendClose) => return None,
            (Self::Waiting, E::Done | E::Refused) | (Self::Leaving, E::Refused) => Self::Idle,
            (Self::Leaving, E::Done) => Self::Closed,
            // A reply that nobody asked for: the next one could be taken for another command's.
            (Self::Idle | Self::Closed, E::Done | E::Refused) => Self::Closed,
            (Self::Idle | Self::Waiting | Self::Leaving | Self::Closed, E::Broken) => Self::Closed,
        })
    }
}

impl ConnectionEvent {
    /// Every event.
    pub const ALL: [Self; 5] = [Self::Send, Self::SendClose, Self::Done, Self::Refused, Self::Broken];
}

/// Whether the device moves, as the controller believes.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub enum Motion {
    /// It stands.
    #[default]
    Still,
    /// It has accepted a motion and has not been seen moving.
    Starting,
    /// It has been seen moving.
    Moving,
    /// It has accepted a halt and has not been seen standing.
    Stopping,
}

/// What the controller learns about motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum MotionEvent {
    /// `OK` to `MOV` or `RST`.
    Started,
    /// `OK` to `STP` or to servo off.
    Halted,
    /// A status says that it moves.
    SeenMoving,
    /// A status says that it stands, where it should, or late enough after the start to be believed.
    SeenStill,
    /// A status says that it stands, elsewhere than it should and soon after the start.
    SeenStillTooSoon,
}

impl Motion {
    /// Every state.
    pub const ALL: [Self; 4] = [Self::Still, Self::Starting, Self::Moving, Self::Stopping];

    /// The state behind an event.
    pub const fn next(self, event: MotionEvent) -> Self {
        use MotionEvent as E;
        match (self, event) {
            (Self::Still | Self::Starting | Self::Moving | Self::Stopping, E::Started) => Self::Starting,
            (Self::Still, E::Halted) => Self::Still,
            (Self::Starting | Self::Moving | Self::Stopping, E::Halted) => Self::Stopping,
            (Self::Still | Self::Starting | Self::Moving, E::SeenMoving) => Self::Moving,
            (Self::Stopping, E::SeenMoving) => Self::Stopping,
            (Self::Still | Self::Starting | Self::Moving | Self::Stopping, E::SeenStill) => Self::Still,
            (Self::Starting, E::SeenStillTooSoon) => Self::Starting,
            (Self::Still | Self::Moving | Self::Stopping, E::SeenStillTooSoon) => Self::Still,
        }
    }
}

impl MotionEvent {
    /// Every event.
    pub const ALL: [Self; 5] =
        [Self::Started, Self::Halted, Self::SeenMoving, Self::SeenStill, Self::SeenStillTooSoon];
}

/// A device.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub enum DeviceState {
    /// Servo motors off.
    #[default]
    Off,
    /// Servo motors on, standing.
    Still,
    /// In a motion, or on its way home.
    Moving,
    /// Told to stop, and not standing yet.
    Stopping,
    /// An error occurred: standing, servo motors off.
    Fault,
}

/// What happens to a device.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum DeviceEvent {
    /// `SRVON`
    ServoOn,
    /// `SRVOF`
    ServoOff,
    /// `MOV`
    Move,
    /// `STP`
    Stop,
    /// `RST`
    Reset,
    /// The axes stand.
    Arrived,
    /// An error occurred.
    Failed,
}

impl DeviceState {
    /// Every state.
    pub const ALL: [Self; 5] = [Self::Off, Self::Still, Self::Moving, Self::Stopping, Self::Fault];

    /// The state behind an event; `None` when a device refuses the command in this state, which the source leaves open.
    pub const fn next(self, event: DeviceEvent) -> Option<Self> {
        use DeviceEvent as E;
        Some(match (self, event) {
            (Self::Off | Self::Still, E::ServoOn) => Self::Still,
            (Self::Moving, E::ServoOn) => Self::Moving,
            (Self::Stopping, E::ServoOn) => Self::Stopping,
            (Self::Off | Self::Still | Self::Moving | Self::Stopping, E::ServoOff) => Self::Off,
            (Self::Still, E::Move) => Self::Moving,
            (Self::Off | Self::Moving | Self::Stopping, E::Move) => return None,
            (Self::Off, E::Stop | E::Arrived) => Self::Off,
            (Self::Still, E::Stop | E::Arrived) => Self::Still,
            (Self::Moving | Self::Stopping, E::Stop) => Self::Stopping,
            (Self::Moving | Self::Stopping, E::Arrived) => Self::Still,
            (Self::Fault, E::ServoOn | E::Move) => return None,
            (Self::Fault, E::ServoOff | E::Stop | E::Arrived) => Self::Fault,
            (Self::Off | Self::Still | Self::Moving | Self::Stopping | Self::Fault, E::Reset) => Self::Moving,
            (Self::Off | Self::Still | Self::Moving | Self::Stopping | Self::Fault, E::Failed) => Self::Fault,
        })
    }

    /// Whether the servo motors are on.
    pub const fn servo(self) -> bool {
        matches!(self, Self::Still | Self::Moving | Self::Stopping)
    }

    /// Whether a motion is going on.
    pub const fn moving(self) -> bool {
        matches!(self, Self::Moving | Self::Stopping)
    }
}

impl DeviceEvent {
    /// Every event.
    pub const ALL: [Self; 7] =
        [Self::ServoOn, Self::ServoOff, Self::Move, Self::Stop, Self::Reset, Self::Arrived, Self::Failed];
}
