//! A link's row of data about its bytes: the open properties, tolerated differences, and vectors.

use cellwire_links::codec::{Item, Stream};
use cellwire_links::end::EndRow;
use cellwire_links::explain::{Part, explain};
use cellwire_links::link::AcceptedMessage;
use cellwire_links::reference::field::Field;
use cellwire_links::vectors::Vector;
use serde_json::{Value, json};

use crate::link;

/// Returns the tags that streams suggest: for floats, shorts, bytes and characters.
fn tags(settings: &Value, payloads: &[(usize, &[u8])], end: u8) -> Vec<[u64; 4]> {
    let mut stream = Vec::new();
    for (times, payload) in payloads {
        for _ in 0..*times {
            stream.extend([&[0xEB, 0x90, 0x82, 0xF0][..], payload, &[0x90, end, 0]].concat());
        }
    }
    let values = link("laser-eb90").open.guess.unwrap().values;
    let tags = values(settings.as_object().unwrap(), &[&stream]);
    tags.iter().map(|it| ["f32", "i16", "u8", "char"].map(|name| it[name].as_u64().unwrap())).collect()
}

#[test]
fn tags_are_those_with_which_most_payloads_are_items() {
    const DEFAULT: [u64; 4] = [0xF0, 0xF1, 0xF2, 0xF3];
    const SHORT: &[u8] = &[0xA1, 1, 1, 1];
    const A1: [u64; 4] = [0xF0, 0xA1, 0xF2, 0xF3];
    let (strict, either) = (json!({}), json!({"tail": "either"}));
    assert_eq!(tags(&strict, &[(3, SHORT)], 0x82), [A1, DEFAULT]);
    assert_eq!(
        tags(&strict, &[(3, &[0xA1, 1, 0x90, 0x90, 7])], 0x82),
        [A1, DEFAULT],
        "a 90h of a value is doubled"
    );
    assert_eq!(tags(&strict, &[(3, SHORT)], 0x83), [DEFAULT], "another tail");
    assert_eq!(tags(&either, &[(3, SHORT)], 0x83), [A1, DEFAULT]);
    let lone: &[(usize, &[u8])] = &[(3, SHORT), (4, &[0xB1]), (4, &[0xB2])];
    assert_eq!(tags(&strict, lone, 0x82), [A1, DEFAULT], "one byte is not a payload");
    assert_eq!(tags(&strict, &[(1, &[0xD1, 9, 1])], 0x82), [DEFAULT], "items of no tags");
    // One type has four bytes: which of the two tags it is, and what the other may be besides.
    let real: &[u8] = &[0xC1, 1, 0xFF, 0xFE, 0xFD, 0xFC];
    let few: &[(usize, &[u8])] = &[(3, real), (1, &[0xC2, 1, 0xC1, 0xC1, 0xC1, 0xFF])];
    let c1_and = |i16, u8, char| [0xC1, i16, u8, char];
    let known = [
        c1_and(0xF1, 0xF2, 0xF3),
        c1_and(0xC2, 0xF2, 0xF3),
        c1_and(0xF1, 0xF2, 0xC2),
        c1_and(0xF1, 0xC2, 0xF3),
        DEFAULT,
    ];
    assert_eq!(tags(&strict, few, 0x82), known);
    let many: &[(usize, &[u8])] = &[(3, real), (2, &[0xC2, 1, 0xFF, 0xFE, 0xFD, 0xFC])];
    // Six are suggested, and the default.
    let six = [&known[..4], &[c1_and(0xC2, 0xF2, 0xFD), c1_and(0xC2, 0xFD, 0xF3), DEFAULT]].concat();
    assert_eq!(tags(&strict, many, 0x82), six);
}

#[test]
fn a_life_counter_counts_up_and_the_block_s_address_is_told() {
    let open = link("fanuc-hmi-modbus").open;
    let block = |counter: u32| json!({"telemetry": {"life_counter": counter}});
    for (before, now, bits) in
        [(1, 2, 4.0), (5, 5, 0.0), (5, 4, -4.0), (0, 9_999, 4.0), (0, 10_000, -4.0), (u32::MAX, 3, 4.0)]
    {
        assert_eq!((open.sense)(&block(before), &block(now)), bits, "{before}, {now}");
    }
    assert_eq!((open.sense)(&json!({}), &block(1)), 0.0);
    let read =
        |function, address, quantity| json!({"function": function, "address": address, "quantity": quantity});
    let messages = [
        ("client", read(3, 0, 37)),
        ("client", read(4, 5, 37)),
        ("client", read(3, 6, 2)),
        ("server", read(3, 7, 37)),
        ("client", read(3, 8, 37)),
        ("client", read(3, 8, 37)),
    ];
    let notes = [
        "the block is read at address 0: addresses count from 0, registers of $SNPX_ASG from 1",
        "the block is read at address 8: the register of $SNPX_ASG is one more",
    ];
    assert_eq!((open.notes)(&messages), notes);
}

