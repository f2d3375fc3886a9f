//! Every vector of `reference/vectors/val2-viewer.json`, cut and glued in every way.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

use serde_json::{Value, json};
use testkit::chunking::{after_a_cut, chunkings};
use testkit::vectors::{Outcome, Vector, includes, vectors};
use val2_viewer::robot_session::{Decoder as _, Encode as _};
use val2_viewer::{Decoder, PosePacket};

const GOOD: &[u8] = b"$POSE,7,16384,0,0,0,-16384,0,0,0,-16384,12800,-4816,16*30\r\n";

/// Every item that the decoder gives for a stream, with the offset after it.
fn decode<'a>(chunks: impl IntoIterator<Item = &'a [u8]>) -> Vec<(Value, u64)> {
    fn drain(decoder: &mut Decoder, items: &mut Vec<(Value, u64)>) {
        while let Some(item) = decoder.next_frame() {
            let item = match item {
                Ok(packet) => json!({ "message": packet }),
                Err(error) => json!({ "error": error }),
            };
            items.push((item, decoder.position()));
        }
    }
    let (mut decoder, mut items) = (Decoder::new(), Vec::new());
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

#[test]
fn every_vector_decodes_to_its_object_however_it_is_cut() {
    let vectors = vectors("val2-viewer");
    assert!(vectors.len() >= 23, "{}", vectors.len());
    for vector in &vectors {
        for chunks in chunkings(&vector.hex) {
            let items = decode(chunks.iter().copied());
            assert_eq!(items.len(), 1, "vector {}, {chunks:x?}: {items:?}", vector.id);
            assert!(includes(&items[0].0, &expected(vector)), "vector {}, {chunks:x?}: {items:?}", vector.id);
            assert_eq!(items[0].1, vector.hex.len() as u64, "vector {}", vector.id);
        }
    }
}

#[test]
fn a_valid_object_encodes_to_its_bytes() {
    for vector in vectors("val2-viewer").iter().filter(|v| v.result == Outcome::Valid) {
        let packet: PosePacket = serde_json::from_value(vector.message.clone().unwrap()).unwrap();
        let mut out = [0xAA; PosePacket::MAX_LEN];
        let written = packet.encode(&mut out).unwrap();
        assert_eq!(&out[..written], vector.hex, "vector {}", vector.id);
        assert_eq!(written, packet.encoded_len());
    }
}

#[test]
fn a_neighbour_on_either_side_changes_nothing() {
    let good = decode([GOOD])[0].0.clone();
    for vector in vectors("val2-viewer") {
        let stream = [GOOD, &vector.hex, GOOD].concat();
        for chunks in chunkings(&stream) {
            let items = decode(chunks.iter().copied());
            assert_eq!(items[0], (good.clone(), GOOD.len() as u64), "vector {}", vector.id);
            assert_eq!(items.last().unwrap(), &(good.clone(), stream.len() as u64), "vector {}", vector.id);
            assert_eq!(items.len(), 3, "vector {}: {items:?}", vector.id);
            assert!(includes(&items[1].0, &expected(&vector)), "vector {}: {items:?}", vector.id);
        }
    }
}

#[test]
fn a_good_packet_after_a_cut_one_is_found_and_costs_one_error() {
    let good: Vec<_> =
        vectors("val2-viewer").into_iter().filter(|v| v.result == Outcome::Valid).map(|v| v.hex).collect();
    for (corrupt, bytes) in good.iter().flat_map(|c| good.iter().map(move |b| (c, b))) {
        for (stream, cut) in after_a_cut(corrupt, bytes).zip(1u64..) {
            let items = decode([&stream[..]]);
            assert_eq!(items.len(), 2, "{stream:x?}: {items:?}");
            assert_eq!(items[0].1, cut);
            assert_eq!(items[1], (decode([&bytes[..]])[0].0.clone(), stream.len() as u64));
        }
    }
}
