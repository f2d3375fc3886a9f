//! The states of both ends: every transition, and nothing else.
//!
//! ```text
//! HOST            start                accept                  stop             at zero
//!      Idle ───────────────► Starting ───────► Running ───────────► Stopping ──────────► Silent
//!       ▲  ◄─ decline, stop ────┘  ▲            │  ▲                   │                    │
//!       │                          └── start ───┤  │ motion            │                    │
//!       │                                interruption                  │                    │
//!       │                                       ▼  │                   │                    │
//!       │                                   Interrupted ──── stop ─────►                    │
//!       └────────────────── end, silence: from any state ───────────────────────────────────┘
//!
//! CONTROLLER      start                accept             exception, with a subroutine
//!      Off ────────────────► Starting ────────► Running ─────────────────────────────► Interrupted
//!       ▲  ◄─ refuse, gave up ──┘ ▲│ repeat       │     ◄──────── subroutine returns ──────┘
//!       │                         └┘              │ missing reply, finish,                 │
//!       │                                         ▼ exception without a subroutine         │
//!       └───────────────── end sent ─────────── Ending ◄────────────── the same ───────────┘
//! ```

/// Where a host stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum HostState {
    /// No ALTER.
    Idle,
    /// A start message was heard and is not answered yet.
    Starting,
    /// Every standard message is answered with values.
    Running,
    /// The robot's exception subroutine runs. Messages are answered; the values brake to standstill.
    Interrupted,
    /// The caller wants to stop: the values go to zero within the limits.
    Stopping,
    /// The values were zero: no message is answered any more, and the controller ends ALTER.
    Silent,
}

/// What moves a host.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum HostInput {
    /// A start message.
    Start,
    /// It was answered with accept.
    Accept,
    /// It was answered with refuse, or not at all.
    Decline,
    /// A standard message: ALTER runs.
    Motion,
    /// A standard message: ALTER is interrupted.
    Interruption,
    /// An end message.
    End,
    /// Nothing was heard for several cycles.
    Silence,
    /// The caller wants to stop.
    Stop,
    /// A reply whose values are all zero was sent.
    AtZero,
}

impl HostState {
    /// Every state.
    pub const ALL: [Self; 6] =
        [Self::Idle, Self::Starting, Self::Running, Self::Interrupted, Self::Stopping, Self::Silent];

    /// The next state.
    #[must_use]
    pub const fn on(self, input: HostInput) -> Self {
        use HostInput as I;
        match (self, input) {
            // A message of an ALTER whose start was not heard is not answered: its mode is not known.
            (Self::Idle, I::Motion | I::Interruption) => Self::Idle,
            (Self::Idle, I::Accept | I::Decline | I::Stop | I::AtZero) => Self::Idle,

            (Self::Starting, I::Accept) => Self::Running,
            (Self::Starting, I::Decline | I::Stop) => Self::Idle,
            (Self::Starting, I::Motion | I::Interruption | I::AtZero) => Self::Starting,

            (Self::Running, I::Interruption) => Self::Interrupted,
            (Self::Running, I::Stop) => Self::Stopping,
            (Self::Running, I::Accept | I::Decline | I::Motion | I::AtZero) => Self::Running,

            (Self::Interrupted, I::Motion) => Self::Running,
            (Self::Interrupted, I::Stop) => Self::Stopping,
            (Self::Interrupted, I::Accept | I::Decline | I::Interruption | I::AtZero) => Self::Interrupted,

            (Self::Stopping, I::AtZero) => Self::Silent,
            (Self::Stopping, I::Accept | I::Decline | I::Motion | I::Interruption | I::Stop) => {
                Self::Stopping
            }

            (Self::Silent, I::Accept | I::Decline | I::Motion | I::Interruption | I::Stop | I::AtZero) => {
                Self::Silent
            }

            (
                Self::Idle
                | Self::Starting
                | Self::Running
                | Self::Interrupted
                | Self::Stopping
                | Self::Silent,
                I::Start,
            ) => Self::Starting,
            (
                Self::Idle
                | Self::Starting
                | Self::Running
                | Self::Interrupted
                | Self::Stopping
                | Self::Silent,
                I::End | I::Silence,
            ) => Self::Idle,
        }
    }
}