/// A link, its settings, a message, the bytes that were read, those that are written, and whether that is accepted.
type Row<'a> = (&'a str, &'a Value, &'a Value, &'a [u8], Option<&'a [u8]>, bool);

/// Messages that are accepted although the encoder would write them in another way, or not at all.
#[test]
fn a_link_tolerates_what_its_source_leaves_open() {
    let (any, none) = (json!({}), None::<&[u8]>);
    let (coils, read) = (json!({"function": 15}), json!({"function": 3}));
    let (reserved, fresh) = (json!({"status": "reserved"}), json!({"status": "fresh"}));
    let (end, reply, role) = (json!({"kind": "end"}), json!({"kind": "reply"}), json!({"role": "job"}));
    let blank = json!({"blank": true});
    let table: [Row<'_>; 26] = [
        ("fanuc-hmi-modbus", &any, &read, &[1, 2], Some(&[1, 2]), true),
        ("fanuc-hmi-modbus", &any, &coils, &[1, 2], Some(&[1, 3]), true),
        ("fanuc-hmi-modbus", &any, &coils, &[1, 2], Some(&[1]), false),
        ("fanuc-hmi-modbus", &any, &read, &[1, 2], Some(&[1, 3]), false),
        ("fanuc-hmi-modbus", &any, &read, &[1, 2], none, true),
        ("isra-ball", &any, &reserved, &[1, 2], Some(&[1, 3]), true),
        ("isra-ball", &any, &reserved, &[1, 2], Some(&[1]), false),
        ("isra-ball", &any, &fresh, &[1, 2], Some(&[1, 3]), false),
        ("laser-eb90", &any, &json!({"items": []}), &[1, 2], none, true),
        ("laser-eb90", &any, &json!({"items": [{"f32": [null]}]}), &[1, 2], none, true),
        ("laser-eb90", &any, &json!({"items": [{"i16": [257]}]}), &[1, 2], none, false),
        ("mmacell-proto", &any, &any, b"-0", Some(b"+0"), true),
        ("mmacell-proto", &any, &any, b"-0", Some(b"+1"), false),
        ("mmacell-proto", &any, &any, b"-00", Some(b"+0"), false),
        ("mmacell-proto", &blank, &any, b"+ 0", Some(b"+0"), true),
        ("mmacell-proto", &blank, &any, b"+ 0", none, false),
        ("kawasaki-msg", &any, &any, b"<A$ 01#1#>", Some(b"<A$1#1#>"), true),
        ("kawasaki-msg", &any, &any, b"<A$ 01#1#>", Some(b"<B$1#1#>"), false),
        ("kawasaki-msg", &any, &role, b"<A$ 01#1#>", Some(b"<B$1#1#>"), true),
        ("kawasaki-msg", &any, &role, b"<A$ 01#1#>", none, false),
        ("val2-alter", &any, &reply, &[16, 16, 16, 2, 5], Some(&[16, 16, 2, 5]), true),
        ("val2-alter", &any, &reply, &[16, 2, 5], Some(&[16, 16, 2, 5]), true),
        ("val2-alter", &any, &reply, &[17, 16, 2, 5], Some(&[16, 16, 2, 5]), false),
        ("val2-alter", &any, &reply, &[16, 2, 6], Some(&[16, 16, 2, 5]), false),
        ("val2-alter", &any, &end, &[16, 2, 6], Some(&[16, 16, 2, 5]), true),
        ("val2-alter", &any, &end, &[16, 2, 6], none, false),
    ];
    for (name, settings, message, bytes, written, accepts) in table {
        let it = AcceptedMessage { settings: settings.as_object().unwrap(), message, bytes, written };
        assert_eq!(link(name).accepts(&it), accepts, "{name}: {it:?}");
    }
}

