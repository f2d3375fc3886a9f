//! The robot, the possible messages of its peer, and the known state of the jobs.

use core::time::Duration;

use kawasaki_msg::FromPc;
use kawasaki_msg::robot::machine::{Link, Order, Replies, Stage};

use super::super::machines::Robot;

/// A message, with the job that it is, or how many jobs the PC has sent before it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct SentMessage {
    /// `None` is corrupt.
    pub(super) message: Option<FromPc>,
    pub(super) job: u8,
}

/// The robot, and the known state of its jobs.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct World {
    pub(super) robot: Robot,
    pub(super) down: Vec<Vec<SentMessage>>,
    /// The bytes read so far end with a corrupt message, which is noticed when the next one begins.
    pub(super) tail: bool,
    pub(super) queue: Vec<u8>,
    pub(super) executing: Option<u8>,
    /// Executed and completed, and not reported to the session yet.
    pub(super) unreported: u8,
    /// The jobs of the order that were begun, done, and whether the PC has sent all.
    pub(super) begun: u8,
    pub(super) done: u8,
    pub(super) sent_all: bool,
    pub(super) over: bool,
    pub(super) faults: u8,
    /// Ticks of a stall with a connection.
    pub(super) stood: u8,
    pub(super) flags: Flags,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub(super) struct Flags {
    pub(super) twice: bool,
    pub(super) skipped: bool,
    pub(super) early_end: bool,
    pub(super) wrong_count: bool,
    pub(super) unexpected: bool,
    pub(super) healthy: bool,
}

/// A step of the model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Act {
    /// A connection is made.
    Connect,
    /// The connection is lost.
    Break,
    /// `handle_timeout`.
    Timeout,
    /// The robot sends a packet, and the PC answers with up to three messages, or never.
    Transmit([Letter; 3]),
    /// The robot reads this many messages of the first packet.
    Read(u8),
    /// The robot reads a message of a PC that does anything.
    Receive(Letter),
    /// Nothing more comes for now.
    ReadEnd,
    /// Half a message follows the bytes that were read.
    ReadHalf,
    /// The motion task has executed a job, and completes it.
    Done,
    /// The session is handed the report.
    Report,
    /// The motion program leads out of the alarm.
    ClearQueue,
    /// Time passes.
    Tick,
}

/// A message of the PC.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Letter {
    /// No message.
    Nothing,
    /// Filler.
    Filler,
    /// The start of the order.
    Start,
    /// The start of another order.
    OtherStart,
    /// The end of the order.
    End,
    /// The interruption of the order.
    Interrupt,
    /// The job that was asked for, or one so far from it.
    Job(i8),
    /// A job of another order.
    OtherOrder,
    /// A job out of bounds.
    BadJob,
    /// A status that names another order.
    OtherStatus,
    /// Corrupt bytes.
    Corrupt,
}

impl World {
    /// Clears the unsent replies: they have no other effect, and a PC that does anything does not read them.
    pub(super) fn project(&mut self) {
        (self.robot.replies, self.robot.ended) = (Replies::default(), None);
        self.robot.acked = self.robot.executed;
        if let Link::Connected { status_at, .. } = &mut self.robot.link {
            *status_at = Duration::MAX;
        }
        if self.robot.order == Order::Idle {
            (self.robot.queued, self.robot.executed) = (0, 0);
        }
    }

    pub(super) fn stage(&self) -> Option<Stage> {
        if let Order::Active { stage, .. } = self.robot.order { Some(stage) } else { None }
    }

    /// Returns the requested job.
    pub(super) fn next(&self) -> u8 {
        if self.stage().is_some() { self.robot.queued as u8 } else { 0 }
    }

    pub(super) fn occupied(&self) -> usize {
        self.queue.len() + usize::from(self.executing.is_some())
    }

    pub(super) fn is_empty(&self) -> bool {
        self.occupied() == 0
    }

    /// Lets the motion task take its next job at once.
    pub(super) fn take(&mut self) {
        if self.executing.is_none() && !self.queue.is_empty() {
            let job = self.queue.remove(0);
            self.flags.twice |= job < self.begun;
            self.flags.skipped |= job > self.begun;
            self.begun = self.begun.max(job + 1);
            self.executing = Some(job);
        }
    }
}
