//! The steps of a PC, its line and the robot's program, and the known state of the jobs.

use std::collections::VecDeque;

use kawasaki_msg::FromPc;
use kawasaki_msg::robot::machine::{Machine, Order, Stage};

use super::super::text::Held;

/// A message, with the job that it is, or how many jobs the PC has sent before it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct SentMessage {
    /// `None` is corrupt.
    pub(super) message: Option<FromPc>,
    pub(super) job: u8,
}

/// The model's knowledge of the PC, the line and the jobs.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Knowledge {
    /// The packet that a PC that keeps the rules has not answered.
    pub(super) asked: Option<Asked>,
    /// The packets to the robot.
    pub(super) down: Vec<Vec<SentMessage>>,
    pub(super) held: Held,
    /// The robot's queue.
    pub(super) queue: Vec<u8>,
    /// The next job to queue.
    pub(super) next: u8,
    /// Executed, and not reported to the session yet.
    pub(super) unreported: u8,
    /// The jobs of the order that are executed.
    pub(super) done: u8,
    /// Whether the PC has sent all.
    pub(super) sent_all: bool,
    pub(super) over: bool,
    /// The orders that are over, and the ticks for which datagrams of an earlier run arrive; both only over datagrams.
    pub(super) ended: [bool; 2],
    pub(super) strange_for: Option<u8>,
    /// Whether there was a connection.
    pub(super) has_begun: bool,
    /// The session has asked for the connection to be closed.
    pub(super) closes: bool,
    pub(super) faults: u8,
    /// Whether the order stalls, with a connection or without.
    pub(super) stands: Option<bool>,
    /// Ticks of a stall with a connection.
    pub(super) stood: u8,
    /// Further inputs of the same call.
    pub(super) inputs: VecDeque<Pending>,
    pub(super) check: QueueCheck,
    /// The job of the message that was read last in this call.
    pub(super) read: u8,
    pub(super) wrong: Option<&'static str>,
}

/// The contents of a robot's packet.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Asked {
    /// Whether the robot has accepted the order.
    pub(super) accepted: bool,
    /// The first requested job.
    pub(super) from: Option<u8>,
}

/// An input of the robot.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Pending {
    Message(SentMessage),
    Corrupt,
    ReadEnd { whole: bool },
    Settled,
    Drained,
}

/// Whether `handle_timeout` is to check the queue, which it does last.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum QueueCheck {
    /// It is not called.
    Idle,
    /// It handles deadlines.
    Due,
    /// It has checked the queue.
    Done,
}

/// A step of the model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Step {
    /// The PC begins the order again, which is over; the line may commit as many faults again.
    Again,
    /// The PC answers with up to three messages, or never.
    Answer([Letter; 3]),
    /// The robot reads this many messages of the first packet.
    Read(u8),
    /// The robot reads a message of a PC that does anything.
    Say(Letter),
    /// The robot reads half a message.
    Half {
        /// In the same read as the filler before it.
        after_filler: bool,
    },
    /// The robot reads the other half.
    Rest,
    /// The motion task executes the next job.
    Execute,
    /// The session is handed the report.
    Report,
    /// `handle_timeout` finds the queue settled or drained.
    Check,
    /// The motion program leads out of the alarm.
    ClearQueue,
    /// The connection that the robot asks for is made.
    Connect,
    /// The connection is lost, or closed because the robot asks for that.
    Break,
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

pub(super) fn stage(robot: &Machine) -> Option<Stage> {
    if let Order::Active { stage, .. } = robot.order { Some(stage) } else { None }
}

impl Knowledge {
    /// Returns whether nothing of the order is left on the line.
    pub(super) fn is_quiet(&self) -> bool {
        self.asked.is_none() && self.down.is_empty() && self.held == Held::Nothing && !self.closes
    }

    /// Ends the connection: its bytes are lost.
    pub(super) fn lose(&mut self) {
        self.down.clear();
        (self.asked, self.held, self.closes) = (None, Held::Nothing, false);
    }

    /// Lets the session read messages in one call.
    pub(super) fn hear(&mut self, messages: impl IntoIterator<Item = SentMessage>, datagrams: bool) {
        for sent in messages {
            self.begin_message();
            match sent.message {
                Some(_) => self.inputs.push_back(Pending::Message(sent)),
                None => self.held = Held::Corrupt,
            }
        }
        self.end_read(datagrams);
    }

    /// The bytes that are held are corrupt when a message begins.
    pub(super) fn begin_message(&mut self) {
        if core::mem::replace(&mut self.held, Held::Nothing) != Held::Nothing {
            self.inputs.push_back(Pending::Corrupt);
        }
    }

    pub(super) fn end_read(&mut self, datagrams: bool) {
        if datagrams {
            self.begin_message();
        }
        self.inputs.push_back(Pending::ReadEnd { whole: self.held != Held::Half });
    }

    /// Lets the motion task execute its next job.
    pub(super) fn execute(&mut self) -> Option<&'static str> {
        let job = self.queue.remove(0);
        let before = self.done;
        self.done = before.max(job + 1);
        self.unreported += 1;
        match job.cmp(&before) {
            core::cmp::Ordering::Less => Some(super::TWICE),
            core::cmp::Ordering::Equal => None,
            core::cmp::Ordering::Greater => Some(super::SKIPPED),
        }
    }
}
