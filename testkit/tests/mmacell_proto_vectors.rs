//! Every vector of `reference/vectors/mmacell-proto.json`: whole, in pieces, glued to its neighbours, after a cut line.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

use mmacell_proto::robot_session::Decoder as _;
use mmacell_proto::robot_session::Encode as _;
use mmacell_proto::{AnyPose, Command, DecodeError, Decoder, Dialect, Line, PlatformPose, Reply, RobotPose};
use serde_json::{Value, json};
use testkit::chunking::{after_a_cut, chunkings};
use testkit::vectors::{Outcome, Vector, includes, vectors};

fn dialect(vector: &Vector) -> Dialect {
    serde_json::from_value(Value::Object(vector.options.clone())).unwrap()
}

/// What a line from this side is, as the tool prints it.
fn object(from: &str, line: Result<Line<'_>, DecodeError>, dialect: &Dialect) -> Value {
    let message = line.and_then(|line| {
        Ok(match from {
            "central" => json!(Command::<AnyPose>::decode(line, dialect)?),
            "robot" => json!(Reply::<RobotPose>::decode(line, dialect)?),
            "platform" => json!(Reply::<PlatformPose>::decode(line, dialect)?),
            other => panic!("{other} is no side of this link"),
        })
    });
    match message {
        Ok(message) => json!({ "message": message }),
        Err(error) => json!({ "error": error }),
    }
}

fn encode(from: &str, message: &Value, dialect: Dialect) -> Vec<u8> {
    fn bytes(encode: impl Fn(&mut [u8]) -> usize, len: usize) -> Vec<u8> {
        let mut buffer = vec![0xAA; len];
        assert_eq!(encode(&mut buffer), len);
        buffer
    }
    let message = message.clone();
    match from {
        "central" => {
            let command = serde_json::from_value::<Command<AnyPose>>(message).unwrap().in_dialect(dialect);
            bytes(|to| command.encode(to).unwrap(), command.encoded_len())
        }
        "robot" => {
            let reply = serde_json::from_value::<Reply<RobotPose>>(message).unwrap().in_dialect(dialect);
            bytes(|to| reply.encode(to).unwrap(), reply.encoded_len())
        }
        "platform" => {
            let reply = serde_json::from_value::<Reply<PlatformPose>>(message).unwrap().in_dialect(dialect);
            bytes(|to| reply.encode(to).unwrap(), reply.encoded_len())
        }
        other => panic!("{other} is no side of this link"),
    }
}

fn expected(vector: &Vector) -> Value {
    match vector.result {
        Outcome::Valid | Outcome::Acceptable => json!({ "message": vector.message }),
        Outcome::Invalid => json!({ "error": vector.error }),
    }
}

/// Every object of a stream that comes in these pieces, with the place where its line ends.
fn decode<'a>(from: &str, pieces: impl IntoIterator<Item = &'a [u8]>, dialect: Dialect) -> Vec<(Value, u64)> {
    let mut decoder = Decoder::new(dialect);
    let mut objects = Vec::new();
    let mut drain = |decoder: &mut Decoder| {
        while let Some(line) = decoder.next_frame() {
            let object = object(from, line, &dialect);
            objects.push((object, decoder.position()));
        }
    };
    for mut rest in pieces {
        while !rest.is_empty() {
            let taken = decoder.push(rest);
            rest = &rest[taken..];
            drain(&mut decoder);
        }
    }
    decoder.finish();
    drain(&mut decoder);
    objects
}

fn side(vector: &Vector) -> &str {
    vector.from.as_deref().unwrap()
}

#[test]
fn every_vector_decodes_to_its_object_however_it_is_cut() {
    let vectors = vectors("mmacell-proto");
    assert!(vectors.len() >= 84, "{}", vectors.len());
    for vector in &vectors {
        for pieces in chunkings(&vector.hex) {
            let objects = decode(side(vector), pieces.iter().copied(), dialect(vector));
            assert_eq!(objects.len(), 1, "vector {}: {objects:?}", vector.id);
            assert!(includes(&objects[0].0, &expected(vector)), "vector {}: {}", vector.id, objects[0].0);
            assert_eq!(objects[0].1, vector.hex.len() as u64, "vector {}", vector.id);
        }
    }
}

