//! Every vector of `reference/vectors/isra-ball.json`, cut and glued in every way.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

use isra_ball::robot_session::{Decoder as _, Encode as _};
use isra_ball::{Decoder, EncodeError, Frame, Packet};
use serde_json::{Value, json};
use testkit::chunking::{after_a_cut, chunkings};
use testkit::vectors::{Outcome, Vector, includes, vectors};

const GOOD: [u8; 12] = [0x08, 0xF8, 0x5D, 0x00, 0x01, 0xFE, 0x03, 0xFC, 0x05, 0xFA, 0x81, 0x7A];

/// Every item that the decoder gives for a stream, with the offset after it.
fn decode<'a>(chunks: impl IntoIterator<Item = &'a [u8]>) -> Vec<(Value, u64)> {
    fn drain(decoder: &mut Decoder, items: &mut Vec<(Value, u64)>) {
        while let Some(item) = decoder.next_frame() {
            let item = match item {
                Ok(frame) => json!({ "message": frame }),
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
    let vectors = vectors("isra-ball");
    assert!(vectors.len() >= 22, "{}", vectors.len());
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
    for vector in vectors("isra-ball").iter().filter(|v| v.result == Outcome::Valid) {
        let packet: Packet = serde_json::from_value(vector.message.clone().unwrap()).unwrap();
        let mut out = [0xAA; 64];
        let written = packet.encode(&mut out).unwrap();
        assert_eq!(&out[..written], vector.hex, "vector {}", vector.id);
        assert_eq!(written, packet.encoded_len());
        let frame = Frame::new(&vector.hex[3..11]).unwrap();
        assert_eq!((frame.encode(&mut out), frame.encoded_len()), (Ok(12), 12));
        assert_eq!(&out[..12], vector.hex, "vector {}", vector.id);
    }
}

#[test]
fn a_packet_of_another_length_is_read_and_not_written() {
    for vector in vectors("isra-ball").iter().filter(|v| v.flags.iter().any(|f| f == "layout")) {
        let (frame, used) = Frame::decode(&vector.hex).unwrap().unwrap();
        assert_eq!((frame.encoded_len(), used), (vector.hex.len(), vector.hex.len()));
        let error = EncodeError::Layout { expected: 8, found: frame.data().len() };
        assert_eq!(frame.encode(&mut [0; 300]), Err(error));
    }
}

#[test]
fn a_neighbour_on_either_side_changes_nothing() {
    for vector in vectors("isra-ball") {
        let stream = [&GOOD[..], &vector.hex, &GOOD].concat();
        for chunks in chunkings(&stream) {
            let items = decode(chunks.iter().copied());
            let good = decode([&GOOD[..]])[0].0.clone();
            assert_eq!(items[0], (good.clone(), 12), "vector {}", vector.id);
            assert_eq!(items.last().unwrap(), &(good, stream.len() as u64), "vector {}", vector.id);
            assert_eq!(items.len(), 3, "vector {}: {items:?}", vector.id);
            if vector.result != Outcome::Invalid {
                assert!(includes(&items[1].0, &expected(&vector)), "vector {}: {items:?}", vector.id);
            }
        }
    }
}

#[test]
fn a_good_packet_after_a_cut_one_is_found_and_costs_one_error() {
    // The packets of the source's layout that the file begins with: every pair, cut at every byte.
    let valid = vectors("isra-ball").into_iter().filter(|v| v.result == Outcome::Valid);
    let good: Vec<_> = valid.map(|v| v.hex).take(10).collect();
    let mut unseen = 0;
    for (corrupt, bytes) in good.iter().flat_map(|c| good.iter().map(move |b| (c, b))) {
        for (stream, cut) in after_a_cut(corrupt, bytes).zip(1usize..) {
            let items = decode(stream.chunks(1));
            assert_eq!(items, decode([&stream[..]]));
            if Frame::decode(&stream).is_ok_and(|frame| frame.is_some()) {
                // n and −n of the good packet add up to 0: after a packet whose checksum is 0, cut before its keys, they
                // pass as its keys and checksum. A one-byte sum cannot see it.
                unseen += 1;
                assert_eq!((cut, corrupt[11]), (10, 0));
                continue;
            }
            assert_eq!(items.last().unwrap().0, decode([&bytes[..]])[0].0, "{stream:x?}");
            assert_eq!(items.last().unwrap().1, stream.len() as u64);
            // Each header inside the corrupt packet's own data is one more place to begin.
            let inner = corrupt[1..cut].windows(3).filter(|h| *h == &GOOD[..3]).count();
            assert_eq!(items.len(), 2 + inner, "{stream:x?}: {items:?}");
            assert_eq!(items[inner].1, cut as u64);
        }
    }
    assert_eq!(unseen, good.len());
}
