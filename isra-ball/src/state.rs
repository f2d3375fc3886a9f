//! Every transition of the link. Pure: no bytes, no clock.
//!
//! ```text
//!           PollDue / Poll                      PollDue / PollAgain (the reply is missed)
//!  Idle ─────────────────────▶ Waiting ──┐◀──┐
//!   ▲ └─▶ Packet / Unasked        │      └───┘
//!   └─────────────────────────────┘
//!           Packet / Deliver
//!
//!           Silence / ReportStale
//!  Alive ────────────────────▶ Stale      the sensor, by its fresh packets only
//!    ▲                           │
//!    └───────────────────────────┘
//!           Fresh
//!
//!           Enq / MakeReply
//!  Ready ────────────────────▶ Replying ──┐ Enq / Ignore
//!    ▲                           │   ▲────┘
//!    └───────────────────────────┘
//!           Sent
//! ```

/// The host between two polls.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs, reason = "the diagram shows them")]
pub enum Poll {
    Idle,
    Waiting,
}

/// What happens to a [`Poll`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs, reason = "the diagram shows them")]
pub enum PollInput {
    PollDue,
    Packet,
}

/// What the host does about it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs, reason = "the diagram shows them")]
pub enum PollAction {
    Poll,
    PollAgain,
    Deliver,
    Unasked,
}

/// Whether the sensor gives new values.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs, reason = "the diagram shows them")]
pub enum Sensor {
    Alive,
    Stale,
}

/// What happens to a [`Sensor`]: a fresh packet, or none for too long.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs, reason = "the diagram shows them")]
pub enum SensorInput {
    Fresh,
    Silence,
}

/// What the host does about it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs, reason = "the diagram shows them")]
pub enum SensorAction {
    Nothing,
    ReportStale,
}

/// The ball's side of a poll.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs, reason = "the diagram shows them")]
pub enum Reply {
    Ready,
    Replying,
}

/// What happens to a [`Reply`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs, reason = "the diagram shows them")]
pub enum ReplyInput {
    Enq,
    Sent,
}

/// What the ball does about it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs, reason = "the diagram shows them")]
pub enum ReplyAction {
    Nothing,
    MakeReply,
    Ignore,
}

impl Poll {
    /// The host's next state and what it does.
    pub const fn on(self, input: PollInput) -> (Self, PollAction) {
        match (self, input) {
            (Self::Idle, PollInput::PollDue) => (Self::Waiting, PollAction::Poll),
            (Self::Waiting, PollInput::PollDue) => (Self::Waiting, PollAction::PollAgain),
            (Self::Waiting, PollInput::Packet) => (Self::Idle, PollAction::Deliver),
            (Self::Idle, PollInput::Packet) => (Self::Idle, PollAction::Unasked),
        }
    }
}

impl Sensor {
    /// The sensor's next state and what the host does.
    pub const fn on(self, input: SensorInput) -> (Self, SensorAction) {
        match (self, input) {
            (Self::Alive | Self::Stale, SensorInput::Fresh) => (Self::Alive, SensorAction::Nothing),
            (Self::Alive, SensorInput::Silence) => (Self::Stale, SensorAction::ReportStale),
            (Self::Stale, SensorInput::Silence) => (Self::Stale, SensorAction::Nothing),
        }
    }
}

impl Reply {
    /// The ball's next state and what it does.
    pub const fn on(self, input: ReplyInput) -> (Self, ReplyAction) {
        match (self, input) {
            (Self::Ready, ReplyInput::Enq) => (Self::Replying, ReplyAction::MakeReply),
            (Self::Replying, ReplyInput::Enq) => (Self::Replying, ReplyAction::Ignore),
            (Self::Ready | Self::Replying, ReplyInput::Sent) => (Self::Ready, ReplyAction::Nothing),
        }
    }
}
