#![cfg_attr(fuzzing, no_main)]
cellwire_fuzz::target!(fanuc_hmi_modbus_client);