#[test]
fn a_vector_is_held_against_the_codec() {
    let message = json!({"items": [{"i16": [257]}]});
    let good = "EB9082F0F10101019082F4";
    let bad = "EB9082F0F10101019082F5";
    let table = [
        (json!({"hex": good, "result": "valid", "message": message}), ""),
        (json!({"hex": good, "result": "acceptable", "message": message}), "encodes to "),
        (json!({"hex": good, "result": "invalid", "message": message}), "the vector has not what "),
        (json!({"hex": good, "result": "valid", "message": {}}), "decodes to "),
        (json!({"hex": format!("{good}{good}"), "result": "valid", "message": message}), "decodes to "),
        (json!({"hex": good, "result": "valid", "message": message, "end": true}), "is given at the end "),
        (json!({"hex": "", "result": "valid", "message": message}), "gives nothing"),
        (json!({"hex": bad, "result": "invalid", "error": {"kind": "checksum"}, "only": true}), ""),
        (json!({"hex": bad, "result": "invalid", "error": {"kind": "checksum"}, "only": false}), "gives "),
        (json!({"hex": bad, "result": "invalid", "error": {"kind": "flag"}, "only": true}), "gives "),
        (
            json!({"hex": bad, "result": "valid", "error": {"kind": "checksum"}, "only": true}),
            "the vector has not ",
        ),
    ];
    for (mut vector, why) in table {
        vector["id"] = 1.into();
        vector["comment"] = "".into();
        let read: Vector = serde_json::from_value(vector.clone()).unwrap();
        let said = read
            .check(link("laser-eb90"), &[&read.bytes])
            .map_or_else(|error| error.to_string(), |()| String::new());
        assert!(said.starts_with(why) && said.is_empty() == why.is_empty(), "{vector}: {said}");
    }
}

#[test]
fn a_file_of_a_machine_says_how_much_of_it_was_checked() {
    let read = |name| {
        let path = format!("{}/../reference/field/{name}.json", env!("CARGO_MANIFEST_DIR"));
        Field::read(path.as_ref()).unwrap()
    };
    assert_eq!(read("example-laser-story").check().unwrap(), 1);
    let mut file = read("example-laser-vectors");
    assert_eq!(file.check().unwrap(), 4);
    file.vectors.truncate(1);
    assert_eq!(file.check().unwrap(), 3);
}

#[test]
fn what_holds_a_line_counts_in_the_offsets_of_what_follows() {
    let link = link("val2-viewer");
    let codec = || (link.codec)(link.sides[0], &serde_json::Map::new()).unwrap();
    let message = json!({"count": 7, "pose": [1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0]});
    let bytes = codec().encode(message).unwrap();
    let mut items = Vec::new();
    let mut stream = Stream::new(codec()).without(link.flow_control);
    let all = [&[0x11, 0x13][..], &bytes, &[0x11], &bytes].concat();
    let mut keep = |item: Item<'_>| {
        items.push((item.offset, item.length));
        Ok(())
    };
    stream.push(&all, &mut keep).unwrap();
    let length = bytes.len() as u64;
    assert_eq!(items, [(2, length), (3 + length, length)]);
    assert_eq!(stream.offset(), all.len() as u64);
}

/// A stuffed checksum is the last two bytes; bytes between control byte and end mark are ignored.
#[test]
fn the_parts_of_alter_s_end_and_motion_messages_are_told() {
    let parts = |settings: Value, bytes: &[u8]| -> Vec<(String, core::ops::Range<usize>, &str)> {
        let settings = settings.as_object().unwrap();
        let found = explain(link("val2-alter"), "robot", settings, bytes).unwrap().remove(0);
        assert_eq!(found.error, None);
        found.parts.into_iter().map(|Part { name, bytes, clause }| (name, bytes, clause)).collect()
    };
    let part = |name: &str, bytes, clause| (name.to_owned(), bytes, clause);
    let stuffed = [0x10, 0x10, 2, 0xE0, 0x30, 0, 0, 0, 0, 0x10, 3, 0x10, 0x10];
    let expected = [
        part("start mark", 0..3, "AL-5"),
        part("/kind", 3..4, "4"),
        part("/error", 3..4, "AL-20"),
        part("ignored", 4..9, "AL-20"),
        part("end mark", 9..11, "AL-5"),
        part("checksum", 11..13, "AL-7"),
    ];
    assert_eq!(parts(json!({"stuffed_checksum": true}), &stuffed), expected);
    let motion = [0x10, 0x10, 2, 0x83, 2, 1, 0, 0, 0x20, 0x10, 3, 0xA6];
    let control = [part("/kind", 3..4, "4"), part("/phase", 3..4, "4"), part("/error", 3..4, "AL-19")];
    assert_eq!(parts(json!({}), &motion)[1..4], control);
}

#[test]
fn an_end_behind_the_table_says_what_its_session_says() {
    let host = link("laser-eb90").end("host").unwrap();
    assert_eq!((host.calls)(), ["submit", "take_back", "resume"]);
    let made = |row: &EndRow| (row.make)(&serde_json::Map::new(), None).unwrap();
    assert_eq!(made(host).max_input(), laser_eb90::Frame::MAX_LEN);
    // One command is answered before the next one is read.
    let mut device = made(link("mmacell-proto").end("device").unwrap());
    let now = core::time::Duration::ZERO;
    device.handle_connected(now);
    assert!(device.wants_input());
    device.handle_input(now, b"STA\r\n");
    assert!(!device.wants_input(), "{}", device.state());
}
