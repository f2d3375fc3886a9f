//! Properties of every message, every chunking and every damage.

#![allow(clippy::cast_possible_truncation)]

use core::time::Duration;

use proptest::prelude::*;
use robot_session::{Decoder as _, Session as _};
use val2_alter::{
    Controller, ControllerConfig, ControllerState, DecodeError, Decoder, EncodeError, End, Exception, Frame,
    Framing, HostMessage, Limiter, Limits, List, Message, Mode, Motion, MotionPhase, Reach, ReceivedMessage,
    Reply, RobotMessage, SegmentStatus, Start, Transform,
};

use crate::arbitrary::arbitrary;

/// Returns bytes that look like marks half of the time.
fn byte() -> impl Strategy<Value = u8> {
    prop_oneof![prop_oneof![Just(0x10), Just(0x02), Just(0x03)], any::<u8>()]
}

/// Messages of such bytes. Four others choose the kind.
fn messages<M: Message>() -> impl Strategy<Value = M> {
    let bytes = (any::<[u8; 4]>(), prop::collection::vec(byte(), 48));
    arbitrary(bytes.prop_map(|(kind, rest)| [&kind[..], &rest].concat()))
}

fn framings() -> impl Strategy<Value = Framing> {
    arbitrary(prop::collection::vec(any::<u8>(), 8))
}

fn encoded<M: Message>(message: &M, framing: Framing) -> Vec<u8> {
    let mut out = [0; Frame::MAX_LEN];
    let length = message.encode(framing, &mut out).unwrap();
    out[..length].to_vec()
}

fn fetch<M: Message>(decoder: &mut Decoder<M>) -> Vec<Result<ReceivedMessage<M>, DecodeError>> {
    core::iter::from_fn(|| decoder.next_frame()).collect()
}

/// Returns all items of a stream that is read in pieces of these lengths, again and again.
fn read<M: Message>(
    framing: Framing,
    stream: &[u8],
    lengths: &[usize],
) -> Vec<Result<ReceivedMessage<M>, DecodeError>> {
    let mut decoder = Decoder::new(framing);
    let mut all = Vec::new();
    let mut rest = stream;
    let mut lengths = lengths.iter().cycle();
    while !rest.is_empty() {
        let length = (*lengths.next().unwrap()).min(rest.len());
        let taken = decoder.push(&rest[..length]);
        assert!(taken > 0, "a drained decoder has room");
        rest = &rest[taken..];
        all.extend(fetch(&mut decoder));
    }
    decoder.finish();
    all.extend(fetch(&mut decoder));
    all
}

fn round_trip<M: Message>(message: M, framing: Framing) {
    let bytes = encoded(&message, framing);
    assert_eq!(bytes.len(), message.encoded_len(framing));
    let (frame, length) = Frame::decode(&bytes, framing).unwrap().unwrap();
    assert_eq!((M::decode(frame.data(), framing), length), (Ok(message), bytes.len()));
    assert_eq!(M::decode_frame(&bytes, framing), Ok(Some((message, length))));
    assert_eq!(M::decode_frame(&[&bytes[..], &[0x55; 40]].concat(), framing), Ok(Some((message, length))));
    for end in 0..bytes.len() {
        assert_eq!(Frame::decode(&bytes[..end], framing), Ok(None), "{end} of {bytes:02X?}");
        assert_eq!(M::decode_frame(&bytes[..end], framing), Ok(None), "{end} of {bytes:02X?}");
        let short = EncodeError::BufferTooSmall { needed: bytes.len(), available: end };
        assert_eq!(message.encode(framing, &mut vec![0; end]), Err(short));
    }
    let mut buffer = Vec::new();
    message.append_to(framing, &mut buffer);
    assert_eq!(buffer, bytes);
}

