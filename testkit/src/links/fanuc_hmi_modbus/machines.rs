//! Both machines as the model knows them.

use fanuc_hmi_modbus::{
    ClientAction, ClientConfig, ClientInput, ClientMachine, ServerAction, ServerConfig, ServerInput,
    ServerMachine,
};

use crate::model::{Machine, forward};

impl Machine for ClientMachine<2> {
    const END: &'static str = "client";
    type Input = ClientInput;
    type Action = ClientAction;
    type Config = ClientConfig;

    forward!();
}

impl Machine for ServerMachine<2> {
    const END: &'static str = "server";
    type Input = ServerInput;
    type Action = ServerAction;
    type Config = ServerConfig;

    forward!();
}
