//! Messages as ends of other makers write them, without the crate's codec.

use kawasaki_msg::{FromPc, FromRobot, Status};

/// A filler.
pub(super) const FILLER: &str = "<Huuhaa$0##>";

/// Returns a message; an absent value is empty.
fn message<const N: usize>(name: &str, values: [Option<u16>; N]) -> String {
    let values = values.map(|value| value.map_or(String::new(), |value| value.to_string()));
    let data = values.join("$");
    format!("<{name}${}#{data}#>", data.len())
}

/// Returns a message of a PC. The first coordinate of a job is `job`, or absent if the job is bad.
pub(super) fn from_pc(sent: FromPc, job: u8) -> String {
    match sent {
        FromPc::Status { order } => message("Tila", [Some(order), Some(2), None, None, None]),
        FromPc::Start { order, first } => message("TilausAlkaa", [Some(order), Some(first)]),
        FromPc::End { order } => message("TilausLoppuu", [Some(order)]),
        FromPc::Interrupt { order } => message("TilausKeskeytyy", [Some(order)]),
        FromPc::Job { order, number, good } => {
            let [zero, x] = [Some(0), good.then_some(job.into())];
            message("Tyo", [Some(order), Some(number), Some(1), x, zero, zero, zero])
        }
        FromPc::Filler => FILLER.into(),
        FromPc::WrongSide => message("TilausKuittaus", [Some(0)]),
        FromPc::Unusable => message("Outo", []),
    }
}

/// Returns a message of a robot.
pub(super) fn from_robot(sent: FromRobot) -> String {
    match sent {
        FromRobot::JobAck { order, number } => message("TyoKuittaus", [Some(order), Some(number)]),
        FromRobot::OrderAck { active } => message("TilausKuittaus", [Some(active)]),
        FromRobot::EndAck { ended, active, executed } => {
            message("LoppuKuittaus", [Some(ended), Some(active), executed])
        }
        FromRobot::Status(Status { order, phase, queued, executed, ended }) => {
            let ended = (ended != 0).then_some(ended);
            message("Tila", [Some(order), Some(u8::from(phase).into()), queued, executed, ended])
        }
        FromRobot::Pause { order, queued } => message("TyoTauko", [Some(order), queued]),
        FromRobot::Request { order, number } => message("TyoPyynto", [Some(order), Some(number)]),
        FromRobot::Filler => FILLER.into(),
        FromRobot::WrongSide => message("TilausAlkaa", [Some(1), Some(1)]),
        FromRobot::Unusable => message("Outo", []),
    }
}

/// The bytes of an unfinished message that the decoder holds, or that it will report as corrupt when the next one begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Held {
    /// The bytes read so far end with a message.
    Nothing,
    /// They end with a corrupt message.
    Corrupt,
    /// They end with half a filler.
    Half,
}

/// A corrupt filler.
pub(super) const CORRUPT: &str = "<Huuhaa$0###";

/// Returns the first half of a filler, after a whole one or not.
pub(super) fn half(after_filler: bool) -> Vec<u8> {
    [if after_filler { FILLER } else { "" }, &FILLER[..HALF]].concat().into()
}

/// Returns the other half.
pub(super) fn rest() -> Vec<u8> {
    FILLER[HALF..].into()
}

const HALF: usize = 5;
