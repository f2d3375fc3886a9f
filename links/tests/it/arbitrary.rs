//! Messages of the feature `arbitrary`: every codec writes what it makes of a fuzzer's bytes.

use arbitrary::Unstructured;
use cellwire_links::LINKS;
use cellwire_links::codec::items;
use robot_session::contract::Rng;
use serde_json::{Value, json};

#[test]
fn any_bytes_are_a_message_of_every_side_that_decodes_to_itself() {
    let others = [
        ("kawasaki-msg", json!({"roles": true})),
        ("fanuc-hmi-modbus", json!({"framing": "rtu"})),
        (
            "laser-eb90",
            json!({"tail": "etx", "byte_order": "big", "tags": {"f32": 1, "i16": 2, "u8": 3, "char": 4}}),
        ),
        ("mmacell-proto", json!({"itr": true, "ovrd": true, "lone_lf": true, "wide_integers": true})),
    ];
    for link in LINKS {
        let others =
            others.iter().filter(|(name, _)| *name == link.name).map(|(_, settings)| settings.clone());
        for (side, settings) in
            others.chain([json!({})]).flat_map(|it| link.sides.iter().map(move |side| (side, it.clone())))
        {
            let codec = || (link.codec)(side, settings.as_object().unwrap()).unwrap();
            let mut made = 0;
            for seed in 0..500 {
                let mut rng = Rng::new(seed);
                let bytes: Vec<u8> = (0..rng.below(200)).map(|_| rng.next_u64().to_le_bytes()[0]).collect();
                let Ok(message) = codec().arbitrary(&mut Unstructured::new(&bytes)) else { continue };
                let written =
                    codec().encode(message.clone()).unwrap_or_else(|error| panic!("{error}: {message}"));
                let read: Vec<Result<Value, Value>> = items(codec(), &[vec![&written]])
                    .unwrap()
                    .iter()
                    .map(|item| item.value().unwrap())
                    .collect();
                assert_eq!(read, [Ok(message)], "{} {side} {settings}: {written:02X?}", link.name);
                made += 1;
            }
            assert!(made > 450, "{} {side}: {made} of 500 inputs are long enough", link.name);
        }
    }
}