proptest! {
    #[test]
    fn what_is_encoded_decodes_to_itself(
        robot in messages::<RobotMessage>(), host in messages::<HostMessage>(), framing in framings()
    ) {
        round_trip(robot, framing);
        round_trip(host, framing);
    }

    /// A frame read in place, eight bytes at a time, and byte by byte gives the same errors.
    #[test]
    fn a_frame_that_is_read_in_place_is_read_alike(
        robot in messages::<RobotMessage>(), framing in framings(), at in any::<prop::sample::Index>(), found in byte(),
        behind in prop::collection::vec(byte(), 0..40)
    ) {
        let mut bytes = encoded(&robot, framing);
        let at = at.index(bytes.len());
        bytes[at] = found;
        bytes.extend(behind);
        let read = Frame::decode(&bytes, framing).and_then(|read| {
            read.map(|(frame, length)| Ok((RobotMessage::decode(frame.data(), framing)?, length))).transpose()
        });
        prop_assert_eq!(RobotMessage::decode_frame(&bytes, framing), read);
    }

    #[test]
    fn any_chunking_gives_the_same(
        stream in prop::collection::vec(byte(), 0..400),
        messages in prop::collection::vec(messages::<RobotMessage>(), 0..4),
        lengths in prop::collection::vec(1..40usize, 1..8),
        framing in framings()
    ) {
        let frames: Vec<u8> = messages.iter().flat_map(|message| encoded(message, framing)).collect();
        let stream = [&stream[..], &frames, &stream].concat();
        let whole = read::<RobotMessage>(framing, &stream, &[stream.len()]);
        prop_assert_eq!(&read(framing, &stream, &lengths), &whole);
        prop_assert_eq!(&read(framing, &stream, &[1]), &whole);
    }

    #[test]
    fn an_accepted_frame_encodes_to_the_same_bytes(stream in prop::collection::vec(byte(), 0..400)) {
        for received in read::<HostMessage>(Framing::DEFAULT, &stream, &[17]).into_iter().flatten() {
            let ReceivedMessage { offset, length, message } = received;
            // But for DLEs before the start mark, and a first one that was the checksum of the frame before.
            let bytes = &stream[..offset + length];
            prop_assert!(bytes.ends_with(&encoded(&message, Framing::DEFAULT)));
        }
    }

    #[test]
    fn errors_and_messages_come_in_order_and_do_not_overlap(stream in prop::collection::vec(byte(), 0..400)) {
        let mut at = 0;
        for received in read::<HostMessage>(Framing::DEFAULT, &stream, &[stream.len().max(1)]).into_iter().flatten() {
            prop_assert!(received.offset >= at, "{received:?} begins before {at}");
            at = received.offset + received.length;
            prop_assert!(at <= stream.len());
        }
    }

    #[test]
    fn corruption_costs_only_the_frames_that_it_touches(
        messages in prop::collection::vec(plausible(), 3),
        place in any::<prop::sample::Index>(),
        flip in 1..=255u8
    ) {
        let frames: Vec<_> = messages.iter().map(|message| encoded(message, Framing::DEFAULT)).collect();
        let mut stream = frames.concat();
        let at = frames[0].len() + place.index(frames[1].len());
        stream[at] ^= flip;
        let got: Vec<_> = read::<RobotMessage>(Framing::DEFAULT, &stream, &[stream.len()])
            .into_iter().flatten().map(|received| received.message).collect();
        prop_assert_eq!(got.first(), Some(&messages[0]));
        // An 8-bit sum lets some damage through: then there is a message that nobody sent.
        let unseen = got.iter().any(|message| !messages.contains(message));
        prop_assert!(unseen || got.last() == Some(&messages[2]), "{got:?}");
    }
}

/// Messages that name only known codes.
fn plausible() -> impl Strategy<Value = RobotMessage> {
    (messages::<RobotMessage>(), 1..=13u8, 0..=6u8).prop_map(|(message, status, error)| match message {
        RobotMessage::Motion(motion) => {
            RobotMessage::Motion(Motion { segment_status: status.into(), error: error.into(), ..motion })
        }
        RobotMessage::Start(start) => {
            let mode = Mode(start.mode.0 & 0x1F);
            RobotMessage::Start(Start { mode, error: error.into(), ..start })
        }
        RobotMessage::End(_) => RobotMessage::End(End { error: error.into() }),
    })
}

