//! Every reference vector, both ways and through every way of cutting the stream.

use laser_eb90::{DecodeError, Decoder, Frame, MAX_PAYLOAD, Payload, Profile};
use robot_session::{Decoder as _, Encode as _};
use serde::de::DeserializeSeed as _;
use serde_json::{Value, json};
use testkit::chunking::{after_a_cut, chunkings};
use testkit::vectors::{Outcome, Vector, includes, vectors};

fn profile(vector: &Vector) -> Profile {
    serde_json::from_value(Value::Object(vector.options.clone())).unwrap()
}

/// Through text, as a reader of JSON lines sees it.
fn object(serializable: &impl serde::Serialize) -> Value {
    serde_json::from_str(&serde_json::to_string(serializable).unwrap()).unwrap()
}

/// Message and error objects with their lengths, and the error of the rest.
fn decode(profile: &Profile, chunks: &[&[u8]]) -> Vec<(Result<Value, Value>, u64)> {
    fn drain(decoder: &mut Decoder, found: &mut Vec<(Result<Value, Value>, u64)>) {
        loop {
            let before = decoder.position();
            let Some(frame) = decoder.next_frame() else { return };
            let content = frame.map(|f| object(&f)).map_err(|e| object(&e));
            found.push((content, decoder.position() - before));
        }
    }
    let mut decoder = Decoder::new(profile);
    let mut found = Vec::new();
    for mut chunk in chunks.iter().copied() {
        while !chunk.is_empty() {
            let taken = decoder.push(chunk);
            chunk = &chunk[taken..];
            drain(&mut decoder, &mut found);
        }
    }
    decoder.finish();
    drain(&mut decoder, &mut found);
    found
}

fn encode(profile: &Profile, message: &Value) -> Vec<u8> {
    let mut buffer = [0; MAX_PAYLOAD];
    let mut payload = Payload::new(&mut buffer, profile);
    payload.deserialize(message).unwrap();
    let frame = payload.frame().unwrap();
    let mut out = vec![0; frame.encoded_len()];
    assert_eq!(frame.encode(&mut out), Ok(out.len()));
    let mut appended = Vec::new();
    frame.append_to(&mut appended);
    assert_eq!(appended, out);
    out
}

#[test]
fn every_vector_both_ways() {
    for v in vectors("laser-eb90") {
        let found = decode(&profile(&v), &[&v.hex]);
        let covered: u64 = found.iter().map(|(_, len)| len).sum();
        assert_eq!(covered, v.hex.len() as u64, "{}: {found:?}", v.id);
        match (v.result, &v.message, &v.error) {
            (Outcome::Valid | Outcome::Acceptable, Some(message), _) => {
                assert_eq!(found, [(Ok(message.clone()), covered)], "{}", v.id);
                let encoded = encode(&profile(&v), message);
                assert_eq!(encoded == v.hex, v.result == Outcome::Valid, "{}: {encoded:02X?}", v.id);
            }
            (_, _, Some(error)) => {
                let first = found[0].0.as_ref().unwrap_err();
                assert!(includes(first, error), "{}: {first}", v.id);
            }
            _ => unreachable!("the reader has checked it"),
        }
    }
}

#[test]
fn any_cutting_of_the_stream_gives_the_same() {
    for v in vectors("laser-eb90") {
        let whole = decode(&profile(&v), &[&v.hex]);
        for chunks in chunkings(&v.hex) {
            assert_eq!(decode(&profile(&v), &chunks), whole, "{}", v.id);
        }
    }
}

#[test]
fn glued_vectors_are_two_frames() {
    let mut all = vectors("laser-eb90");
    all.retain(|v| v.hex.len() < 64);
    for a in all.iter().filter(|v| v.result == Outcome::Valid) {
        for b in all.iter().filter(|b| b.result == Outcome::Valid && b.options == a.options) {
            let found = decode(&profile(a), &[&[&a.hex[..], &b.hex].concat()]);
            let messages: Vec<_> = found.into_iter().map(|(content, _)| content).collect();
            assert_eq!(messages, [Ok(a.message.clone().unwrap()), Ok(b.message.clone().unwrap())]);
        }
    }
}