#[test]
fn an_object_is_encoded_to_the_bytes_of_its_valid_vector() {
    for vector in &vectors("mmacell-proto") {
        let Some(message) = &vector.message else { continue };
        let bytes = encode(side(vector), message, dialect(vector));
        match vector.result {
            Outcome::Valid => assert_eq!(bytes, vector.hex, "vector {}", vector.id),
            _ => assert_ne!(bytes, vector.hex, "vector {}", vector.id),
        }
    }
}

/// The printed forms of decimals: 5.999, not 5.9990000000000006.
#[test]
fn the_printed_object_is_the_committed_one_to_the_letter() {
    let status = b"OKF+010.000-002.000+005.999-01.2322T+00080+00000";
    let reply = Reply::<RobotPose>::decode(Line::new(status), &Dialect::STRICT).unwrap();
    assert_eq!(
        serde_json::to_string(&reply).unwrap(),
        r#"{"reply":"status","moving":false,"axes":[10.0,-2.0,5.999,-1.2322],"servo":true,"override":80,"error":0}"#
    );
    let command = b"MOVA+010.000-002.000+005.999-01.2322";
    let command = Command::<RobotPose>::decode(Line::new(command), &Dialect::STRICT).unwrap();
    assert_eq!(
        serde_json::to_string(&command).unwrap(),
        r#"{"command":"MOV","mode":"absolute","axes":[10.0,-2.0,5.999,-1.2322]}"#
    );
}

#[test]
fn a_neighbour_on_either_side_changes_nothing() {
    for vector in &vectors("mmacell-proto") {
        let from = side(vector);
        let good: &[u8] = if from == "central" { b"STP\r\n" } else { b"OK\r\n" };
        let good_object = decode(from, [good], Dialect::STRICT)[0].0.clone();
        if vector.error.as_ref().is_some_and(|error| error["kind"] == "incomplete") {
            continue; // with a neighbour after it, it is no longer incomplete
        }
        let ends = vector.hex.ends_with(b"\n");
        let stream = [good, &vector.hex, good, good].concat();
        for pieces in chunkings(&stream) {
            let objects: Vec<_> =
                decode(from, pieces, dialect(vector)).into_iter().map(|(object, _)| object).collect();
            // A line that has no end of its own takes the next one with it, and no more.
            assert_eq!(objects.len(), if ends { 4 } else { 3 }, "vector {}: {objects:?}", vector.id);
            assert_eq!(objects[0], good_object, "vector {}", vector.id);
            assert!(includes(&objects[1], &expected(vector)), "vector {}: {}", vector.id, objects[1]);
            assert!(objects[2..].iter().all(|object| *object == good_object), "vector {}", vector.id);
        }
    }
}

/// There is no mark at the beginning of a line: a line that is cut takes the next line with it, and gives one error.
#[test]
fn after_a_cut_line_one_line_is_lost_and_the_next_is_found() {
    let strict = |v: &Vector| v.result == Outcome::Valid && v.options.is_empty();
    let valid: Vec<_> = vectors("mmacell-proto").into_iter().filter(strict).collect();
    for (cut, good) in valid.iter().flat_map(|d| valid.iter().map(move |g| (d, g))) {
        if side(cut) != side(good) {
            continue;
        }
        let twice = [&good.hex[..], &good.hex].concat();
        for stream in after_a_cut(&cut.hex, &twice) {
            let objects = decode(side(good), stream.chunks(1), Dialect::STRICT);
            assert_eq!(objects.len(), 2, "{} before {}: {objects:?}", cut.id, good.id);
            assert!(objects[0].0.get("error").is_some(), "{} before {}: {objects:?}", cut.id, good.id);
            assert_eq!(objects[1].0, expected(good));
        }
    }
}
