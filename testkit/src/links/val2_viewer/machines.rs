//! Both machines as the model knows them.

use val2_viewer::host::machine::{self as host, HostMachine};
use val2_viewer::workstation::machine::{self as workstation, WorkstationMachine};
use val2_viewer::{HostConfig, WorkstationConfig};

use crate::model::{Machine, forward};

impl Machine for HostMachine {
    const END: &'static str = "host";
    type Input = host::Input;
    type Action = host::Action;
    type Config = HostConfig;

    forward!();
}

impl Machine for WorkstationMachine {
    const END: &'static str = "workstation";
    type Input = workstation::Input;
    type Action = workstation::Action;
    type Config = WorkstationConfig;

    forward!();
}
