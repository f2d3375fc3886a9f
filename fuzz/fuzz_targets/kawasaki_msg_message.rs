#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| cellwire_fuzz::kawasaki_msg::kawasaki_msg_message(data));
