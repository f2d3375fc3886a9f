//! Properties of every packet, every division of a stream and every corruption.
#![allow(clippy::cast_possible_truncation)]

use core::time::Duration;

use proptest::prelude::*;
use val2_viewer::robot_session::{Decoder as _, Encode as _, Session as _};
use val2_viewer::{
    DecodeError, Decoder, Host, HostConfig, PosePacket, Workstation, WorkstationConfig, WorkstationEvent,
    XOFF, XON,
};

use crate::arbitrary::arbitrary;

type Item = (Result<PosePacket, DecodeError>, u64);

fn packets() -> impl Strategy<Value = PosePacket> {
    arbitrary(prop::collection::vec(any::<u8>(), 26))
}

fn line(packet: &PosePacket) -> Vec<u8> {
    let mut out = vec![0; packet.encoded_len()];
    assert_eq!(packet.encode(&mut out), Ok(out.len()));
    out
}

fn stream_bytes() -> impl Strategy<Value = Vec<u8>> {
    let piece = prop_oneof![
        packets().prop_map(|packet| line(&packet)),
        prop::collection::vec(any::<u8>(), 0..150),
        prop::collection::vec(prop_oneof![Just(b'$'), Just(b'\n'), Just(b'\r'), Just(b'0')], 0..20),
        (packets(), 0..60usize).prop_map(|(packet, cut)| line(&packet)[..cut.min(36)].to_vec()),
    ];
    prop::collection::vec(piece, 0..6).prop_map(|pieces| pieces.concat())
}

fn decode<'a>(chunks: impl IntoIterator<Item = &'a [u8]>) -> Vec<Item> {
    fn drain(decoder: &mut Decoder, items: &mut Vec<Item>) {
        while let Some(item) = decoder.next_frame() {
            items.push((item, decoder.position()));
        }
    }
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
        let bytes = line(&packet);
        let stream = [&bytes[..], &tail].concat();
        prop_assert_eq!(PosePacket::decode(&stream), Ok(Some((packet, bytes.len()))));
        prop_assert_eq!(decode([&stream[..]])[0], (Ok(packet), bytes.len() as u64));
        for cut in 0..bytes.len() {
            prop_assert_eq!(PosePacket::decode(&bytes[..cut]), Ok(None));
        }
        prop_assert!(!bytes.iter().any(|byte| [0x11, 0x13].contains(byte)), "XON, XOFF");
        prop_assert_eq!(bytes.iter().filter(|byte| **byte == b'$').count(), 1);
    }

    #[cfg(feature = "serde")]
    #[test]
    fn a_packet_survives_its_object(packet in packets()) {
        let json = serde_json::to_value(packet).unwrap();
        prop_assert_eq!(serde_json::from_value::<PosePacket>(json).unwrap(), packet);
    }

    #[test]
    fn items_tile_the_stream_however_it_is_cut(stream in stream_bytes(), size in 1..120usize) {
        let items = decode([&stream[..]]);
        prop_assert_eq!(&decode(stream.chunks(size)), &items);
        let mut start = 0;
        for (item, end) in &items {
            let bytes = &stream[start..*end as usize];
            prop_assert!(!bytes.is_empty());
            if let Ok(packet) = item {
                prop_assert_eq!(bytes, line(packet));
            }
            start = *end as usize;
        }
        prop_assert_eq!(start, stream.len());
    }

    #[test]
    fn the_handshake_changes_no_item_wherever_it_is(
        stream in stream_bytes(),
        places in prop::collection::vec((any::<prop::sample::Index>(), any::<bool>()), 0..8),
        size in 1..8usize,
    ) {
        let text: Vec<u8> = stream.into_iter().filter(|byte| ![XON, XOFF].contains(byte)).collect();
        let mut mixed = text.clone();
        for (at, holds) in places {
            mixed.insert(at.index(mixed.len() + 1), if holds { XOFF } else { XON });
        }
        let events = |stream: &[u8]| {
            let mut workstation = Workstation::new(WorkstationConfig::default()).unwrap();
            workstation.handle_connected(Duration::ZERO);
            let mut events = Vec::new();
            for bytes in stream.chunks(size) {
                workstation.handle_input(Duration::ZERO, bytes);
                events.extend(core::iter::from_fn(|| workstation.poll_event()));
            }
            events
        };
        prop_assert_eq!(events(&mixed), events(&text));
    }

    #[test]
    fn a_packet_after_anything_is_read(stream in stream_bytes(), packet in packets()) {
        let items = decode([&stream[..], &line(&packet)]);
        prop_assert_eq!(items.last().unwrap().0, Ok(packet));
    }

    #[test]
    fn no_flipped_bit_passes(packet in packets(), at: prop::sample::Index, bit in 0..8u32) {
        let mut bytes = line(&packet);
        let at = at.index(bytes.len());
        bytes[at] ^= 1 << bit;
        prop_assert!(decode([&bytes[..]]).iter().all(|(item, _)| item.is_err()));
    }

    /// A request has one outcome, and the next packet is read, for any bytes on the line.
    #[test]
    fn a_request_has_one_outcome(noise in stream_bytes(), size in 1..120usize, pose: [i16; 12]) {
        let (mut host, mut workstation) =
            (Host::new(HostConfig::default()).unwrap(), Workstation::new(WorkstationConfig::default()).unwrap());
        let (mut now, mut out) = (Duration::ZERO, [0; 256]);
        host.handle_connected(now);
        workstation.handle_connected(now);
        for round in 0..6 {
            now += Duration::from_millis(200);
            workstation.draw(now);
            let asked = workstation.poll_transmit(now, &mut out).is_some();
            prop_assert!(asked, "the last request has ended");
            host.handle_input(now, &out[..1]);
            host.set_pose(now, pose);
            let length = host.poll_transmit(now, &mut out).unwrap();
            if round % 2 == 0 {
                // A part of it is corrupt.
                noise.chunks(size).for_each(|bytes| workstation.handle_input(now, bytes));
            }
            workstation.handle_input(now, &out[..length]);
            // An XOFF out of it holds the next request.
            workstation.handle_input(now, &[XON]);
            let events: Vec<_> = core::iter::from_fn(|| workstation.poll_event()).collect();
            let is_outcome = |event: &&WorkstationEvent| {
                matches!(event, WorkstationEvent::Pose(_) | WorkstationEvent::Missed)
            };
            prop_assert_eq!(events.iter().filter(is_outcome).count(), 1, "{:?}", &events);
            let is_read = |event: &WorkstationEvent| {
                matches!(event, WorkstationEvent::Pose(packet) | WorkstationEvent::Unasked(packet)
                    if packet.pose == pose && packet.count == round)
            };
            prop_assert!(events.iter().any(is_read), "{:?}", &events);
        }
    }
}
