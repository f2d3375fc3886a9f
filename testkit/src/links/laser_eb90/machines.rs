use laser_eb90::controller::machine::{self as controller, Answer, ControllerMachine};
use laser_eb90::host::machine::{self as host, HostMachine};

use crate::model::DrawnMachine;

impl DrawnMachine for HostMachine {
    fn action_name(action: &Self::Action) -> String {
        match action {
            host::Action::Nothing => String::new(),
            host::Action::Sent(_) => "Sent".into(),
            host::Action::Report(_, outcome) => {
                let outcome = format!("{outcome:?}");
                let words: Vec<&str> = outcome.split(|c: char| !c.is_alphanumeric()).collect();
                if words[0] == "Unknown" { format!("Unknown, {}", words[1]) } else { words[0].into() }
            }
            host::Action::Unasked { .. } => "Unasked".into(),
        }
    }
}

impl DrawnMachine for ControllerMachine {
    fn action_name(action: &Self::Action) -> String {
        match action {
            controller::Action::Nothing => String::new(),
            controller::Action::Execute => "Execute".into(),
            controller::Action::Answer(Answer::Echo(_)) => "Echo".into(),
            controller::Action::Answer(Answer::Error(_)) => "Error".into(),
            controller::Action::Sent => "Sent".into(),
        }
    }
}
