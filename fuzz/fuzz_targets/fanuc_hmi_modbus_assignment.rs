#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| cellwire_fuzz::fanuc_hmi_modbus::fanuc_hmi_modbus_assignment(data));
