//! Both machines as the model drives them.

use kawasaki_msg::pc::machine as pc;
use kawasaki_msg::robot::machine as robot;

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
        let text = match action.action {
            pc::Action::Nothing | pc::Action::Sent => return String::new(),
            pc::Action::Outcome { outcome, .. } => format!("{outcome:?}"),
            action => format!("{action:?}"),
        };
        text.split(' ').next().unwrap_or_default().into()
    }
}
