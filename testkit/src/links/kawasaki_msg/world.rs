//! The closed system of both machines: what it holds.

use core::time::Duration;

use kawasaki_msg::{FromPc, FromRobot, PcConfig, RobotConfig};

use super::machines::{Pc, Robot};

/// The time of a tick.
pub const TICK: Duration = Duration::from_millis(500);

/// What may go wrong, and what the users may do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Faults {
    /// How often in all.
    pub most: u8,
    /// A packet is read in two parts.
    pub split: bool,
    /// The connection is lost with the bytes in flight, and each end notices it later; or a datagram is lost.
    pub lose: bool,
    /// A datagram comes twice.
    pub repeat: bool,
    /// A packet comes after the reply timeout; a datagram is overtaken.
    pub delay: bool,
    /// What the PC sends is corrupt.
    pub corrupt: bool,
    /// What the robot sends is corrupt.
    pub corrupt_up: bool,
    /// Either end is polled a tick too late.
    pub late_poll: bool,
    /// The PC loses its memory.
    pub restart_pc: bool,
    /// The robot does.
    pub restart_robot: bool,
    /// How often the users interfere: interrupt and end at the PC, the two resets at the robot.
    pub users: u8,
}

/// A system to explore.
#[derive(Debug, Clone)]
pub struct Setup {
    /// The robot's configuration.
    pub robot: RobotConfig,
    /// The PC's.
    pub pc: PcConfig,
    /// The order numbers that the user starts, one after the other.
    pub starts: Vec<u16>,
    /// The jobs of each.
    pub jobs: u32,
    /// The jobs in one packet, in place of bytes.
    pub batch: u32,
    /// The places of the robot's queue.
    pub capacity: usize,
    /// What is left in it when it has drained.
    pub low_water: usize,
    /// What may go wrong.
    pub faults: Faults,
    /// Acknowledgements of the order before are not used, whatever the number of this one is: what a PC must not do.
    pub filters_acks: bool,
}

/// A message to the robot; of which start it is and which job of it only the model knows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Sent {
    /// `None` is corrupt.
    pub message: Option<FromPc>,
    /// Whose.
    pub tag: Tag,
}

/// A job of a start.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Tag {
    /// Which start, from 0.
    pub start: u8,
    /// Which job of it, from 0.
    pub job: u8,
}

/// A packet in flight.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct InFlight<M> {
    /// Its messages.
    pub messages: Vec<M>,
    /// Over datagrams, for how many ticks it can still arrive.
    pub left: u8,
}

/// What the PC's user was told of a start.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Reported {
    /// Nothing yet.
    #[default]
    Nothing,
    /// Jobs of this mask are executed, no others will be.
    Over {
        /// One bit a job.
        executed: u8,
    },
    /// Jobs of the mask are executed, of the others before `sent` nobody knows.
    Unknown {
        /// One bit a job.
        executed: u8,
        /// A count.
        sent: u8,
    },
    /// It was not begun.
    GivenUp,
    /// The PC's process was restarted.
    Abandoned,
}

/// A start, and what really became of its jobs, one bit each.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Start {
    /// The motion task has begun them.
    pub begun: u8,
    /// It has executed them.
    pub done: u8,
    /// What the PC reported.
    pub reported: Reported,
    /// A user or a restart has broken it off.
    pub disturbed: bool,
}

/// The state of it all.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct World {
    /// The robot's machine.
    pub robot: Robot,
    /// The PC's.
    pub pc: Pc,
    /// The order before, of a PC that filters acknowledgements.
    pub before: u16,
    /// There is a connection.
    pub line: bool,
    /// From the robot.
    pub up: Vec<InFlight<FromRobot>>,
    /// To the robot.
    pub down: Vec<InFlight<Sent>>,
    /// What the robot has read ends with a corrupt message: it is known when the next one begins.
    pub robot_tail: bool,
    /// The same at the PC.
    pub pc_tail: bool,
    /// The robot's queue.
    pub queue: Vec<Tag>,
    /// What the motion task executes.
    pub executing: Option<Tag>,
    /// Whose the first job of the robot's order was.
    pub owner: u8,
    /// What was started.
    pub starts: Vec<Start>,
    /// How many faults may still happen.
    pub faults: u8,
    /// How often a user may still interfere.
    pub users: u8,
    /// What must not happen, and did.
    pub flags: Flags,
}

/// What must not happen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Flags {
    /// A job was begun twice.
    pub twice: bool,
    /// A job has joined an order that it does not belong to.
    pub mixed: bool,
    /// A machine did not expect an input.
    pub unexpected: bool,
    /// An order that nobody has broken off was not executed whole.
    pub broken_off: bool,
}

/// What happens.
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
    /// It sends a packet.
    Transmit,
    /// The PC reads this many messages of a packet.
    PcReads {
        /// Which packet in flight.
        packet: u8,
        /// How many messages.
        count: u8,
    },
    /// It reads the first packet, in which one message is corrupt.
    PcReadsCorrupt(u8),
    /// The PC's time has come.
    PcTimeout,
    /// It answers.
    Answer,
    /// The robot reads this many messages of a packet.
    RobotReads {
        /// Which packet in flight.
        packet: u8,
        /// How many messages.
        count: u8,
    },
    /// The same, and the last of them is corrupt.
    RobotReadsCorrupt(u8),
    /// The motion task takes a job.
    Take(u8),
    /// It has executed it.
    Done,
    /// The connection is lost.
    Lose,
    /// A datagram is lost: to the PC, or to the robot.
    LoseDatagram {
        /// To the PC.
        up: bool,
        /// Which.
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
    /// Time goes on.
    Tick,
    /// The same, though an end has something to do.
    LateTick,
}
