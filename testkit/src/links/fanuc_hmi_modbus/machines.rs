//! Both machines as the model knows them.

use core::time::Duration;

use fanuc_hmi_modbus::{
    ClientAction, ClientConfig, ClientInput, ClientMachine, ServerAction, ServerConfig, ServerInput,
    ServerMachine,
};
use robot_session::Unexpected;

use crate::model::Machine;

impl Machine for ClientMachine<2> {
    const END: &'static str = "client";
    type Input = ClientInput;
    type Action = ClientAction;
    type Config = ClientConfig;

    fn on(
        &mut self,
        now: Duration,
        input: ClientInput,
        config: &ClientConfig,
    ) -> Result<ClientAction, Unexpected> {
        ClientMachine::on(self, now, input, config)
    }

    fn each_time(&mut self, f: impl FnMut(&mut Duration)) {
        ClientMachine::each_time(self, f);
    }

    fn name(&self) -> &'static str {
        ClientMachine::name(self)
    }

    fn input_name(input: &ClientInput) -> &'static str {
        input.name()
    }
}

impl Machine for ServerMachine<2> {
    const END: &'static str = "server";
    type Input = ServerInput;
    type Action = ServerAction;
    type Config = ServerConfig;

    fn on(
        &mut self,
        now: Duration,
        input: ServerInput,
        config: &ServerConfig,
    ) -> Result<ServerAction, Unexpected> {
        ServerMachine::on(self, now, input, config)
    }

    fn each_time(&mut self, f: impl FnMut(&mut Duration)) {
        ServerMachine::each_time(self, f);
    }

    fn name(&self) -> &'static str {
        ServerMachine::name(self)
    }

    fn input_name(input: &ServerInput) -> &'static str {
        input.name()
    }
}
