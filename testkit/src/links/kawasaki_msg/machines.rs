//! Both machines as the model drives them.

use core::time::Duration;

use kawasaki_msg::{FromPc, RobotConfig, pc, robot};

use crate::model::{self, adapt, forward};

/// 64 job numbers are enough for it.
pub type Robot = robot::Machine<1>;
/// As [`Robot`].
pub type Pc = pc::Machine<1>;

impl model::Machine for Robot {
    const END: &'static str = "robot";
    type Input = robot::Input;
    type Action = robot::Action;
    type Config = RobotConfig<'static>;

    forward!();

    fn action_name(action: &robot::Action) -> String {
        if *action == robot::Action::Nothing { String::new() } else { format!("{action:?}") }
    }
}

adapt!(Pc, action_name = pc_action);

fn pc_action(action: &pc::Action) -> String {
    let text = match action {
        pc::Action::Nothing | pc::Action::Sent => return String::new(),
        pc::Action::Outcome { outcome, .. } => format!("{outcome:?}"),
        action => format!("{action:?}"),
    };
    text.split(' ').next().unwrap_or_default().into()
}

/// Whether the fast path leaves the robot where the slow one does: for the jobs that it would take of those that come next, with so
/// many free places in the queue.
pub fn fast_is_slow(
    robot: &Robot,
    messages: impl Iterator<Item = FromPc>,
    free: usize,
    config: &RobotConfig,
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
