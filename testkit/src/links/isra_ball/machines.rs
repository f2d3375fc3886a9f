//! Both machines as the model knows them.

use core::time::Duration;

use isra_ball::ball::machine::{self as ball, BallMachine};
use isra_ball::host::machine::{self as host, HostMachine};
use isra_ball::{BallConfig, HostConfig};
use robot_session::Unexpected;

use crate::model::Machine;

impl Machine for HostMachine {
    const END: &'static str = "host";
    type Input = host::Input;
    type Action = host::Action;
    type Config = HostConfig;

    fn on(
        &mut self,
        now: Duration,
        input: host::Input,
        config: &HostConfig,
    ) -> Result<host::Action, Unexpected> {
        self.on(now, input, config)
    }

    fn each_time(&mut self, f: impl FnMut(&mut Duration)) {
        self.each_time(f);
    }

    fn name(&self) -> &'static str {
        self.name()
    }

    fn input_name(input: &host::Input) -> &'static str {
        input.name()
    }

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

    fn on(
        &mut self,
        now: Duration,
        input: ball::Input,
        config: &BallConfig,
    ) -> Result<ball::Action, Unexpected> {
        self.on(now, input, config)
    }

    fn each_time(&mut self, f: impl FnMut(&mut Duration)) {
        self.each_time(f);
    }

    fn name(&self) -> &'static str {
        self.name()
    }

    fn input_name(input: &ball::Input) -> &'static str {
        input.name()
    }

    fn action_name(action: &ball::Action) -> String {
        match action {
            ball::Action::None => String::new(),
            ball::Action::Ignore => "Ignore".into(),
            ball::Action::Transmit { fresh: true } => "Transmit(fresh)".into(),
            ball::Action::Transmit { fresh: false } => "Transmit(old)".into(),
        }
    }
}