/// A frame cut anywhere costs itself alone. One exception belongs to the format: the cut takes a one-byte checksum that
/// the EBh of the next head happens to equal.
#[test]
fn a_frame_behind_a_cut_one_is_found() {
    for v in vectors("laser-eb90").iter().filter(|v| v.result == Outcome::Valid) {
        let message = v.message.clone().unwrap();
        for stream in after_a_cut(&v.hex, &v.hex) {
            let found = decode(&profile(v), &[&stream]);
            if stream.len() == 2 * v.hex.len() - 1 && v.hex.last() == Some(&0xEB) {
                assert_eq!(found[0].0, Ok(message.clone()));
                continue;
            }
            assert_eq!(found.last().unwrap(), &(Ok(message.clone()), v.hex.len() as u64), "{}", v.id);
            assert!(found[..found.len() - 1].iter().all(|(content, _)| content.is_err()), "{}", v.id);
        }
    }
}

#[test]
fn a_frame_decodes_without_a_decoder() {
    let bytes = encode(&Profile::default(), &json!({"items": [{"char": "HELLO"}]}));
    let mut payload = [0; 7];
    for cut in 0..bytes.len() {
        assert_eq!(Frame::decode(&bytes[..cut], &mut payload, &Profile::default()), Ok(None));
    }
    let (frame, used) = Frame::decode(&bytes, &mut payload, &Profile::default()).unwrap().unwrap();
    assert_eq!((frame.payload(), used), (&b"\xF3\x05HELLO"[..], bytes.len()));
    let error = Frame::decode(&bytes, &mut [0; 6], &Profile::default()).unwrap_err();
    assert_eq!(error.to_string(), "the payload is longer than 6 bytes (at byte 10)");
    // The checksum is right: a false head can be followed by that too.
    let no_tag = [0xEB, 0x90, 0x82, 0xF0, 0x55, 0x01, 0x90, 0x82, 0x56];
    let error = Frame::decode(&no_tag, &mut payload, &Profile::default()).unwrap_err();
    assert_eq!(error, DecodeError::Tag { offset: 0, found: 0x55 });
}

/// Whatever a decoder finds first is what a frame decodes to by itself, once its items are looked at too.
#[test]
fn every_vector_without_a_decoder() {
    for v in vectors("laser-eb90") {
        let mut payload = [0; MAX_PAYLOAD];
        let found = Frame::decode(&v.hex, &mut payload, &profile(&v));
        let found =
            found.and_then(|frame| frame.map(|(f, used)| f.items().check().map(|()| (f, used))).transpose());
        match (found, &v.message, &v.error) {
            (Ok(Some((frame, used))), Some(message), _) => {
                assert_eq!((&object(&frame), used), (message, v.hex.len()), "{}", v.id);
            }
            (Ok(None), _, Some(error)) => assert_eq!(error["kind"], "incomplete", "{}", v.id),
            // Without a decoder nothing is skipped: all that is there is no frame.
            (Err(DecodeError::NoHead { skipped }), _, Some(error)) => {
                assert_eq!((&error["kind"], skipped), (&json!("no_head"), v.hex.len()), "{}", v.id);
            }
            (Err(found), _, Some(error)) => assert!(includes(&object(&found), error), "{}: {found}", v.id),
            (found, ..) => panic!("{}: {found:?}", v.id),
        }
    }
}

#[test]
fn what_is_no_message_is_refused() {
    let refused = |message: Value| {
        let mut buffer = [0; 64];
        let mut payload = Payload::new(&mut buffer, &Profile::default());
        let error = payload.deserialize(&message).unwrap_err().to_string();
        assert!(payload.as_bytes().is_empty());
        error
    };
    assert_eq!(refused(json!({})), "missing field `items`");
    assert_eq!(refused(json!({"items": [{"i16": [40000]}]})), "invalid value: integer `40000`, expected i16");
    assert_eq!(refused(json!({"items": [{"char": "€"}]})), "'€' is no character U+0000 to U+00FF");
    assert_eq!(
        refused(json!({"items": [{"u8": vec![0; 256]}]})),
        "an item holds at most 255 values, not 256"
    );
    assert_eq!(refused(json!({"items": [{"f32": vec![0; 16]}]})), "66 bytes do not fit into 64");
    assert_eq!(
        refused(json!({"items": [{"f64": []}]})),
        "unknown field `f64`, expected one of `f32`, `i16`, `u8`, `char`"
    );
}
