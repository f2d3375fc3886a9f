//! The views of Modbus replies.

use cellwire_links::codec::{Codec, items};
use serde_json::{Map, Value, json};

use crate::link;

fn codec(side: &str, settings: &Map<String, Value>) -> anyhow::Result<Box<dyn Codec>> {
    (link("fanuc-hmi-modbus").codec)(side, settings)
}

fn options(settings: &[(&str, &str)]) -> Map<String, Value> {
    settings.iter().map(|(name, value)| ((*name).into(), (*value).into())).collect()
}

#[test]
fn the_telemetry_view_shows_the_block_and_encodes_it_again() {
    for (order, counter) in [("low_first", 0x0001_86A0), ("high_first", 0x86A0_0001_u32)] {
        let options = options(&[("view", "telemetry"), ("word_order", order)]);
        let mut registers = vec![0; 37];
        registers[..5].copy_from_slice(&[0x86A0, 0x0001, 100, 0xE979, 0x42F6]);
        let plain = json!({"transaction": 1, "unit": 1, "function": 3, "registers": registers});
        let bytes = codec("server", &options).unwrap().encode(plain).unwrap();
        let items = items(codec("server", &options).unwrap(), &[vec![&bytes]]).unwrap();
        let message = items[0].value().unwrap().unwrap();
        assert_eq!(message["telemetry"]["life_counter"], counter);
        assert_eq!(message["telemetry"]["override"], 100);
        assert_eq!(message.get("registers"), None);
        assert_eq!(codec("server", &options).unwrap().encode(message).unwrap(), bytes);
    }
}

#[test]
fn other_replies_look_the_same_in_every_view() {
    let reply = json!({"unit": 1, "function": 3, "registers": [1, 2]});
    let options = options(&[("view", "telemetry"), ("framing", "rtu")]);
    let codec = || codec("server", &options).unwrap();
    let bytes = codec().encode(reply.clone()).unwrap();
    let items = items(codec(), &[vec![&bytes]]).unwrap();
    assert_eq!(items[0].value().unwrap(), Ok(reply));
    assert_eq!(items.len(), 1);
}

#[test]
fn what_is_asked_wrongly_is_said() {
    let error = |settings: &Map<String, Value>| codec("client", settings).err().unwrap().to_string();
    assert_eq!(
        error(&options(&[("framing", "ascii")])),
        "framing=ascii: not one of the choices, give tcp, rtu"
    );
    assert_eq!(
        error(&options(&[("view", "x")])),
        "view=x: not one of the choices, give registers, telemetry"
    );
    let request = json!({"unit": 1, "function": 3, "address": 0, "quantity": 37});
    let tcp = codec("client", &options(&[])).unwrap();
    let error = tcp.encode(request).unwrap_err().to_string();
    assert_eq!(error, "a key is missing: transaction, or use --set framing=rtu");
    let request = json!({"transaction": 1, "unit": 1, "function": 3, "address": 0, "quantity": 126});
    let error = tcp.encode(request).unwrap_err().to_string();
    assert_eq!(error, "quantity 126 in function 3 is not within 1 to 125");
    let request = json!({"transaction": 1, "unit": 1, "function": 3, "address": 65535, "quantity": 2});
    let error = tcp.encode(request).unwrap_err().to_string();
    assert_eq!(error, "2 items from address 65535 exceed address 65535");
}
