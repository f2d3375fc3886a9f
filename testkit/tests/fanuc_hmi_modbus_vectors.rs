//! Every vector of `reference/vectors/fanuc-hmi-modbus.json`, cut and glued in every way.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

use core::time::Duration;

use fanuc_hmi_modbus::{DecodeError, Decoder, Frame, Framing, PduBuf, Side};
use robot_session::{Decoder as _, Encode as _};
use serde_json::{Value, json};
use testkit::chunking::{after_a_cut, chunkings};
use testkit::vectors::{Outcome, Vector, includes, vectors};

const LINK: &str = "fanuc-hmi-modbus";

fn framing(vector: &Vector) -> Framing {
    match vector.options.get("framing").and_then(Value::as_str) {
        None | Some("tcp") => Framing::Tcp,
        Some("rtu") => Framing::Rtu { silence: Duration::from_millis(4) },
        other => panic!("{other:?}"),
    }
}

fn side(vector: &Vector) -> Side {
    match vector.from.as_deref() {
        Some("client") => Side::Client,
        Some("server") => Side::Server,
        other => panic!("{other:?}"),
    }
}

fn object(item: Result<Frame<&[u8]>, DecodeError>, side: Side) -> Value {
    let message = item.and_then(|frame| match side {
        Side::Client => frame.request().map(|request| json!({ "message": request })),
        Side::Server => frame.reply().map(|reply| json!({ "message": reply })),
    });
    message.unwrap_or_else(|error| json!({ "error": error }))
}

/// Every item that the decoder gives for a stream, with the offset after it.
fn decode<'a>(framing: Framing, side: Side, chunks: impl IntoIterator<Item = &'a [u8]>) -> Vec<(Value, u64)> {
    let drain = |decoder: &mut Decoder, items: &mut Vec<(Value, u64)>| {
        while let Some(item) = decoder.next_frame() {
            let item = object(item, side);
            items.push((item, decoder.position()));
        }
    };
    let (mut decoder, mut items) = (Decoder::new(framing, side), Vec::new());
    for mut chunk in chunks {
        while !chunk.is_empty() {
            let taken = decoder.push(chunk);
            chunk = &chunk[taken..];
            drain(&mut decoder, &mut items);
        }
    }
    decoder.finish();
    drain(&mut decoder, &mut items);
    items
}

fn expected(vector: &Vector) -> Value {
    match vector.result {
        Outcome::Valid | Outcome::Acceptable => json!({ "message": vector.message }),
        Outcome::Invalid => json!({ "error": vector.error }),
    }
}

/// A good frame of the same side and framing.
fn good(vector: &Vector) -> Vec<u8> {
    let message = match side(vector) {
        Side::Client => json!({"unit": 1, "function": 3, "address": 0, "quantity": 37}),
        Side::Server => json!({"unit": 1, "function": 3, "registers": [1, 2, 3]}),
    };
    let mut frame: Frame<PduBuf> = serde_json::from_value(message).unwrap();
    frame.transaction = (framing(vector) == Framing::Tcp).then_some(7);
    let mut out = [0; Frame::MAX_LEN];
    let len = frame.encode(&mut out).unwrap();
    out[..len].to_vec()
}

/// Whether only the silence after the frame shows where it ends.
fn ends_with_silence(vector: &Vector) -> bool {
    framing(vector) != Framing::Tcp && vector.flags.iter().any(|flag| flag == "other")
}

#[test]
fn every_vector_decodes_to_its_object_however_it_is_cut() {
    let vectors = vectors(LINK);
    assert!(vectors.len() >= 135, "{}", vectors.len());
    for vector in &vectors {
        for chunks in chunkings(&vector.hex) {
            let items = decode(framing(vector), side(vector), chunks.iter().copied());
            assert_eq!(items.len(), 1, "vector {}, {chunks:x?}: {items:?}", vector.id);
            assert!(includes(&items[0].0, &expected(vector)), "vector {}: {items:?}", vector.id);
            assert_eq!(items[0].1, vector.hex.len() as u64, "vector {}", vector.id);
        }
    }
}

#[test]
fn a_valid_object_encodes_to_its_bytes() {
    for vector in vectors(LINK) {
        let Some(message) = vector.message else { continue };
        let frame: Result<Frame<PduBuf>, _> = serde_json::from_value(message);
        if vector.result == Outcome::Acceptable && vector.flags == ["limit"] {
            let error = frame.unwrap_err().to_string();
            assert_eq!(error, "2 from address 65535 reach beyond 65535");
            continue;
        }
        let frame = frame.unwrap();
        let mut out = [0xAA; Frame::MAX_LEN];
        let len = frame.encode(&mut out).unwrap();
        assert_eq!(len, frame.encoded_len());
        assert_eq!(out[..len] == vector.hex, vector.result == Outcome::Valid, "vector {}", vector.id);
        assert!(out[len..].iter().all(|byte| *byte == 0xAA), "vector {}", vector.id);
    }
}

