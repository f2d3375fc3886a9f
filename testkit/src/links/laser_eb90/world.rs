//! What is explored: both machines, the line between them, and what is known of every frame. Time goes in ticks.

use core::time::Duration;

use laser_eb90::controller::machine::{Answer, ControllerMachine};
use laser_eb90::host::machine::HostMachine;
use laser_eb90::{ControllerConfig, HostConfig, Refusal};
use robot_session::end::Machine as _;

/// An interpreted instruction and an immediate one.
pub const CUT: u16 = 0x0101;
/// As [`CUT`].
pub const SWITCH: u16 = 0x0201;

/// What a frame carries.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Content {
    /// Interpreted instructions.
    Interpreted,
    /// An immediate instruction.
    Immediate,
    /// Another host's frame: an immediate instruction, and interpreted ones after it.
    Mixed,
}

/// What the line and the ends can do wrong, and how often in all.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Faults {
    /// How many faults in a run.
    pub most: u8,
    /// A frame pauses once within, for up to this many ticks.
    pub pause: u8,
    /// A frame ends early.
    pub cut: bool,
    /// A frame is lost.
    pub lose: bool,
    /// The checksum is wrong, or the head is.
    pub corrupt: bool,
    /// A few bytes of noise.
    pub noise: bool,
    /// An answer is lost.
    pub lose_answer: bool,
    /// An answer is corrupt.
    pub corrupt_answer: bool,
    /// An answer is late, by up to this many ticks.
    pub late: u8,
    /// An end is called a tick late.
    pub late_polls: bool,
    /// The controller's queue is full.
    pub queue_full: bool,
    /// The execution of an immediate instruction fails halfway.
    pub fail: bool,
    /// The host's process ends; what it has written is transmitted, or is cut. The next process goes on with the next frame.
    pub crash: bool,
    /// The host loses the connection, and has another.
    pub disconnect: bool,
    /// The controller is restarted, without its memory.
    pub restart: bool,
}

/// How the controller reads, where controllers differ.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Reader {
    /// It keeps the first half when it answers an error.
    pub keeps: bool,
    /// A half that was kept and the next frame are one corrupt frame; else the frame is found after the half.
    pub swallows: bool,
    /// It answers bytes without a head.
    pub answers_headless: bool,
    /// It answers them also when they are the rest of what it has answered, and takes a frame behind them.
    pub answers_rest: bool,
    /// It answers an immediate instruction that has others after it with an error.
    pub refuses_mixed: bool,
}

/// A closed system: bounds, configurations and faults.
#[derive(Debug, Clone)]
pub struct Setup {
    /// The length of a tick.
    pub tick: Duration,
    /// The ticks that a frame takes.
    pub line: u8,
    /// The ticks that an answer takes.
    pub answer: u8,
    /// The ticks of the longest execution.
    pub execution: u8,
    /// The host's.
    pub host: HostConfig,
    /// The controller's.
    pub controller: ControllerConfig,
    /// What the controller's decoder does.
    pub reader: Reader,
    /// The host's driver writes until the last byte has left, and reports that.
    pub reports_transmitted: bool,
    /// What is sent, a frame each.
    pub jobs: Vec<Content>,
    /// What can go wrong.
    pub faults: Faults,
}

/// Everything that decides what happens next.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct World {
    /// The host's end.
    pub host: HostMachine,
    /// Whether its line is there.
    pub connected: bool,
    /// The controller's end.
    pub controller: ControllerMachine,
    /// What the controller's decoder holds.
    pub held: Held,
    /// What it has found and the controller has not read.
    pub found: Vec<Found>,
    /// Frames on the line, the first is moving.
    pub down: Vec<Transmission>,
    /// Answers on the line.
    pub up: Vec<Reply>,
    /// Ticks of execution that are left at most.
    pub executing: u8,
    /// Faults that are left.
    pub faults: u8,
    /// What is known of each frame.
    pub jobs: Vec<Job>,
    /// How many were submitted.
    pub submitted: u8,
    /// A machine did not expect what it got.
    pub unexpected: bool,
}

/// What the controller's decoder holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Held {
    /// Nothing.
    Nothing,
    /// The beginning of a frame.
    Part(u8),
    /// A head, and then what belongs to two frames.
    Spoilt,
    /// Bytes without a head.
    Headless,
    /// The same, and too few for a frame.
    Noise,
}

/// What the decoder has found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Found {
    /// A good frame.
    Frame(u8),
    /// How many bytes that are none; whether they begin as one does.
    Corrupt(Refusal, u8, bool),
}

/// What becomes of a frame or an answer on the line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Fate {
    /// It arrives.
    Good,
    /// Nothing of it arrives.
    Lost,
    /// Its checksum is wrong.
    Corrupt,
    /// Its head is wrong.
    Headless,
    /// It ends early.
    Cut {
        /// After this many ticks.
        after: u8,
    },
    /// It pauses.
    Paused {
        /// After this many ticks.
        after: u8,
        /// For this many.
        ticks: u8,
    },
    /// An answer comes later.
    Late {
        /// By this many ticks.
        ticks: u8,
    },
}

/// A frame on the line, and how much of it has passed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Transmission {
    /// Which frame.
    pub job: u8,
    /// Ticks.
    pub passed: u8,
    /// What becomes of it.
    pub fate: Fate,
}

/// An answer on the line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Reply {
    /// The answer.
    pub answer: Answer,
    /// When it has arrived.
    pub ticks: u8,
    /// It is no answer when it arrives.
    pub corrupt: bool,
}

/// What is known of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Job {
    /// How often it was executed, or queued: up to 2.
    pub executed: u8,
    /// A part of it was not.
    pub swallowed: bool,
    /// What was reported.
    pub reported: Option<Reported>,
    /// It was reported again.
    pub again: bool,
    /// Its echo has come while it was in flight.
    pub echoed: bool,
}

/// What was reported of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Reported {
    /// Done; perhaps more than once, because the caller has asked for resends on silence.
    Done {
        /// Whether a transmission brought no answer.
        unanswered: bool,
    },
    /// Not taken.
    Refused,
    /// Nobody knows.
    Unknown,
    /// Its process has ended.
    Abandoned,
}

/// One thing that happens.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Act {
    /// Time passes.
    Tick,
    /// Time passes, and an end is not called though it is due.
    LateTick,
    /// The host's line is opened.
    Connect,
    /// The caller submits the next frame.
    Submit,
    /// The host sends.
    Send(Fate),
    /// The host's time has come, and it sends nothing.
    Timeout,
    /// The caller goes on.
    Resume,
    /// The controller judges a good frame.
    Judge(Result<(), Refusal>),
    /// The execution ends.
    Finish(Result<(), Refusal>),
    /// The controller answers.
    Reply(Fate),
    /// A few bytes of noise arrive at the controller.
    Noise,
    /// The host's process ends.
    Crash {
        /// What it has written is not transmitted.
        cut: bool,
    },
    /// The host's line is gone.
    Disconnect,
    /// The controller restarts.
    Restart,
}

impl Setup {
    /// The word and the class of a frame.
    pub fn word(&self, job: u8) -> u16 {
        if self.jobs[usize::from(job)] == Content::Interpreted { CUT } else { SWITCH }
    }
}

impl World {
    /// Whether the host waits until its frame has left.
    pub fn is_blocked(&self, setup: &Setup) -> bool {
        setup.reports_transmitted && self.connected && !self.down.is_empty()
    }

    /// Whether the controller executes.
    pub fn is_executing(&self) -> bool {
        !self.controller.reads()
    }
}
