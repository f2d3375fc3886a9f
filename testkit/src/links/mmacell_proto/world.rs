//! What the model knows: both machines, the connection, the device's owner and its axes, the caller, and what must hold.

use core::time::Duration;

use mmacell_proto::central::machine::{CentralMachine, Motion, Target};
use mmacell_proto::device::machine::DeviceMachine;
use mmacell_proto::{CentralConfig, Command, DeviceConfig, ErrorCode, Order, PlatformPose, Reply};
use robot_session::end::Machine as _;

pub(super) const TICK: Duration = Duration::from_millis(50);
pub(super) const HOME: PlatformPose = PlatformPose::ORIGIN;
/// Where a motion ends that something stops.
pub(super) const BETWEEN: PlatformPose = PlatformPose::from_units([5_000, 0]);

pub(super) const DONE: &str = "done: executed";
pub(super) const NOT_DONE: &str = "not done: not executed";
pub(super) const ONCE: &str = "executed at most once";
pub(super) const OUTCOME: &str = "one outcome for each request";
pub(super) const ARRIVED: &str = "arrived: at rest at the target, servo motors on";
pub(super) const NOT_MISSED: &str = "missed: not under way";
pub(super) const NO_TARGET: &str = "no target: neither arrived nor missed";
pub(super) const IN_FAULT: &str = "nothing moves in a fault";
pub(super) const ONE_MOTION: &str = "one motion at a time";
pub(super) const EXPECTED: &str = "no unexpected input";
pub(super) const NO_BREAK: &str = "no connection ends without a fault";
pub(super) const STRAY: &str = "an unsolicited reply is reported";
pub(super) const SERVO_OFF: &str = "nothing moves with the servo motors off";

pub(super) type Pose = PlatformPose;

pub(super) const UNKNOWN: Truth = Truth { at: HOME, moves: false, servo: false };

/// The bounds of the system.
#[derive(Debug, Clone, Copy)]
pub struct Setup {
    /// The central controller's end.
    pub central: CentralConfig,
    /// The device's end.
    pub device: DeviceConfig,
    /// Motions that the caller commands, each to another pose.
    pub jobs: u8,
    /// Faults of any kind.
    pub faults: u8,
    /// A device that repeats a reply may do so when the next command was sent. No central controller can see that.
    pub late_repeats: bool,
}

/// Everything that decides what happens next.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct World {
    /// The central controller's end.
    pub central: CentralMachine<Pose>,
    /// The device's end.
    pub device: DeviceMachine<Pose>,
    /// Nothing arrives any more, and no end knows.
    pub cut: bool,
    /// A command on its way.
    pub down: Option<Command<Pose>>,
    /// A reply on its way.
    pub up: Option<Reply<Pose>>,
    /// The device sends the same reply once more.
    pub again: Option<Reply<Pose>>,
    /// What was true when the status was asked for last.
    pub truth: Truth,
    /// Orders that the owner has not answered.
    pub owner: [Option<Order<Pose>>; 2],
    /// Where the axes are.
    pub at: Pose,
    /// Where they go.
    pub going: Option<Pose>,
    /// The motion began in this tick: a device may still report that it is at rest.
    pub young: bool,
    /// Each job: how often it was executed, and its outcome.
    pub jobs: [Job; 2],
    /// The next job.
    pub next: u8,
    /// The job that has no outcome yet.
    pub pending: Option<u8>,
    /// The target of the motion that the device has agreed to on this connection, as the caller knows it.
    pub target: Option<Pose>,
    /// A device that breaks the rules of the source was seen: the connection may end.
    pub foreign: bool,
    /// Faults that may still come.
    pub faults: u8,
    /// What must not be, and was.
    pub wrong: Option<&'static str>,
}

/// What is true of the axes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Truth {
    pub(super) at: Pose,
    pub(super) moves: bool,
    pub(super) servo: bool,
}

/// What is known of a job.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Job {
    pub(super) executed: u8,
    pub(super) outcome: Option<Outcome>,
}

/// What was reported to its sender.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Outcome {
    /// Executed.
    Done,
    /// Not executed.
    NotDone,
    /// Whether it was executed is unknown.
    Unknown,
}

/// One thing that happens.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Act {
    /// The caller makes a connection; the device may not know that the one before is gone.
    Connect,
    /// The caller requests the next motion.
    Move,
    /// The caller requests something else.
    Request(Command<Pose>),
    /// The caller aborts.
    Abort,
    /// The command is sent.
    Transmit,
    /// It arrives.
    Deliver,
    /// The owner accepts its first order.
    Accept,
    /// The reply is sent.
    Reply,
    /// The reply arrives.
    Return,
    /// The central controller's time is handled.
    Due,
    /// 50 ms pass.
    Tick,
    /// The axes reach their target.
    Arrive,
    /// Fault: something stops them on their way, and the device does not notice.
    Stall,
    /// Fault: the reply is that of a device that begins a motion late: it still reports that it is at rest.
    LateReply,
    /// Fault: the owner refuses its first order, with any code.
    Refuse(ErrorCode),
    /// Fault: the device fails.
    Fail,
    /// Fault: the servo motors were switched off by hand, and the reply shows that.
    ServoOffReply,
    /// Fault: the device sends the reply twice.
    RepeatReply,
    /// Fault: the reply is malformed.
    Garble,
    /// Fault: the device does not understand the command.
    Misread,
    /// Fault: another central controller connects to the device, and ours does not know.
    Usurp,
    /// Fault: nothing arrives any more, and nobody knows.
    Cut,
    /// Fault: the connection breaks, and both ends know.
    Break,
    /// Fault: the device restarts and loses its memory; nobody knows.
    RestartDevice,
    /// Fault: the central controller restarts and loses its memory; the device does not know.
    RestartCentral,
}

impl World {
    /// The reply that the device is to send.
    pub(super) fn pending_reply(&self) -> Option<Reply<Pose>> {
        self.device.transmit(Duration::ZERO, &DeviceConfig::DEFAULT)
    }

    /// What is on its way is lost.
    pub(super) fn hang_up(&mut self, cut: bool) {
        (self.cut, self.down, self.up, self.again) = (cut, None, None, None);
    }

    pub(super) fn take_order(&mut self) -> Option<Order<Pose>> {
        let [first, second] = &mut self.owner;
        core::mem::replace(first, second.take())
    }

    pub(super) fn conclude(&mut self, outcome: Outcome) {
        if let Some(job) = self.pending.take().and_then(|job| self.jobs.get_mut(usize::from(job))) {
            job.outcome = Some(outcome);
        }
    }

    /// Whether a tick changes anything.
    pub(super) fn ages(&self) -> bool {
        let mut ages = self.young;
        self.central.clone().each_time(|time| ages |= !time.is_zero() && *time != Duration::MAX);
        ages
    }

    /// Whether the last motion was a reset.
    pub(super) fn resets(&self) -> bool {
        let (Motion::Starting { target, .. } | Motion::Moving { target } | Motion::Rest { target, .. }) =
            self.central.motion
        else {
            return false;
        };
        target == Target::Unknown
    }
}

/// Where a job leads.
pub(super) fn target(job: u8) -> Pose {
    PlatformPose::from_units([100 * (i32::from(job) + 1), 0])
}