#[test]
fn a_neighbour_on_either_side_changes_nothing() {
    // With a neighbour behind it, what is incomplete is no longer so.
    for vector in vectors(LINK).iter().filter(|vector| !ends_with_silence(vector) && !vector.end) {
        let good = good(vector);
        let stream = [&good[..], &vector.hex, &good].concat();
        let (framing, side) = (framing(vector), side(vector));
        let message = decode(framing, side, [&good[..]])[0].0.clone();
        let whole = decode(framing, side, [&stream[..]]);
        for chunks in chunkings(&stream).step_by(7) {
            assert_eq!(decode(framing, side, chunks.iter().copied()), whole, "vector {}", vector.id);
        }
        assert_eq!(whole.len(), 3, "vector {}: {whole:?}", vector.id);
        assert_eq!(whole[0], (message.clone(), good.len() as u64));
        assert_eq!(whole[2], (message, stream.len() as u64), "vector {}", vector.id);
        assert!(includes(&whole[1].0, &expected(vector)), "vector {}: {whole:?}", vector.id);
        assert_eq!(whole[1].1, (stream.len() - good.len()) as u64, "vector {}", vector.id);
    }
}

/// On a serial line; TCP loses no bytes, and a frame cut there ends with its connection.
#[test]
fn a_valid_frame_after_a_cut_one_is_found_and_costs_one_error() {
    let vectors = vectors(LINK);
    let rtu = |v: &&Vector| v.result == Outcome::Valid && framing(v) != Framing::Tcp;
    let mut streams = 0;
    for vector in vectors.iter().filter(rtu).filter(|vector| vector.hex.len() < 100) {
        let good = good(vector);
        for (stream, cut) in after_a_cut(&vector.hex, &good).zip(1u64..) {
            let items = decode(framing(vector), side(vector), [&stream[..]]);
            assert_eq!(items, decode(framing(vector), side(vector), stream.chunks(1)));
            let message = decode(framing(vector), side(vector), [&good[..]])[0].0.clone();
            assert_eq!(items.len(), 2, "vector {}, {stream:x?}: {items:?}", vector.id);
            assert_eq!(items[0].1, cut, "vector {}, {stream:x?}", vector.id);
            assert_eq!(items[1], (message, stream.len() as u64), "vector {}, {stream:x?}", vector.id);
            streams += 1;
        }
    }
    assert!(streams > 250, "{streams}");
}

#[test]
fn a_connection_that_ends_within_a_frame_says_so_and_a_reset_forgets_it() {
    for vector in vectors(LINK) {
        if vector.result != Outcome::Valid || framing(&vector) != Framing::Tcp {
            continue;
        }
        for cut in 1..vector.hex.len() {
            let items = decode(Framing::Tcp, side(&vector), [&vector.hex[..cut]]);
            let expected = if cut < 6 { 7 } else { vector.hex.len() };
            let error = json!({"error": {"kind": "cut", "expected": expected, "found": cut}});
            assert_eq!(items, [(error, cut as u64)], "vector {}", vector.id);

            let mut decoder = Decoder::new(Framing::Tcp, side(&vector));
            push(&mut decoder, &vector.hex[..cut]);
            assert_eq!(decoder.next_frame(), None);
            decoder.clear();
            push(&mut decoder, &vector.hex);
            let item = decoder.next_frame().unwrap();
            assert!(includes(&object(item, side(&vector)), &expected_object(&vector)), "{}", vector.id);
        }
    }
}

/// All of these bytes.
fn push(decoder: &mut Decoder, bytes: &[u8]) {
    assert_eq!(decoder.push(bytes), bytes.len());
}

fn expected_object(vector: &Vector) -> Value {
    json!({ "message": vector.message })
}

#[test]
fn corruption_is_known_at_once() {
    let mut decoder = Decoder::new(Framing::Tcp, Side::Server);
    push(&mut decoder, &[0, 1, 0, 0, 0xFF, 0xFF]);
    assert_eq!(decoder.next_frame(), None);
    assert_eq!(decoder.corruption(), Some(DecodeError::MbapLength { found: 0xFFFF }));
}

#[test]
fn two_silences_may_come_before_the_frames_are_drained() {
    let mut frame = vec![1, 65, 7];
    frame.extend(fanuc_hmi_modbus::crc::crc16(&frame).to_le_bytes());
    let mut decoder = Decoder::new(Framing::RTU_OVER_TCP, Side::Client);
    push(&mut decoder, &[0x55]);
    decoder.finish();
    push(&mut decoder, &frame);
    assert_eq!(decoder.pending(), 6);
    decoder.finish();
    let cut = DecodeError::Cut { expected: 4, found: 1 };
    assert_eq!(decoder.next_frame(), Some(Err(cut)));
    assert_eq!(decoder.next_frame().unwrap().unwrap().pdu, [65, 7]);
    assert_eq!(decoder.next_frame(), None);
    assert_eq!(decoder.pending(), 0);
}

#[test]
fn an_endless_stream_of_noise_is_tiled_by_errors() {
    for (framing, byte) in [(Framing::Tcp, 0xFF), (Framing::RTU_OVER_TCP, 0x10)] {
        let noise = vec![byte; 5000];
        let items = decode(framing, Side::Client, [&noise[..]]);
        assert_eq!(items, decode(framing, Side::Client, noise.chunks(1)));
        assert!(items.iter().all(|(item, _)| item.get("error").is_some()));
        assert!(items.len() < 30, "{items:?}");
        assert_eq!(items.last().unwrap().1, 5000);
    }
}
