//! Findings beside one another, and the links that are nearest to bytes that none explains.

use super::*;
use crate::unknown::nearest;

fn by_name(name: &str) -> &'static Link {
    Link::by_name(name).unwrap()
}

fn bytes(link: &str, side: &str, given: &Value, message: &Value) -> Vec<u8> {
    sent(link, side, given, std::slice::from_ref(message))
}

fn stream(sender: Sender, bytes: &[u8]) -> Stream {
    Stream { sender, parts: vec![bytes.to_vec()], arrivals: vec![] }
}

#[test]
fn findings_are_compared_by_what_they_explain_up_to_a_hundred_bits() {
    let stream = stream(Sender::Unknown, b"STA\r\n");
    let found = identify(by_name("mmacell-proto"), &[stream]).unwrap();
    let rank = |bits| Finding { bytes: [50, 200], bits, ..found.clone() }.rank();
    assert_eq!([40.0, 100.0, 400.0].map(rank), [10.0, 25.0, 25.0]);
}

#[test]
fn a_stream_of_the_other_side_than_the_port_suggests_is_read() {
    let reply = bytes(
        "fanuc-hmi-modbus",
        "server",
        &json!({}),
        &json!({"transaction": 1, "unit": 1, "function": 3, "registers": [1, 2, 3]}),
    );
    let sender = Sender::Connected { is_client: true, port: 502 };
    let found = identify(by_name("fanuc-hmi-modbus"), &[stream(sender, &reply.repeat(9))]).unwrap();
    assert_eq!((found.senders, found.messages[0]), (vec![vec!["server"]], 9));
}

#[test]
fn the_nearest_links_are_those_with_most_beginnings() {
    let links = ["val2-alter", "val2-viewer", "isra-ball", "fanuc-hmi-modbus", "laser-eb90"].map(by_name);
    let near = |bytes: &[u8]| {
        let streams = [stream(Sender::Unknown, bytes)];
        let found = nearest(&links, &streams).unwrap();
        found.into_iter().map(|it| serde_json::to_value(it).unwrap()).collect::<Vec<_>>()
    };
    assert_eq!(near(&[]), Vec::<Value>::new());
    let frame = bytes("laser-eb90", "host", &json!({}), &json!({"items": [{"i16": [257]}]}));
    let mut bad = frame.clone();
    *bad.last_mut().unwrap() ^= 1;
    let expected = [
        json!({"link": "laser-eb90", "settings": {}, "side": "host", "begin": 5, "whole": 2, "wrong": "checksum"}),
        json!({"link": "fanuc-hmi-modbus", "settings": {}, "side": "client", "begin": 1, "whole": 0, "wrong": "protocol"}),
    ];
    assert_eq!(near(&[&frame[..], &frame, &bad, &bad, &bad].concat()), expected);
    // Each setting that the source leaves open is tried alone.
    let rtu = bytes(
        "fanuc-hmi-modbus",
        "client",
        &json!({"framing": "rtu"}),
        &json!({"unit": 1, "function": 3, "address": 5, "quantity": 2}),
    );
    let expected = [
        json!({"link": "val2-viewer", "settings": {}, "side": "host", "begin": 4, "whole": 0, "wrong": "format"}),
        json!({"link": "fanuc-hmi-modbus", "settings": {"framing": "rtu"}, "side": "client", "begin": 4, "whole": 4, "wrong": null}),
    ];
    assert_eq!(near(&rtu.repeat(4)), expected);
}

/// Both ends of the link send the same messages: two streams are of two ends, even if nothing is known of them.
#[test]
fn two_streams_of_a_conversation_are_of_both_ends() {
    let job =
        bytes("kawasaki-msg", "pc", &json!({}), &json!({"name": "Job", "fields": ["1", "2"]})).repeat(5);
    let named = |name: &str| Sender::Named(name.into());
    let traced = |sent| Sender::Traced { name: "of another tool".into(), sent };
    for (first, second, expected) in [
        (Sender::Unknown, Sender::Unknown, ["pc", "robot"]),
        (traced(true), traced(false), ["pc", "robot"]),
        (named("robot"), Sender::Other("robot".into()), ["robot", "pc"]),
        (named("pc"), Sender::Other("pc".into()), ["pc", "robot"]),
        // The PC is traced, and the robot connects.
        (Sender::Kept { by_keeper: true }, Sender::Kept { by_keeper: false }, ["pc", "robot"]),
    ] {
        let streams = [stream(first, &job), stream(second, &job)];
        let found = identify(by_name("kawasaki-msg"), &streams).unwrap();
        assert_eq!(found.senders, expected.map(|side| vec![side]));
    }
}
