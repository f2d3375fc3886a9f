use fanuc_hmi_modbus::client::machine::ClientMachine;
use fanuc_hmi_modbus::server::machine::ServerMachine;

use crate::model::adapt;

adapt!(ClientMachine<2>);
adapt!(ServerMachine<2>);
