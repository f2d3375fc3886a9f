//! Both machines as the model drives them.

use core::time::Duration;

use kawasaki_msg::{FromPc, pc, robot};
use robot_session::Machine as _;

use crate::model::Drawn;

/// 64 job numbers are enough for it.
pub type Robot = robot::Machine<1>;
/// As [`Robot`].
pub type Pc = pc::Machine<1>;

impl Drawn for Robot {
    fn action_name(action: &Self::Action) -> String {
        use robot::Action;
        match action {
            // A table of states says it; in a diagram it would be at every arrow.
            Action::Nothing | Action::Connected | Action::Sent | Action::Answered => String::new(),
            action => format!("{action:?}"),
        }
    }
}

impl Drawn for Pc {
    fn action_name(action: &Self::Action) -> String {
        let text = match action {
            pc::Action::Nothing | pc::Action::Sent => return String::new(),
            pc::Action::Outcome { outcome, .. } => format!("{outcome:?}"),
            action => format!("{action:?}"),
        };
        text.split(' ').next().unwrap_or_default().into()
    }
}

/// Whether the fast path leaves the robot where the slow one does: for the jobs that it would take of those that come next, with so
/// many free places in the queue.
pub fn fast_is_slow(
    robot: &Robot,
    messages: impl Iterator<Item = FromPc>,
    free: usize,
    config: &robot::Config,
) -> bool {
    let Some((order, mut number)) = robot.fast_path(config) else { return true };
    let (mut slow, mut count) = (robot.clone(), 0);
    for message in messages.take(free) {
        if message != (FromPc::Job { order, number, good: true }) {
            break;
        }
        let input = robot::Input::Message { message, room: true };
        if slow.on(Duration::ZERO, input, config) != Ok(robot::Action::Queue) {
            return false;
        }
        number = number % config.max_number + 1;
        count += 1;
        let mut fast = robot.clone();
        let queued = fast.on(Duration::ZERO, robot::Input::Queued { count }, config);
        if queued != Ok(robot::Action::Nothing) || fast != slow {
            return false;
        }
    }
    true
}
