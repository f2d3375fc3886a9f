//! Properties of every payload, profile, division and corruption.

use core::time::Duration;

use crate::arbitrary::arbitrary;
use crate::common::echo;
use laser_eb90::robot_session::{Decoder as _, Encode as _, Session as _};
use laser_eb90::{
    DecodeError, Decoder, EncodeError, Frame, Host, HostConfig, HostEvent, Instructions, Item, MAX_PAYLOAD,
    Payload, Profile, SessionError,
};
use proptest::prelude::*;

#[derive(Debug, Clone, PartialEq)]
enum Owned {
    F32(Vec<f32>),
    I16(Vec<i16>),
    U8(Vec<u8>),
    Char(Vec<u8>),
}

impl From<Item<'_>> for Owned {
    fn from(item: Item<'_>) -> Self {
        match item {
            Item::F32(v) => Owned::F32(v.iter().collect()),
            Item::I16(v) => Owned::I16(v.iter().collect()),
            Item::U8(v) => Owned::U8(v.to_vec()),
            Item::Char(v) => Owned::Char(v.to_vec()),
        }
    }
}

/// Returns bytes that are marks more often than not.
fn byte() -> impl Strategy<Value = u8> {
    prop_oneof![any::<u8>(), prop::sample::select(vec![0x90, 0x82, 0x83, 0xEB, 0xF0, 0xF1, 0xF2, 0xF3])]
}

fn item() -> impl Strategy<Value = Owned> {
    let float = any::<[u8; 4]>()
        .prop_map(f32::from_le_bytes)
        .prop_filter("no frame carries another", |v| v.is_finite());
    prop_oneof![
        prop::collection::vec(prop_oneof![float, Just(18.0)], 0..12).prop_map(Owned::F32),
        prop::collection::vec(prop_oneof![any::<i16>(), Just(0x90)], 0..12).prop_map(Owned::I16),
        prop::collection::vec(byte(), 0..40).prop_map(Owned::U8),
        prop::collection::vec(byte(), 0..40).prop_map(Owned::Char),
    ]
}

fn items() -> impl Strategy<Value = Vec<Owned>> {
    prop::collection::vec(item(), 1..8)
}

fn profile() -> impl Strategy<Value = Profile> {
    arbitrary(prop::collection::vec(any::<u8>(), 32))
}

fn encode(items: &[Owned], profile: &Profile) -> Vec<u8> {
    let mut buffer = [0; MAX_PAYLOAD];
    let mut payload = Payload::new(&mut buffer, profile);
    for item in items {
        match item {
            Owned::F32(v) => payload.f32(v),
            Owned::I16(v) => payload.i16(v),
            Owned::U8(v) => payload.u8(v),
            Owned::Char(v) => payload.char(v),
        }
        .unwrap();
    }
    let frame = payload.frame().unwrap();
    let mut out = vec![0; Frame::MAX_LEN];
    let len = frame.encode(&mut out).unwrap();
    assert_eq!(len, frame.encoded_len());
    assert!((Frame::MIN_LEN - 1..=Frame::MAX_LEN).contains(&len));
    let short = frame.encode(&mut out[..len - 1]);
    assert_eq!(short, Err(EncodeError::BufferTooSmall { needed: len, available: len - 1 }));
    out.truncate(len);
    out
}

/// Frames as items, errors as they are; checks that they cover the stream.
fn decode(stream: &[u8], cuts: &[usize], profile: &Profile) -> Vec<Result<Vec<Owned>, DecodeError>> {
    fn drain(decoder: &mut Decoder, found: &mut Vec<Result<Vec<Owned>, DecodeError>>) -> bool {
        let count = found.len();
        loop {
            let before = decoder.position();
            let Some(result) = decoder.next_frame() else { return found.len() > count };
            found.push(result.and_then(|frame| frame.items().map(|item| item.map(Owned::from)).collect()));
            assert!(decoder.position() > before, "a result that takes no bytes");
        }
    }
    let mut decoder = Decoder::new(profile);
    let mut found = Vec::new();
    let mut from = 0;
    let mut ends: Vec<usize> = cuts.iter().map(|cut| cut % (stream.len() + 1)).collect();
    ends.push(stream.len());
    ends.sort_unstable();
    for end in ends {
        while from < end {
            let taken = decoder.push(&stream[from..end]);
            from += taken;
            assert!(drain(&mut decoder, &mut found) || taken > 0, "the decoder makes no progress");
        }
    }
    decoder.finish();
    drain(&mut decoder, &mut found);
    assert_eq!(decoder.position(), stream.len() as u64);
    found
}

