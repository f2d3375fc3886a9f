#![cfg_attr(fuzzing, no_main)]

cellwire_fuzz::program!(cellwire_fuzz::fanuc_hmi_modbus::fanuc_hmi_modbus_motion);
