#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| cellwire_fuzz::val2_viewer::val2_viewer_host(data));
