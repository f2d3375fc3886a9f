//! Messages between the threads of the host and to the screen.

use std::path::PathBuf;
use std::time::Duration;

use cellwire_motion::latch::Latch;
use isra_ball::Packet;
use robot_session::EchoError;
use val2_alter::{
    AXES, End, ErrorCode, Exception, ExceptionOutcome, HostState, LostReason, Motion, Policy, SessionError,
    Start,
};

use super::profile::Profile;
use super::sample::Sample;

/// A command to the robot thread.
#[derive(Debug, Clone, PartialEq)]
pub enum Order {
    /// New values of the hand.
    Hand(Sample),
    /// The hand's values are too old: come to rest.
    HandOld,
    /// The input is gone: come to rest.
    HandLost,
    /// The operator confirms that the hand may move the arm.
    Confirm,
    /// The meaning of the hand's values from now on: come to rest first.
    Profile(Box<Profile>),
    /// The policy by which start messages are answered.
    Policy(Policy),
    /// Come to rest, then fall silent.
    Stop,
    /// The same, and then the host ends.
    End,
    /// The gripper on the ball's keys, on or off.
    GripperKeys(bool),
    /// Listen at several baud rates, unless ALTER runs.
    Probe,
    /// Sleep, as a host does that has too much to do: a fault for the demo.
    Stall(Duration),
}

/// The reports of the host's threads, each with its time.
#[derive(Debug, Clone, PartialEq)]
pub enum Notification {
    /// A port is open (again): its name and its path.
    PortOpen(&'static str, String),
    /// The USB adapter of a port delays bytes for too long, with the advised setting.
    SlowAdapter(&'static str, String),
    /// A port is gone; it is retried.
    PortLost(&'static str, String),
    /// Whether the reply thread runs before all others.
    Priority(bool),
    /// A start message has come.
    Start(Start),
    /// A standard message has come.
    Motion(Motion),
    /// A reply was sent.
    Reply {
        /// The values that the ball asked for, in units a cycle.
        demand: [i16; AXES],
        /// The demand within the limits, as it is sent, in units a cycle.
        values: [i16; AXES],
        /// The time from the last byte read to the reply written.
        thinking: Duration,
        /// Whether an axis had to wait, because its word did not fit the window.
        held: bool,
    },
    /// ALTER is over: the controller has sent an end message.
    End(End),
    /// A message was read later than the host assumes.
    Delayed,
    /// The reply came too late to be sent.
    Missed,
    /// The controller could not read a reply.
    Rejected(ErrorCode),
    /// Bytes from the robot that are not a message.
    Corrupt(val2_alter::DecodeError),
    /// ALTER is over without an end message.
    Lost(LostReason),
    /// The values are zero after [`Order::Stop`]; no message is answered any more.
    Stopped,
    /// The session's state after something happened.
    State(HostState),
    /// The state of the safety latch.
    Latch(Latch),
    /// The host has ended: nothing is answered any more.
    Ended,
    /// A key of the gripper was pressed; the result of the call.
    Gripper(Exception, Result<(), SessionError>),
    /// The outcome of a gripper command at the robot.
    GripperOutcome(Exception, ExceptionOutcome),
    /// New values of the input.
    Hand(Sample),
    /// A packet of the ball with new values, and how long after the poll it was whole.
    Ball(Packet, Duration),
    /// A packet of the ball without new values, and how long after the poll it was whole.
    BallOld(Packet, Duration),
    /// A poll of the ball without a packet.
    BallMissed,
    /// A packet of the ball that is not a reply: it comes too late.
    BallLate,
    /// Corrupt bytes from the ball.
    BallCorrupt(isra_ball::DecodeError),
    /// The ball's values are too old.
    BallStale,
    /// A line returns the sent bytes, or both of its ends have sent at once.
    Echo(&'static str, EchoError),
    /// The workstation holds the line (XOFF), or takes packets again (XON).
    ViewerHolds(bool),
    /// The workstation asked for a pose.
    PoseAsked,
    /// The workstation was sent a pose.
    Pose,
    /// The messages at a port at one baud rate.
    Probed {
        /// The name of the port.
        port: &'static str,
        /// The rate of the line, in baud.
        baud: u32,
        /// The number of good messages.
        good: usize,
        /// The number of corrupt messages.
        corrupt: usize,
    },
    /// ALTER runs: no port is tested.
    ProbeRefused,
    /// A trace was written to this file.
    Trace(PathBuf),
}

/// Describes the reason why ALTER is over without an end message.
pub fn lost_text(reason: LostReason) -> &'static str {
    match reason {
        LostReason::Silence => "the robot sends nothing",
        LostReason::Restart => "the robot has started ALTER again",
        LostReason::Disconnected => "the port is gone",
    }
}
