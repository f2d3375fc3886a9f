#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| cellwire_fuzz::fanuc_ls::fanuc_ls_program(data));
