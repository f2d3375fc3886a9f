use fanuc_hmi_modbus::client::machine::ClientMachine;
use fanuc_hmi_modbus::server::machine::ServerMachine;

use crate::model::Drawn;

impl Drawn for ClientMachine<2> {}

impl Drawn for ServerMachine<2> {}