impl HostInput {
    /// Every input.
    pub const ALL: [Self; 9] = [
        Self::Start,
        Self::Accept,
        Self::Decline,
        Self::Motion,
        Self::Interruption,
        Self::End,
        Self::Silence,
        Self::Stop,
        Self::AtZero,
    ];
}

/// Where a controller stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ControllerState {
    /// No ALTER: the arm stands.
    Off,
    /// Start messages are sent until one is accepted or there were enough.
    Starting,
    /// A standard message is sent each cycle, and the replies move the arm.
    Running,
    /// The same while the exception subroutine runs; the replies move nothing.
    Interrupted,
    /// The end message is sent with the next cycle; the arm stands.
    Ending,
}

/// What moves a controller.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ControllerInput {
    /// The program executes its ALTER instruction.
    Start,
    /// The host accepts.
    Accept,
    /// The host asks for the start message again, or its answer is missing or damaged.
    Repeat,
    /// The host refuses.
    Refuse,
    /// There were enough attempts to start.
    GaveUp,
    /// A reply.
    Reply,
    /// A damaged reply.
    BadReply,
    /// No reply in the window.
    MissingReply,
    /// An exception, and the instruction names a subroutine.
    Exception,
    /// An exception, and it names none: the program is aborted.
    Abort,
    /// The subroutine returns.
    Return,
    /// The program ends ALTER.
    Finish,
    /// The end message was sent.
    EndSent,
}

impl ControllerState {
    /// Every state.
    pub const ALL: [Self; 5] = [Self::Off, Self::Starting, Self::Running, Self::Interrupted, Self::Ending];

    /// The next state.
    #[must_use]
    pub const fn on(self, input: ControllerInput) -> Self {
        use ControllerInput as I;
        match (self, input) {
            (Self::Off, I::Start) => Self::Starting,
            (Self::Off, I::Accept | I::Repeat | I::Refuse | I::GaveUp) => Self::Off,
            (Self::Off, I::Return | I::Finish | I::EndSent) => Self::Off,

            (Self::Starting, I::Accept) => Self::Running,
            (Self::Starting, I::Refuse | I::GaveUp | I::Finish) => Self::Off,
            (Self::Starting, I::Start | I::Repeat | I::Return | I::EndSent) => Self::Starting,

            (Self::Running, I::Exception) => Self::Interrupted,
            (Self::Running, I::Abort | I::MissingReply | I::Finish) => Self::Ending,
            (Self::Running, I::Reply | I::BadReply) => Self::Running,
            (Self::Running, I::Start | I::Accept | I::Repeat | I::Refuse | I::GaveUp) => Self::Running,
            (Self::Running, I::Return | I::EndSent) => Self::Running,

            (Self::Interrupted, I::Return) => Self::Running,
            (Self::Interrupted, I::MissingReply | I::Finish) => Self::Ending,
            // The subroutine runs already; a second exception does not start it again.
            (Self::Interrupted, I::Reply | I::BadReply | I::Exception | I::Abort) => Self::Interrupted,
            (Self::Interrupted, I::Start | I::Accept | I::Repeat | I::Refuse | I::GaveUp | I::EndSent) => {
                Self::Interrupted
            }

            (Self::Ending, I::EndSent) => Self::Off,
            (Self::Ending, I::Start | I::Accept | I::Repeat | I::Refuse | I::GaveUp) => Self::Ending,
            (Self::Ending, I::Return | I::Finish) => Self::Ending,

            (
                Self::Off | Self::Starting | Self::Ending,
                I::Reply | I::BadReply | I::MissingReply | I::Exception | I::Abort,
            ) => self,
        }
    }
}

impl ControllerInput {
    /// Every input.
    pub const ALL: [Self; 13] = [
        Self::Start,
        Self::Accept,
        Self::Repeat,
        Self::Refuse,
        Self::GaveUp,
        Self::Reply,
        Self::BadReply,
        Self::MissingReply,
        Self::Exception,
        Self::Abort,
        Self::Return,
        Self::Finish,
        Self::EndSent,
    ];
}
