//! The contents of the closed system of both machines.

use core::time::Duration;

use kawasaki_msg::{FromPc, FromRobot, PcConfig, RobotConfig};

use super::machines::{Pc, Robot};

/// The time of a tick.
pub const TICK: Duration = Duration::from_millis(500);

/// The possible faults and the acts of the users.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Faults {
    /// The number of faults in a run.
    pub most: u8,
    /// A packet is read in two parts.
    pub split: bool,
    /// The connection is lost with the bytes in flight, and each end notices it later; or a datagram is lost.
    pub lose: bool,
    /// A datagram comes twice.
    pub repeat: bool,
    /// A packet comes after the reply timeout; a datagram is overtaken.
    pub delay: bool,
    /// Messages from the PC are corrupt.
    pub corrupt: bool,
    /// Messages from the robot are corrupt.
    pub corrupt_up: bool,
    /// Either end is polled a tick too late.
    pub late_poll: bool,
    /// The PC loses its memory.
    pub restart_pc: bool,
    /// The robot loses its memory.
    pub restart_robot: bool,
    /// The number of interferences of the users: interrupt and end at the PC, the two resets at the robot.
    pub users: u8,
}

/// A system to explore.
#[derive(Debug, Clone)]
pub struct Setup {
    /// The robot's configuration.
    pub robot: RobotConfig,
    /// The configuration of the PC.
    pub pc: PcConfig,
    /// The order numbers that the user starts, one after the other.
    pub starts: Vec<u16>,
    /// The jobs of each.
    pub jobs: u32,
    /// The jobs in one packet, in place of bytes.
    pub batch: u32,
    /// The places of the robot's queue.
    pub capacity: usize,
    /// The jobs in the queue when it counts as drained.
    pub low_water: usize,
    /// The possible faults.
    pub faults: Faults,
    /// Acknowledgements of the previous order are ignored, for any number of this order: a PC must not do this.
    pub filters_acks: bool,
}

/// A message to the robot. The tag exists only in the model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct SentMessage {
    /// The message; `None` if it is corrupt.
    pub message: Option<FromPc>,
    /// The start and the job of the message.
    pub tag: Tag,
}

/// A job of a start.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Tag {
    /// The number of the start, from 0.
    pub start: u8,
    /// The number of the job in the start, from 0.
    pub job: u8,
}

/// A packet in flight.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct InFlight<M> {
    /// The messages of the packet.
    pub messages: Vec<M>,
    /// Over datagrams, the ticks within which it can still arrive.
    pub left: u8,
}

/// The result of a start that was reported to the PC's user.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum ReportedStart {
    /// Nothing yet.
    #[default]
    Nothing,
    /// Jobs of this mask are executed, no others will be.
    Over {
        /// One bit per job.
        executed: u8,
    },
    /// Jobs of the mask are executed; the outcome of the others before `sent` is unknown.
    Unknown {
        /// One bit per job.
        executed: u8,
        /// The number of jobs sent.
        sent: u8,
    },
    /// The order was not begun.
    GivenUp,
    /// The PC's process was restarted.
    Abandoned,
}

/// A start, and the real results of its jobs, one bit each.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Start {
    /// The motion task has begun them.
    pub begun: u8,
    /// The motion task has executed them.
    pub done: u8,
    /// The result that the PC reported.
    pub reported: ReportedStart,
    /// A user or a restart has broken it off.
    pub disturbed: bool,
}

/// The state of it all.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct World {
    /// The robot's machine.
    pub robot: Robot,
    /// The machine of the PC.
    pub pc: Pc,
    /// The number of the previous order, of a PC that filters acknowledgements.
    pub before: u16,
    /// Whether there is a connection.
    pub line: bool,
    /// The packets from the robot.
    pub up: Vec<InFlight<FromRobot>>,
    /// The packets to the robot.
    pub down: Vec<InFlight<SentMessage>>,
    /// The bytes that the robot has read end with a corrupt message, which is noticed when the next one begins.
    pub robot_tail: bool,
    /// The same at the PC.
    pub pc_tail: bool,
    /// The robot's queue.
    pub queue: Vec<Tag>,
    /// The job that the motion task executes.
    pub executing: Option<Tag>,
    /// The start to which the first job of the robot's order belonged.
    pub owner: u8,
    /// The starts so far.
    pub starts: Vec<Start>,
    /// The number of faults that may still happen.
    pub faults: u8,
    /// The number of times that a user may still interfere.
    pub users: u8,
    /// The violations so far.
    pub flags: Flags,
}

/// Violations of the properties.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Flags {
    /// A job was begun twice.
    pub twice: bool,
    /// A job has joined an order that it does not belong to.
    pub mixed: bool,
    /// A machine did not expect an input.
    pub unexpected: bool,
    /// An order that was not broken off was not executed completely.
    pub broken_off: bool,
}

/// A step of the model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Act {
    /// The PC's user begins the next order.
    Start,
    /// The user interrupts it.
    Interrupt,
    /// The user ends it.
    End,
    /// The motion program's first reset.
    ClearQueue,
    /// The second.
    ResetOrder,
    /// A connection is made.
    Connect,
    /// The robot's time has come, or its queue has drained or settled.
    RobotTimeout,
    /// The robot sends a packet.
    Transmit,
    /// The PC reads this many messages of a packet.
    PcReads {
        /// The index of the packet in flight.
        packet: u8,
        /// The number of messages.
        count: u8,
    },
    /// The PC reads the first packet, in which one message is corrupt.
    PcReadsCorrupt(u8),
    /// The PC's time has come.
    PcTimeout,
    /// The PC answers.
    Answer,
    /// The robot reads this many messages of a packet.
    RobotReads {
        /// The index of the packet in flight.
        packet: u8,
        /// The number of messages.
        count: u8,
    },
    /// The same, and the last of them is corrupt.
    RobotReadsCorrupt(u8),
    /// The motion task takes a job.
    Take(u8),
    /// The motion task has executed the job.
    Done,
    /// The connection is lost.
    Lose,
    /// A datagram is lost: to the PC, or to the robot.
    LoseDatagram {
        /// To the PC.
        up: bool,
        /// The index of the datagram.
        packet: u8,
    },
    /// A datagram comes once more.
    Repeat {
        /// To the PC.
        up: bool,
    },
    /// The robot notices that the connection is lost.
    RobotNotices,
    /// The PC does.
    PcNotices,
    /// The PC loses its memory.
    RestartPc,
    /// The robot does.
    RestartRobot,
    /// Time passes.
    Tick,
    /// The same, though an end has something to do.
    LateTick,
}
