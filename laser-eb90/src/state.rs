//! Every transition of the link. Pure: no bytes, no clock.
//!
//! ```text
//! Host:
//!             Send / Transmit             Refusal, RetriedSilence / Prepare
//!   Idle ────────────────────▶ Awaiting ──────────────────────────────────▶ Resending
//!    ▲ ▲                         │  │ ▲                                        │
//!    │ └─────────────────────────┘  │ └────────────────────────────────────────┘
//!    │       Echo / Confirm         │             Send / Transmit
//!    │                              │
//!    │ Resume / Proceed             │ LastRefusal / Refuse
//!    └──────────────────── Held ◀───┘ Silence, OtherWord / Doubt
//!
//! Controller:
//!                 Decided / Answer, Damaged / Answer
//!   Listening ──────────────────────────────────────▶ Answering ──┐ Decided / Answer: the older answer
//!    │  ▲ ▲                Sent / Listen                │  │ ▲ ▲───┘ is withdrawn
//!    │  │ └─────────────────────────────────────────────┘  │ │
//!    │  └─ Damaged, Sent, Done / Ignore                    │ │ Done / Answer
//!    │          Immediate / Execute                        ▼ │
//!    └──────────────────────────────────────────────▶ Executing
//!                                   Immediate / Execute
//! ```

/// The host: one frame at a time, and the next only after the answer to the last (§3(5)).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HostState {
    /// Nothing is on its way.
    Idle,
    /// A frame was sent, its answer has not come.
    Awaiting,
    /// The frame will be sent again when the line has settled.
    Resending,
    /// A frame was refused for good, or its outcome is unknown: nothing is sent until the caller says so.
    Held,
}

/// What happens to the host.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HostInput {
    /// A frame is there and may be sent.
    Send,
    /// The answer repeats the frame's command word.
    Echo,
    /// The answer is an error code, and the frame may be sent again.
    Refusal,
    /// The answer is an error code, once too often.
    LastRefusal,
    /// The answer is another command word.
    OtherWord,
    /// No answer in time.
    Silence,
    /// No answer in time, and the caller has asked for a resend all the same.
    RetriedSilence,
    /// The caller has dealt with the outcome.
    Resume,
}

/// What the host does about it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HostAction {
    /// Sends the frame.
    Transmit,
    /// Keeps the frame, waits for the line to settle.
    Prepare,
    /// Reports the instructions as taken.
    Confirm,
    /// Reports them as refused.
    Refuse,
    /// Reports their outcome as unknown.
    Doubt,
    /// Goes on.
    Proceed,
    /// Nothing.
    Ignore,
}

impl HostState {
    /// The next state and what the host does.
    pub const fn on(self, input: HostInput) -> (Self, HostAction) {
        match (self, input) {
            (Self::Idle | Self::Resending, HostInput::Send) => (Self::Awaiting, HostAction::Transmit),
            (Self::Awaiting, HostInput::Echo) => (Self::Idle, HostAction::Confirm),
            (Self::Awaiting, HostInput::Refusal | HostInput::RetriedSilence) => {
                (Self::Resending, HostAction::Prepare)
            }
            (Self::Awaiting, HostInput::LastRefusal) => (Self::Held, HostAction::Refuse),
            (Self::Awaiting, HostInput::OtherWord | HostInput::Silence) => (Self::Held, HostAction::Doubt),
            (Self::Held, HostInput::Resume) => (Self::Idle, HostAction::Proceed),
            // What the controller says unasked is nothing to go by.
            (
                Self::Idle | Self::Resending | Self::Held,
                HostInput::Echo
                | HostInput::Refusal
                | HostInput::LastRefusal
                | HostInput::OtherWord
                | HostInput::Silence
                | HostInput::RetriedSilence,
            )
            | (Self::Awaiting | Self::Held, HostInput::Send)
            | (Self::Idle | Self::Awaiting | Self::Resending, HostInput::Resume) => {
                (self, HostAction::Ignore)
            }
        }
    }
}

/// The controller: speaks only when spoken to, once for each frame (§3(1), §3(5)).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ControllerState {
    /// Waits for a frame.
    Listening,
    /// The caller executes an immediate instruction.
    Executing,
    /// The answer waits for the end of the cycle.
    Answering,
}

/// What happens to the controller.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ControllerInput {
    /// A frame that is answered at once: its instructions are queued, or it is refused.
    Decided,
    /// A frame with an immediate instruction.
    Immediate,
    /// The line fell silent behind bytes that were no frame.
    Damaged,
    /// The caller has executed the instruction.
    Done,
    /// The answer is on the line.
    Sent,
}

/// What the controller does about it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ControllerAction {
    /// Prepares the answer.
    Answer,
    /// Has the caller execute the instruction.
    Execute,
    /// Waits for the next frame.
    Listen,
    /// Nothing.
    Ignore,
}

impl ControllerState {
    /// The next state and what the controller does.
    pub const fn on(self, input: ControllerInput) -> (Self, ControllerAction) {
        match (self, input) {
            // A frame that comes before the answer to the last one shows that the host has stopped waiting for that.
            (Self::Listening | Self::Answering, ControllerInput::Decided)
            | (Self::Listening, ControllerInput::Damaged)
            | (Self::Executing, ControllerInput::Done) => (Self::Answering, ControllerAction::Answer),
            (Self::Listening | Self::Answering, ControllerInput::Immediate) => {
                (Self::Executing, ControllerAction::Execute)
            }
            (Self::Answering, ControllerInput::Sent) => (Self::Listening, ControllerAction::Listen),
            (Self::Executing, ControllerInput::Decided | ControllerInput::Immediate)
            | (Self::Executing | Self::Answering, ControllerInput::Damaged)
            | (Self::Listening | Self::Answering, ControllerInput::Done)
            | (Self::Listening | Self::Executing, ControllerInput::Sent) => (self, ControllerAction::Ignore),
        }
    }
}
