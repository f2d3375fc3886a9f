use core::time::Duration;

use fanuc_hmi_modbus::{Decoder, Framing, Side};
use serde_json::json;
use testkit::contract;
use testkit::vectors::{Outcome, Vector, vectors};

const LINK: &str = "fanuc-hmi-modbus";

pub fn decoder() {
    for (from, side) in [("client", Side::Client), ("server", Side::Server)] {
        let valid = |is_one: fn(&Vector) -> bool| -> Vec<Vec<u8>> {
            let mut all = vectors(LINK);
            all.retain(|v| v.result == Outcome::Valid && v.from.as_deref() == Some(from) && is_one(v));
            all.into_iter().map(|v| v.hex).collect()
        };
        // After corruption nothing says where a frame begins whose function has no length, or another one than its own.
        let frames = valid(|v| v.options.is_empty() && !v.flags.iter().any(|flag| flag == "other"));
        contract::decoder_where("modbus, TCP", || Decoder::new(Framing::Tcp, side), &frames, tcp_spread);
        let rtu = Framing::Rtu { silence: Duration::from_millis(4) };
        let frames = valid(|v| v.options.len() == 1 && v.options.get("framing") == Some(&json!("rtu")));
        contract::decoder("modbus, RTU", || Decoder::new(rtu, side), &frames, 1);
    }
}

/// A corrupt byte costs its own frame, but in the length field: nothing says that a length is wrong which a frame can have, and
/// what it covers is lost. The six frames of the test are less than that.
fn tcp_spread(frame: &[u8], at: usize) -> usize {
    let length = u16::from_be_bytes([frame[4], frame[5]]);
    if matches!(at, 4 | 5) && (2..=254).contains(&length) { 6 } else { 0 }
}
