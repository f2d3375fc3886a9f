//! Both machines as the model knows them.

use core::time::Duration;

use mmacell_proto::central::machine::{CentralAction, CentralInput, CentralMachine};
use mmacell_proto::device::machine::{DeviceAction, DeviceInput, DeviceMachine};
use mmacell_proto::{CentralConfig, DeviceConfig, PlatformPose};
use robot_session::Unexpected;

use crate::model::{Machine, forward};

impl Machine for CentralMachine<PlatformPose> {
    const END: &'static str = "central";
    type Input = CentralInput<PlatformPose>;
    type Action = CentralAction<PlatformPose>;
    type Config = CentralConfig;

    forward!();
}

impl Machine for DeviceMachine<PlatformPose> {
    const END: &'static str = "device";
    type Input = DeviceInput<PlatformPose>;
    type Action = DeviceAction<PlatformPose>;
    type Config = DeviceConfig;

    fn on(
        &mut self,
        _: Duration,
        input: Self::Input,
        config: &DeviceConfig,
    ) -> Result<Self::Action, Unexpected> {
        DeviceMachine::on(self, input, config)
    }

    fn each_time(&mut self, _: impl FnMut(&mut Duration)) {}

    fn name(&self) -> &'static str {
        DeviceMachine::name(self)
    }

    fn input_name(input: &Self::Input) -> &'static str {
        input.name()
    }
}
