//! Both machines as the model drives them.

use core::time::Duration;

use kawasaki_msg::pc::machine as pc;
use kawasaki_msg::robot::machine as robot;
use kawasaki_msg::{FromRobot, RobotConfig};
use robot_session::end::Machine as _;

use crate::model::DrawnMachine;

pub use pc::Machine as Pc;
pub use robot::Machine as Robot;

/// Returns the packet that is due, with space for all its messages.
pub(super) fn packet(robot: &Robot, config: &RobotConfig) -> (Vec<FromRobot>, robot::SentPacket) {
    let due = robot.transmit(Duration::ZERO, config).expect("a packet is due");
    let (acked, acks): (Vec<u32>, Vec<FromRobot>) = robot.acks(&due, config).unzip();
    let replies = [due.start, due.end, due.status, due.pause, due.request].into_iter().flatten();
    let mut messages: Vec<_> = acks.into_iter().chain(replies).collect();
    if messages.is_empty() {
        messages.push(FromRobot::Filler);
    }
    (messages, sent(&due, acked.iter().sum()))
}

/// Returns the contents of a packet with every message that is due, and with the acknowledgements of this many jobs.
pub(super) fn sent(due: &robot::DuePacket, acked: u32) -> robot::SentPacket {
    robot::SentPacket {
        acked,
        start: due.start.is_some(),
        end: due.end.is_some(),
        status: due.status.is_some(),
        pause: due.pause.is_some(),
        request: due.request.is_some(),
    }
}

impl DrawnMachine for Robot {
    fn action_name(action: &Self::Action) -> String {
        use robot::Action;
        match action {
            // A table of states has it; in a diagram it would be at every arrow.
            Action::Nothing | Action::Connected | Action::Sent | Action::Answered => String::new(),
            action => format!("{action:?}"),
        }
    }
}

impl DrawnMachine for Pc {
    fn action_name(action: &Self::Action) -> String {
        let text = match action.action {
            pc::Action::Nothing | pc::Action::Sent => return String::new(),
            pc::Action::Outcome { outcome, .. } => format!("{outcome:?}"),
            action => format!("{action:?}"),
        };
        text.split(' ').next().unwrap_or_default().into()
    }
}
