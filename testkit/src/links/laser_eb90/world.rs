//! The explored system: both machines, the line between them, and a record of every frame. Time is counted in ticks.

use core::time::Duration;

use laser_eb90::controller::machine::{Answer, ControllerMachine};
use laser_eb90::host::machine::HostMachine;
use laser_eb90::{ControllerConfig, HostConfig, Refusal};
use robot_session::end::Machine as _;

/// An interpreted instruction and an immediate one.
pub const CUT: u16 = 0x0101;
/// As [`CUT`].
pub const SWITCH: u16 = 0x0201;

/// The contents of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Content {
    /// Interpreted instructions.
    Interpreted,
    /// An immediate instruction.
    Immediate,
    /// Another host's frame: an immediate instruction, and interpreted ones after it.
    Mixed,
}

/// The faults of the line and the ends, and their total number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Faults {
    /// The number of faults in a run.
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
    /// The host's process ends; the bytes that it has written are transmitted, or are discarded. The next process
    /// continues with the next frame.
    pub crash: bool,
    /// The host loses the connection, and has another.
    pub disconnect: bool,
    /// The controller is restarted, without its memory.
    pub restart: bool,
}

/// The behaviour of a controller that reads, in the points where controllers differ.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Reader {
    /// Whether it keeps the first half when it answers an error.
    pub keeps: bool,
    /// The controller reads a kept half and the next frame as one corrupt frame; otherwise it finds the frame after
    /// the half.
    pub swallows: bool,
    /// Whether it answers bytes without a head.
    pub answers_headless: bool,
    /// It answers bytes without a head even if they are the rest of an answered frame, and accepts a frame after
    /// them.
    pub answers_rest: bool,
    /// Whether it answers an immediate instruction that has others after it with an error.
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
    /// The configuration of the host.
    pub host: HostConfig,
    /// The configuration of the controller.
    pub controller: ControllerConfig,
    /// The behaviour of the controller's decoder.
    pub reader: Reader,
    /// The host's driver writes until the last byte has left, and reports that.
    pub reports_transmitted: bool,
    /// The frames to send.
    pub jobs: Vec<Content>,
    /// The possible faults.
    pub faults: Faults,
}

/// The basis of all decisions about the next act.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct World {
    /// The host's end.
    pub host: HostMachine,
    /// Whether its line is there.
    pub connected: bool,
    /// The controller's end.
    pub controller: ControllerMachine,
    /// The contents of the controller's decoder.
    pub held: Held,
    /// The decoder's results that the controller has not read.
    pub found: Vec<Found>,
    /// Frames on the line, the first is moving.
    pub down: Vec<Transmission>,
    /// Answers on the line.
    pub up: Vec<Reply>,
    /// Ticks of execution that are left at most.
    pub executing: u8,
    /// Faults that are left.
    pub faults: u8,
    /// The record of each frame.
    pub jobs: Vec<Job>,
    /// The number of submitted frames.
    pub submitted: u8,
    /// A machine got an unexpected input.
    pub unexpected: bool,
}

/// The contents of the controller's decoder.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Held {
    /// Nothing.
    Nothing,
    /// The beginning of a frame.
    Part(u8),
    /// A head, followed by bytes of two frames.
    Spoilt,
    /// Bytes without a head.
    Headless,
    /// The same, and too few for a frame.
    Noise,
}

/// A result of the decoder.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Found {
    /// A good frame.
    Frame(u8),
    /// Bytes that are not a frame: the refusal, their number, and whether they begin as a frame does.
    Corrupt(Refusal, u8, bool),
}

/// The outcome of a frame or an answer on the line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Fate {
    /// All of it arrives.
    Good,
    /// Nothing of it arrives.
    Lost,
    /// The checksum is wrong.
    Corrupt,
    /// The head is wrong.
    Headless,
    /// The transmission ends early.
    Cut {
        /// After this many ticks.
        after: u8,
    },
    /// It pauses on the way.
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
    /// The index of the frame.
    pub job: u8,
    /// The ticks that have passed.
    pub passed: u8,
    /// The outcome of the transmission.
    pub fate: Fate,
}

/// An answer on the line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Reply {
    /// The answer.
    pub answer: Answer,
    /// The ticks until it has arrived.
    pub ticks: u8,
    /// Whether it arrives corrupt.
    pub corrupt: bool,
}

/// The record of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Job {
    /// The number of times that it was executed, or queued: up to 2.
    pub executed: u8,
    /// A part of it was not.
    pub swallowed: bool,
    /// The reported outcome; `None` before a report.
    pub reported: Option<Reported>,
    /// Whether it was reported again.
    pub again: bool,
    /// Whether its echo has come while it was in flight.
    pub echoed: bool,
}

/// The reported outcome of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Reported {
    /// Done; perhaps more than once, because the caller has asked for resends on silence.
    Done {
        /// Whether a transmission brought no answer.
        unanswered: bool,
    },
    /// The frame was not accepted.
    Refused,
    /// The outcome is unknown.
    Unknown,
    /// The host's process has ended.
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
    /// The caller continues.
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
        /// Whether the bytes that it has written are discarded.
        cut: bool,
    },
    /// The host's line is gone.
    Disconnect,
    /// The controller restarts.
    Restart,
}

impl Setup {
    /// Returns the word and the class of a frame.
    pub fn word(&self, job: u8) -> u16 {
        if self.jobs[usize::from(job)] == Content::Interpreted { CUT } else { SWITCH }
    }
}

impl World {
    /// Returns whether the host waits until its frame has left.
    pub fn is_blocked(&self, setup: &Setup) -> bool {
        setup.reports_transmitted && self.connected && !self.down.is_empty()
    }

    /// Returns whether the controller executes.
    pub fn is_executing(&self) -> bool {
        !self.controller.reads()
    }
}