/// Returns a standard message whose data is rich in the bytes of the marks.
fn rich(rng: &mut Rng) -> RobotMessage {
    let mut word = || {
        let mut byte = || match rng.below(6) {
            0 => 0x10,
            1 => 0x02,
            2 => 0x03,
            _ => rng.next_u64() as u8,
        };
        i16::from_le_bytes([byte(), byte()])
    };
    let (segment, percent) = (word().cast_unsigned(), word().cast_unsigned());
    let transform = Some(Transform(core::array::from_fn(|_| word())));
    RobotMessage::Motion(Motion {
        phase: MotionPhase::Running,
        error: 0.into(),
        segment_status: SegmentStatus::from(1 + rng.below(13) as u8),
        segment,
        percent,
        transform,
    })
}

/// "Die Kapselung … ermöglicht eine einfache Wiederaufnahme der Kommunikation bei Empfang eines defekten Pakets" (§3.2):
/// it does, but only with a second reading of the damaged bytes.
#[test]
fn a_frame_after_a_cut_one_is_recovered() {
    const TRIALS: usize = 20_000;
    let mut rng = Rng::new(1997);
    let (mut recovered, mut wrong) = (0, 0);
    for _ in 0..TRIALS {
        let (cut, good) = (rich(&mut rng), rich(&mut rng));
        let mut stream = encoded(&cut, Framing::DEFAULT);
        stream.truncate(1 + rng.below(stream.len() - 1));
        stream.extend(encoded(&good, Framing::DEFAULT));
        let mut decoder = Decoder::<RobotMessage>::new(Framing::DEFAULT);
        assert_eq!(decoder.push(&stream), stream.len());
        for received in fetch(&mut decoder).into_iter().flatten() {
            recovered += usize::from(received.message == good);
            // A frame that lost only its checksum, and took the next DLE for it, has the sent contents.
            wrong += usize::from(received.message != good && received.message != cut);
        }
    }
    println!("{recovered} of {TRIALS} recovered, {wrong} wrong");
    assert!(recovered >= TRIALS * 999 / 1000, "{recovered} of {TRIALS} recovered");
    assert!(wrong <= TRIALS / 10_000, "{wrong} wrong frames in {TRIALS}");
}

/// A frame that is found inside a damaged one has passed only an 8-bit sum: it must also name known codes.
#[test]
fn a_second_reading_believes_only_known_codes() {
    fn second<M: Message>(message: M) -> bool {
        let frame = encoded(&message, Framing::DEFAULT);
        let [alone] = read::<M>(Framing::DEFAULT, &frame, &[80])[..] else { panic!() };
        assert_eq!(alone.map(|received| received.message), Ok(message));
        // Cut off after its third data byte, or its second.
        let cut: &[u8] =
            if M::MAX_DATA == 30 { b"\x10\x10\x02\x80\x02\x01" } else { b"\x10\x10\x02\x00\x01" };
        let got = read::<M>(Framing::DEFAULT, &[cut, &frame].concat(), &[80]);
        assert!(got[0].is_err());
        got.iter().flatten().any(|received| received.message == message)
    }
    let motion = |status: u8| {
        RobotMessage::Motion(Motion {
            phase: MotionPhase::Running,
            error: 0.into(),
            segment_status: status.into(),
            segment: 1,
            percent: 2,
            transform: None,
        })
    };
    let start = |mode, marked| RobotMessage::Start(Start { marked, ..Start::new(Mode(mode), List::EMPTY) });
    let reply = |exception: u8| HostMessage::Reply(Reply { exception: exception.into(), ..Reply::NOTHING });
    assert_eq!([1, 13, 14, 0].map(|status| second(motion(status))), [true, true, false, false]);
    assert_eq!([(31, true), (32, true)].map(|(mode, marked)| second(start(mode, marked))), [true, false]);
    assert_eq!([0, 253, 254, 5].map(|exception| second(reply(exception))), [true, true, true, false]);
    assert!(!start(23, false).is_plausible());
}

