//! The constants of the models of both ends, and their properties.

use core::time::Duration;

use mmacell_proto::PlatformPose;
use robot_session::Encode;

pub(super) type Pose = PlatformPose;

pub(super) const TICK: Duration = Duration::from_millis(50);
pub(super) const HOME: Pose = PlatformPose::ORIGIN;
/// The pose at which a motion ends that something stops.
pub(super) const BETWEEN: Pose = PlatformPose::from_units([5_000, 0]);

pub(super) const DONE: &str = "done: executed";
pub(super) const NOT_DONE: &str = "not done: not executed";
pub(super) const ONCE: &str = "a command is sent once, when the one before is answered";
pub(super) const OUTCOME: &str = "one outcome for each request";
pub(super) const ARRIVED: &str = "arrived: at rest at the target, servo motors on";
pub(super) const NOT_MISSED: &str = "missed: not under way";
pub(super) const NO_TARGET: &str = "no target: neither arrived nor missed";
pub(super) const IN_FAULT: &str = "nothing moves in a fault";
pub(super) const ONE_MOTION: &str = "one motion at a time";
pub(super) const NO_BREAK: &str = "no connection ends without a fault";
pub(super) const STRAY: &str = "an unsolicited reply is reported";
pub(super) const SERVO_OFF: &str = "nothing moves with the servo motors off";
pub(super) const PENDING: &str = "only the order that is pending is accepted";

pub(super) fn bytes<M: Encode>(message: &M) -> Vec<u8> {
    let mut out = vec![0; message.encoded_len()];
    let Ok(length) = message.encode(&mut out) else { panic!("every message of the model has a form") };
    out.truncate(length);
    out
}
