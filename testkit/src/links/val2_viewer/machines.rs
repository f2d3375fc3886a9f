//! Both machines as the model knows them.

use core::time::Duration;

use robot_session::Unexpected;
use val2_viewer::host::machine::{self as host, HostMachine};
use val2_viewer::workstation::machine::{self as workstation, WorkstationMachine};
use val2_viewer::{HostConfig, WorkstationConfig};

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
}

impl Machine for WorkstationMachine {
    const END: &'static str = "workstation";
    type Input = workstation::Input;
    type Action = workstation::Action;
    type Config = WorkstationConfig;

    fn on(
        &mut self,
        now: Duration,
        input: workstation::Input,
        config: &WorkstationConfig,
    ) -> Result<workstation::Action, Unexpected> {
        self.on(now, input, config)
    }

    fn each_time(&mut self, f: impl FnMut(&mut Duration)) {
        self.each_time(f);
    }

    fn name(&self) -> &'static str {
        self.name()
    }

    fn input_name(input: &workstation::Input) -> &'static str {
        input.name()
    }
}
