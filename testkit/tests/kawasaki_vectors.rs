//! Every vector of `reference/vectors/kawasaki-msg.json`, however it is cut.
#![cfg(feature = "links")]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

use kawasaki_msg::robot_session::Decoder as _;
use kawasaki_msg::{Charset, Decoder, Message, Value, Values};
use serde_json::{Value as Json, json};
use testkit::chunking::{after_a_cut, chunkings};
use testkit::vectors::{Outcome, Vector, includes, vectors};

fn charset(vector: &Vector) -> Charset {
    let option = vector.options.get("charset").cloned();
    option.map_or(Charset::Ascii, |name| serde_json::from_value(name).unwrap())
}

/// What a decoder says: objects of messages, and objects of errors under `error`.
fn decode(charset: Charset, chunks: &[&[u8]]) -> Vec<Json> {
    let mut decoder = Decoder::new(charset);
    let mut said = Vec::new();
    for mut chunk in chunks.iter().copied() {
        while !chunk.is_empty() {
            chunk = &chunk[decoder.push(chunk)..];
            drain(&mut decoder, &mut said);
        }
    }
    decoder.finish();
    drain(&mut decoder, &mut said);
    assert_eq!(decoder.position(), chunks.concat().len() as u64, "every byte is somebody's");
    said
}

fn drain(decoder: &mut Decoder, said: &mut Vec<Json>) {
    while let Some(result) = decoder.next_frame() {
        said.push(match result {
            Ok(message) => serde_json::to_value(message).unwrap(),
            Err(error) => json!({ "error": error }),
        });
    }
}

/// What the vector wants of a decoder.
fn fits(vector: &Vector, said: &Json) -> bool {
    match vector.result {
        Outcome::Valid | Outcome::Acceptable => Some(said) == vector.message.as_ref(),
        Outcome::Invalid => includes(&said["error"], vector.error.as_ref().unwrap()),
    }
}

fn encode(charset: Charset, message: &Json) -> Vec<u8> {
    let list = |key: &str| -> Vec<String> { serde_json::from_value(message[key].clone()).unwrap() };
    let (header, fields) = (list("header"), list("fields"));
    let values = |texts: &[String]| texts.iter().map(|t| Value::Text(t.clone().leak())).collect::<Vec<_>>();
    let (header, fields) = (values(&header), values(&fields));
    let message = Message {
        name: Value::Text(message["name"].as_str().unwrap()),
        header: Values::List(&header),
        fields: Values::List(&fields),
    };
    let mut wire = vec![0; message.encoded_len()];
    assert_eq!(message.encode(charset, &mut wire), Ok(wire.len()));
    wire
}

#[test]
fn every_vector_gives_its_object_however_it_is_cut() {
    for vector in vectors("kawasaki-msg") {
        for chunks in chunkings(&vector.hex) {
            let said = decode(charset(&vector), &chunks);
            assert!(fits(&vector, &said[0]), "vector {}: {said:?} from {chunks:?}", vector.id);
            assert_eq!(said.len(), 1, "vector {}: {said:?}", vector.id);
        }
    }
}

#[test]
fn every_valid_vector_is_what_the_encoder_writes() {
    for vector in vectors("kawasaki-msg") {
        let Some(message) = &vector.message else { continue };
        let wire = encode(charset(&vector), message);
        let same = wire == vector.hex;
        assert_eq!(same, vector.result == Outcome::Valid, "vector {}: {}", vector.id, wire.escape_ascii());
        assert_eq!(
            decode(charset(&vector), &[&wire]),
            core::slice::from_ref(message),
            "vector {}",
            vector.id
        );
    }
}

#[test]
fn a_neighbour_changes_nothing_and_survives() {
    let neighbour = b"<TilausKuittaus$2#50#>";
    let object = json!({"name": "TilausKuittaus", "header": [], "fields": ["50"]});
    for vector in vectors("kawasaki-msg") {
        let glued = [&vector.hex[..], neighbour].concat();
        for chunks in chunkings(&glued) {
            let said = decode(charset(&vector), &chunks);
            assert_eq!(said.last(), Some(&object), "vector {} from {chunks:?}", vector.id);
            // What was incomplete alone is cut off by the neighbour: another error, at another place.
            let incomplete = vector.error.as_ref().is_some_and(|e| e["kind"] == "incomplete");
            assert!(incomplete || fits(&vector, &said[0]), "vector {}: {said:?}", vector.id);
        }
    }
}

#[test]
fn a_message_cut_off_anywhere_costs_only_itself() {
    let corrupt = b"<TilausAlkaa$ekstra$4#50$1#>";
    for vector in vectors("kawasaki-msg") {
        if vector.result == Outcome::Invalid {
            continue;
        }
        for stream in after_a_cut(corrupt, &vector.hex) {
            let said = decode(charset(&vector), &[&stream]);
            assert!(said[0].get("error").is_some(), "{said:?}");
            assert_eq!(said.last(), vector.message.as_ref(), "vector {}", vector.id);
            assert_eq!(said.len(), 2, "vector {}: {said:?}", vector.id);
        }
    }
}