proptest! {
    #[test]
    fn what_is_encoded_decodes_to_itself(items in items(), profile in profile()) {
        let bytes = encode(&items, &profile);
        let mut payload = [0; MAX_PAYLOAD];
        let (frame, used) = Frame::decode(&bytes, &mut payload, &profile).unwrap().unwrap();
        prop_assert_eq!(used, bytes.len());
        let found: Vec<Owned> = frame.items().map(|item| Owned::from(item.unwrap())).collect();
        prop_assert_eq!(found, items);
        let mut again = vec![0; bytes.len()];
        frame.encode(&mut again).unwrap();
        prop_assert_eq!(again, bytes);
    }

    #[test]
    fn any_cutting_of_any_bytes_gives_the_same(
        stream in prop::collection::vec(byte(), 0..3000),
        cuts in prop::collection::vec(any::<usize>(), 0..20),
        profile in profile(),
    ) {
        prop_assert_eq!(decode(&stream, &cuts, &profile), decode(&stream, &[], &profile));
    }

    #[test]
    fn corruption_costs_no_more_than_the_frames_it_touches(
        frames in prop::collection::vec(items(), 1..6),
        profile in profile(),
        at in any::<prop::sample::Index>(),
        corruption in prop::collection::vec(byte(), 0..4),
        lost in 0usize..4,
        cuts in prop::collection::vec(any::<usize>(), 0..6),
    ) {
        let encoded: Vec<Vec<u8>> = frames.iter().map(|f| encode(f, &profile)).collect();
        let mut stream = encoded.concat();
        let at = at.index(stream.len());
        let end = (at + lost).min(stream.len());
        stream.splice(at..end, corruption.iter().copied());
        let mut expected = Vec::new();
        let mut offset = 0;
        for (frame, bytes) in frames.iter().zip(&encoded) {
            // If a checksum is removed, the next frame's EBh may take its place: a blind spot of the format itself.
            let touched = offset < end.max(at + 1) + 2 && at <= offset + bytes.len();
            offset += bytes.len();
            if !touched {
                expected.push(frame.clone());
            }
        }
        let found: Vec<_> = decode(&stream, &cuts, &profile).into_iter().flatten().collect();
        let mut rest = found.iter();
        for frame in &expected {
            prop_assert!(rest.any(|f| f == frame), "{frame:?} is lost: {found:?}");
        }
    }

    #[test]
    fn a_batch_falls_into_its_instructions(
        batch in prop::collection::vec((any::<u16>(), prop::collection::vec(item(), 0..3)), 1..7),
        profile in profile(),
    ) {
        let lone = |item: &Owned| matches!(item, Owned::I16(v) if v.len() == 1);
        prop_assume!(!batch.iter().flat_map(|(_, parameters)| parameters).any(lone));
        let mut flat = Vec::new();
        for (word, parameters) in &batch {
            flat.push(Owned::I16(vec![word.cast_signed()]));
            flat.extend(parameters.iter().cloned());
        }
        let bytes = encode(&flat, &profile);
        let mut payload = [0; MAX_PAYLOAD];
        let (frame, _) = Frame::decode(&bytes, &mut payload, &profile).unwrap().unwrap();
        let found: Vec<(u16, Vec<Owned>)> = Instructions::new(frame.items())
            .map(Result::unwrap)
            .map(|i| (i.word, i.parameters.map(|item| Owned::from(item.unwrap())).collect()))
            .collect();
        prop_assert_eq!(found, batch);
    }

    /// For any bytes of the controller and any calls of the user.
    #[test]
    fn a_host_reports_each_instruction_once_and_in_order(
        resend_on_silence: bool,
        controller_drops_partial: bool,
        steps in prop::collection::vec(
            (0..16u8, 0..2000u64, prop_oneof![
                prop::sample::select(vec![0x0101, 0x0201, 0x0301, 0xE002, 0xE003]).prop_map(echo),
                prop::collection::vec(byte(), 0..20),
            ]),
            1..100,
        )
    ) {
        let config = HostConfig {
            resend_on_silence,
            controller_drops_partial,
            execution_timeout: Duration::from_millis(400),
            longest_frame: 0,
            ..HostConfig::default()
        };
        let mut host = Host::new(config).unwrap();
        let (mut now, mut out) = (Duration::ZERO, [0; Frame::MAX_LEN]);
        let (mut submitted, mut reported, mut taken_back, mut in_flight) = (0, 0, 0, false);
        host.handle_connected(now);
        for (action, pause, bytes) in steps {
            now += Duration::from_millis(pause);
            match action {
                n @ 0..=6 => match host.submit([0x0101, 0x0201, 0x0301][usize::from(n % 3)], |_| Ok(())) {
                    Ok(ticket) => {
                        prop_assert_eq!(ticket, submitted, "numbers have no gaps");
                        submitted += 1;
                    }
                    Err(error) => prop_assert_eq!(error, SessionError::Full),
                },
                7 => host.resume(),
                8 => taken_back += u64::from(host.take_back()),
                9 => host.handle_disconnected(now),
                10 => host.handle_connected(now),
                _ => host.handle_input(now, &bytes),
            }
            host.handle_timeout(now);
            while let Some(event) = host.poll_event() {
                let (first, count) = match event {
                    HostEvent::Answer { ticket } => (ticket, 1),
                    HostEvent::Done { first, count, .. }
                    | HostEvent::Refused { first, count, .. }
                    | HostEvent::Unknown { first, count, .. } => (first, count),
                    _ => continue,
                };
                prop_assert!(core::mem::take(&mut in_flight), "an outcome without a frame");
                prop_assert_eq!(first, reported);
                reported += u64::from(count);
            }
            if !in_flight {
                // They were submitted after the frame in flight, and have no event.
                reported += core::mem::take(&mut taken_back);
            }
            prop_assert!(reported <= submitted);
            if host.poll_transmit(now, &mut out).is_some() {
                in_flight = true;
                prop_assert_eq!(host.poll_transmit(now, &mut out), None, "one frame at a time");
            }
            prop_assert!(host.poll_timeout().is_some() || host.is_held() || !in_flight);
        }
    }
}
