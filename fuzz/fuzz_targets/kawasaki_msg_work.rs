#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| cellwire_fuzz::kawasaki_work::kawasaki_msg_work(data));
