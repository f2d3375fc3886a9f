//! Properties of every packet, every division of a stream and every corruption.

use isra_ball::robot_session::{Decoder as _, Encode as _, Session as _};
use isra_ball::{DecodeError, Decoder, Frame, Host, HostConfig, Packet, Status, timing};
use proptest::prelude::*;

use crate::arbitrary::arbitrary;

type Item = Result<Vec<u8>, DecodeError>;

fn packets() -> impl Strategy<Value = Packet> {
    // Header bytes turn up in the data more often than by chance.
    let byte = prop_oneof![any::<u8>(), Just(8), Just(0xF8), Just(0x5D)];
    arbitrary(prop::collection::vec(byte, 16))
}

fn stream_bytes() -> impl Strategy<Value = Vec<u8>> {
    let piece = prop_oneof![
        packets().prop_map(|p| p.to_bytes().unwrap().to_vec()),
        prop::collection::vec(any::<u8>(), 0..300),
        prop::collection::vec(prop_oneof![Just(0u8), Just(0x55), Just(8), Just(0xF8), Just(0x5D)], 0..20),
        any::<u8>().prop_map(|n| vec![n, n.wrapping_neg(), n ^ 0x55]),
    ];
    prop::collection::vec(piece, 0..6).prop_map(|pieces| pieces.concat())
}

fn drain(decoder: &mut Decoder, items: &mut Vec<(Item, u64)>) {
    while let Some(item) = decoder.next_frame() {
        let item = item.map(|frame| frame.data().to_vec());
        items.push((item, decoder.position()));
    }
}

fn decode<'a>(chunks: impl IntoIterator<Item = &'a [u8]>) -> Vec<(Item, u64)> {
    let (mut decoder, mut items) = (Decoder::new(), Vec::new());
    for mut chunk in chunks {
        while !chunk.is_empty() {
            let taken = decoder.push(chunk);
            assert!(taken > 0, "a drained decoder has room");
            chunk = &chunk[taken..];
            drain(&mut decoder, &mut items);
        }
    }
    decoder.finish();
    drain(&mut decoder, &mut items);
    items
}

proptest! {
    #[test]
    fn a_packet_reads_back(packet in packets(), tail in prop::collection::vec(any::<u8>(), 0..20)) {
        let bytes = packet.to_bytes().unwrap();
        let stream = [&bytes[..], &tail].concat();
        let (frame, used) = Frame::decode(&stream).unwrap().unwrap();
        prop_assert_eq!((frame.packet(), used), (Ok(packet), packet.encoded_len()));
        for cut in 0..bytes.len() {
            prop_assert_eq!(Frame::decode(&bytes[..cut]), Ok(None));
        }
        let mut appended = Vec::new();
        prop_assert_eq!(packet.append_to(&mut appended), Ok(()));
        prop_assert_eq!(&appended, &bytes);
    }

    #[cfg(feature = "serde")]
    #[test]
    fn a_packet_survives_its_object(packet in packets()) {
        let json = serde_json::to_value(packet).unwrap();
        let back: Packet = serde_json::from_value(json).unwrap();
        let status = if packet.status == Status::Reserved11 { Status::Reserved } else { packet.status };
        prop_assert_eq!(back, Packet { status, ..packet });
    }

    #[test]
    fn how_a_stream_is_cut_changes_nothing(stream in stream_bytes(), sizes in prop::collection::vec(1..600usize, 1..20)) {
        let mut chunks = Vec::new();
        let mut rest = &stream[..];
        for size in sizes.iter().cycle() {
            let (chunk, tail) = rest.split_at((*size).min(rest.len()));
            chunks.push(chunk);
            rest = tail;
            if rest.is_empty() { break }
        }
        let whole = decode([&stream[..]]);
        prop_assert_eq!(&decode(chunks), &whole);
        prop_assert_eq!(&decode(stream.chunks(1)), &whole);
    }

    #[test]
    fn items_tile_the_stream_and_say_what_is_there(stream in stream_bytes()) {
        let mut at = 0;
        for (item, end) in decode([&stream[..]]) {
            let bytes = &stream[at..usize::try_from(end).unwrap()];
            prop_assert!(!bytes.is_empty());
            match item {
                Ok(data) => {
                    prop_assert_eq!(Frame::decode(bytes), Ok(Some((Frame::new(&data).unwrap(), bytes.len()))));
                }
                Err(DecodeError::Noise { length }) => {
                    prop_assert_eq!(length, bytes.len());
                    let starts = Frame::decode(&stream[at..]);
                    prop_assert!(matches!(starts, Err(DecodeError::Header { .. })), "{:?}", starts);
                }
                Err(DecodeError::Incomplete { expected, found }) => {
                    prop_assert_eq!(found, bytes.len());
                    prop_assert!(expected > stream.len() - at);
                }
                Err(error) => prop_assert_eq!(Frame::decode(&stream[at..]), Err(error)),
            }
            at += bytes.len();
        }
        prop_assert_eq!(at, stream.len());
    }

    #[test]
    fn one_corrupt_byte_costs_one_packet(
        packets in prop::collection::vec(packets(), 3..6), at in any::<prop::sample::Index>(), kind in 0..3u8, byte in 1..=255u8,
    ) {
        let mut stream: Vec<u8> = packets.iter().flat_map(|p| p.to_bytes().unwrap()).collect();
        let at = at.index(stream.len());
        match kind {
            0 => stream[at] ^= byte,
            1 => drop(stream.remove(at)),
            _ => stream.insert(at, byte),
        }
        let frames: Vec<_> = decode([&stream[..]])
            .into_iter()
            .filter_map(|(item, end)| item.ok().map(|data| (usize::try_from(end).unwrap() - data.len() - 4, data)))
            .collect();
        for (i, packet) in packets.iter().enumerate() {
            // A byte put between two packets touches neither.
            if at / 12 == i && (kind < 2 || at % 12 != 0) {
                continue;
            }
            let start = match kind {
                1 if i * 12 > at => i * 12 - 1,
                2 if i * 12 >= at => i * 12 + 1,
                _ => i * 12,
            };
            let data = &packet.to_bytes().unwrap()[3..11];
            let found = frames.iter().any(|(at, d)| *at == start && d == data);
            // One corrupt packet in 256 passes the one-byte sum, and may end in the next one.
            let eaten = frames.iter().any(|(at, d)| *at < start && at + d.len() + 4 > start);
            prop_assert!(found || eaten, "packet {} of {:x?} is lost", i, stream);
        }
    }

    #[test]
    fn a_host_survives_any_line_and_never_polls_faster_than_the_line_allows(
        steps in prop::collection::vec((0..40_000u64, stream_bytes()), 1..30),
    ) {
        let mut host = Host::new(HostConfig::default()).unwrap();
        let (mut micros, mut last, mut out) = (0, None, [0; 16]);
        host.handle_connected(core::time::Duration::ZERO);
        for (pause, bytes) in steps {
            micros += pause;
            let now = core::time::Duration::from_micros(micros);
            host.handle_input(now, &bytes);
            if host.poll_transmit(now, &mut out).is_some() {
                prop_assert!(last.is_none_or(|last| now - last >= timing::min_period(9600)), "{:?} {:?}", last, now);
                last = Some(now);
            }
            prop_assert_eq!(host.poll_transmit(now, &mut out), None);
            let events = core::iter::from_fn(|| host.poll_event()).count();
            prop_assert!(events <= 8);
            prop_assert!(host.poll_timeout().unwrap() > now);
            prop_assert!(host.live_until().is_none_or(|until| until > now));
        }
    }
}