#[test]
fn exceptions_keep_codes_that_the_source_does_not_name() {
    for code in 0..=255u8 {
        assert_eq!(u8::from(Exception::from(code)), code);
        assert_eq!(u8::from(SegmentStatus::from(code)), code);
    }
}

/// A small generator of our own (xorshift): a test from a seed.
struct Rng(u64);

impl Rng {
    fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1)
    }

    fn next_u64(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    fn below(&mut self, end: usize) -> usize {
        (self.next_u64() >> 16) as usize % end
    }
}

proptest! {
    /// For any bytes of the host and any calls of the user.
    #[test]
    fn a_controller_sends_one_message_in_a_window(
        mode: u8,
        subroutine: bool,
        steps in prop::collection::vec(
            (0..8u8, 0..60u64, prop_oneof![
                messages::<HostMessage>().prop_map(|message| encoded(&message, Framing::DEFAULT)),
                prop::collection::vec(byte(), 0..20),
            ]),
            1..200,
        )
    ) {
        let config = ControllerConfig { mode: Mode(mode), subroutine, ..ControllerConfig::default() };
        let mut controller = Controller::new(config).unwrap();
        let (mut now, mut out, mut last) = (Duration::ZERO, [0; Frame::MAX_LEN], None);
        controller.handle_connected(now);
        for (act, pause, bytes) in steps {
            now += Duration::from_millis(pause);
            let (values, is_off) = (controller.values(), controller.state() == ControllerState::Off);
            controller.handle_input(now, &bytes);
            controller.handle_timeout(now);
            prop_assert!(!is_off || controller.values() == values, "without ALTER the arm is at rest");
            match act {
                0 | 1 if controller.start(now).is_ok() => last = None,
                2 => drop(controller.finish(now)),
                3 => drop(controller.resume(now)),
                4 => drop(controller.interrupt(now)),
                5 => {
                    controller.handle_disconnected(now);
                    controller.handle_connected(now);
                    last = None;
                }
                _ => {}
            }
            if let Some(length) = controller.poll_transmit(now, &mut out) {
                let message = RobotMessage::decode_frame(&out[..length], Framing::DEFAULT).unwrap();
                prop_assert_eq!(message.map(|(_, used)| used), Some(length));
                prop_assert!(last.is_none_or(|last| now - last >= Duration::from_millis(15)));
                last = Some(now);
            }
            prop_assert_eq!(controller.poll_transmit(now, &mut out), None, "one message at a time");
            prop_assert!(controller.poll_timeout().is_none_or(|at| at > now));
            prop_assert!(core::iter::from_fn(|| controller.poll_event()).count() <= 16);
            prop_assert_eq!(controller.statistics().unexpected, 0);
        }
    }
}

proptest! {
    /// Wherever the caller wants to go, and whenever a reply is not read.
    #[test]
    fn an_arm_stays_within_reach(
        low in -400..=0, high in 0..=400, velocity in 1..120u16, acceleration in 1..40u16,
        steps in prop::collection::vec((-200..200i16, prop::bool::weighted(0.1)), 1..300),
    ) {
        let reach = Reach { low: [low; 6], high: [high; 6] };
        let limits = Limits { velocity: [velocity; 6], acceleration: [acceleration; 6] };
        let mut limiter = Limiter::new(limits);
        let (mut at, mut last) = (0, 0);
        for (target, is_rejected) in steps {
            if is_rejected {
                // The arm did not move by the last value, and is at rest.
                at -= last;
                limiter.rejected();
            }
            let wanted = reach.speeds([at; 6], [target; 6], &limits.acceleration);
            last = i32::from(limiter.speeds(wanted)[0]);
            at += last;
            prop_assert!((low..=high).contains(&at), "{at}");
            let offset = i32::from(reach.offsets([target; 6])[5]);
            prop_assert!((low..=high).contains(&offset));
        }
    }
}
