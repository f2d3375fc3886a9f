//! Both machines as the model knows them.

use isra_ball::ball::machine::{self as ball, BallMachine};
use isra_ball::host::machine::{self as host, HostMachine};
use isra_ball::{BallConfig, HostConfig};

use crate::model::{Machine, forward};

impl Machine for HostMachine {
    const END: &'static str = "host";
    type Input = host::Input;
    type Action = host::Action;
    type Config = HostConfig;

    forward!();

    fn action_name(action: &host::Action) -> String {
        match action {
            host::Action::None => String::new(),
            other => format!("{other:?}").split(' ').next().unwrap_or_default().into(),
        }
    }
}

impl Machine for BallMachine {
    const END: &'static str = "ball";
    type Input = ball::Input;
    type Action = ball::Action;
    type Config = BallConfig;

    forward!();

    fn action_name(action: &ball::Action) -> String {
        match action {
            ball::Action::None => String::new(),
            ball::Action::Ignore => "Ignore".into(),
            ball::Action::Transmit { fresh: true } => "Transmit(fresh)".into(),
            ball::Action::Transmit { fresh: false } => "Transmit(old)".into(),
        }
    }
}
