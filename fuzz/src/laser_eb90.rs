//! The laser robot: its items and its stream decoder under any profile, and both sessions on any line at any time.

use core::time::Duration;

use arbitrary::Unstructured;
use laser_eb90::robot_session::{Encode as _, Session as _};
use laser_eb90::{
    ByteOrder, Class, Controller, ControllerConfig, ControllerEvent, Decoder, EncodeError, Flag, Frame, Host,
    HostConfig, HostEvent, Instruction, Instructions, Item as Value, MAX_PAYLOAD, Payload, Profile, Refusal,
    SessionError, Tags, Tail, Width,
};

use crate::{codecs, step, written};

/// Two bytes say how the frames are written and how long the reads are, the rest is the stream.
pub fn laser_eb90_decoder(data: &[u8]) {
    let [settings, size, stream @ ..] = data else { return };
    codecs::decoder(&Sent::new(*settings), stream, *size);
}

/// What both sides send, in one profile.
pub(crate) struct Sent {
    profile: Profile,
}

impl Sent {
    pub(crate) fn new(settings: u8) -> Self {
        Self { profile: profile(settings) }
    }
}

impl codecs::Side for Sent {
    type Decoder = Decoder;
    /// Its payload.
    type Frame = Vec<u8>;

    fn decoder(&self) -> Decoder {
        Decoder::new(&self.profile)
    }

    fn keep(&self, frame: Frame<'_>) -> Vec<u8> {
        assert_eq!(frame.items().check(), Ok(()), "the decoder has read the items over");
        frame.payload().to_vec()
    }

    fn check(&self, payload: &Vec<u8>, _: &[u8], bytes: &[u8]) {
        let mut buffer = [0; MAX_PAYLOAD];
        let (frame, used) = Frame::decode(bytes, &mut buffer, &self.profile).unwrap().unwrap();
        assert_eq!((frame.payload(), used), (&payload[..], bytes.len()));
        let mut again = vec![0; frame.encoded_len()];
        assert_eq!(frame.encode(&mut again), Ok(bytes.len()));
        if self.profile.tail != Tail::Either {
            assert_eq!(again, bytes, "an accepted frame encodes to its bytes");
        }
        cut(&frame);
    }

    fn good(&self, _: usize) -> (Vec<u8>, Vec<u8>) {
        let (mut buffer, mut out) = ([0; 8], [0; 16]);
        let mut payload = Payload::new(&mut buffer, &self.profile);
        let length = payload.word(0x9010).unwrap().frame().unwrap().encode(&mut out).unwrap();
        (payload.as_bytes().to_vec(), out[..length].to_vec())
    }
}

/// The instructions of a batch are its payload, cut in pieces that each begin with a word.
fn cut(frame: &Frame<'_>) {
    let mut length = 0;
    for instruction in Instructions::new(frame.items()) {
        let Ok(instruction) = instruction else { return };
        length += 4 + instruction.parameters.as_bytes().len();
        let at = length - instruction.parameters.as_bytes().len();
        assert_eq!(&frame.payload()[at..length], instruction.parameters.as_bytes());
    }
    assert_eq!(length, frame.payload().len());
}

#[derive(Debug, arbitrary::Arbitrary)]
enum Any {
    F32(Vec<u32>),
    I16(Vec<i16>),
    U8(Vec<u8>),
    Char(Vec<u8>),
    Word(u16),
}

/// Items of any values in any profile: what finds room is read back the same.
pub fn laser_eb90_message(data: &[u8]) {
    let Ok((settings, room, items)) = Unstructured::new(data).arbitrary::<(u8, u16, Vec<Any>)>() else {
        return;
    };
    let (profile, mut buffer) = (profile(settings), vec![0; usize::from(room % 600)]);
    let mut payload = Payload::new(&mut buffer, &profile);
    let (mut taken, mut length) = (Vec::new(), 0);
    for item in &items {
        let before = payload.as_bytes().to_vec();
        let (outcome, count, bytes) = match item {
            Any::F32(bits) => {
                let values: Vec<_> = bits.iter().copied().map(f32::from_bits).collect();
                (payload.f32(&values).map(drop), values.len(), 4 * values.len())
            }
            Any::I16(values) => (payload.i16(values).map(drop), values.len(), 2 * values.len()),
            Any::U8(values) => (payload.u8(values).map(drop), values.len(), values.len()),
            Any::Char(values) => (payload.char(values).map(drop), values.len(), values.len()),
            Any::Word(word) => (payload.word(*word).map(drop), 1, 2),
        };
        let available = usize::from(room % 600).min(MAX_PAYLOAD) - length;
        let not_finite = match item {
            Any::F32(bits) => bits.iter().position(|bits| !f32::from_bits(*bits).is_finite()),
            _ => None,
        };
        let expected = if let Some(index) = not_finite {
            Err(EncodeError::NotFinite { index })
        } else if count > 255 {
            Err(EncodeError::TooManyValues { count })
        } else if 2 + bytes > available {
            Err(EncodeError::BufferTooSmall { needed: 2 + bytes, available })
        } else {
            length += 2 + bytes;
            taken.push(item);
            Ok(())
        };
        assert_eq!(outcome, expected);
        assert!(outcome.is_ok() || payload.as_bytes() == before, "what fails leaves it as it was");
    }
    assert_eq!(payload.as_bytes().len(), length);
    let frame = match payload.frame() {
        Ok(frame) => frame,
        Err(error) => return assert_eq!((error, length), (EncodeError::Empty, 0)),
    };
    let bytes = written(frame.encoded_len(), |out| frame.encode(out)).unwrap();
    let mut again = [0; MAX_PAYLOAD];
    let (frame, used) = Frame::decode(&bytes, &mut again, &profile).unwrap().unwrap();
    assert_eq!((frame.payload(), used), (payload.as_bytes(), bytes.len()));
    let read: Vec<_> = frame.items().map(Result::unwrap).collect();
    assert_eq!(read.len(), taken.len());
    assert!(read.iter().zip(taken).all(|(read, item)| same(read, item)));
    cut(&frame);
}

/// Floats bit by bit.
fn same(read: &Value<'_>, item: &Any) -> bool {
    match (read, item) {
        (Value::F32(values), Any::F32(bits)) => values.iter().map(f32::to_bits).eq(bits.iter().copied()),
        (Value::I16(values), Any::I16(expected)) => values.iter().eq(expected.iter().copied()),
        (Value::I16(values), Any::Word(word)) => values.array() == Some([word.cast_signed()]),
        (Value::U8(values), Any::U8(expected)) | (Value::Char(values), Any::Char(expected)) => {
            values == expected
        }
        _ => false,
    }
}

fn profile(settings: u8) -> Profile {
    let pick = |bit: u8| settings & (1 << bit) != 0;
    Profile {
        tail: match settings & 3 {
            0 | 1 => Tail::Printed,
            2 => Tail::Etx,
            _ => Tail::Either,
        },
        flag: if pick(2) { Flag::FirstTag } else { Flag::Separate },
        tags: if pick(3) { Tags::new(0xF0, 0xF2, 0xF1, 0xF3).unwrap() } else { Tags::default() },
        checksum: match settings >> 4 & 3 {
            0 | 1 => Width::U8,
            2 => Width::U16Le,
            _ => Width::U16Be,
        },
        checksum_negated: pick(6),
        checksum_with_flag: pick(7),
        byte_order: if pick(3) { ByteOrder::Big } else { ByteOrder::Little },
    }
}

/// Steps of an action, a pause, a length, and so many bytes from the line.
pub fn laser_eb90_host(mut data: &[u8]) {
    let Some((&settings, rest)) = data.split_first() else { return };
    data = rest;
    let config = HostConfig {
        resend_on_silence: settings & 1 != 0,
        controller_drops_partial: settings & 2 != 0,
        execution_timeout: Duration::from_millis(400),
        longest_frame: 0,
        ..HostConfig::default()
    };
    let mut host = Host::new(config).unwrap();
    let (mut now, mut out) = (Duration::ZERO, [0; Frame::MAX_LEN]);
    host.handle_connected(now);
    let (mut submitted, mut reported, mut taken_back, mut in_flight) = (0, 0, 0, false);
    while let Some(([action, pause, length], bytes)) = step(&mut data) {
        now += Duration::from_millis(u64::from(pause) * 8);
        match action % 16 {
            n @ 0..=7 => {
                let word = [0x0101, 0x0201, 0x0301, 0x7777][usize::from(n % 4)];
                match host.submit(word, |parameters| parameters.u8(bytes).map(drop)) {
                    Ok(ticket) => {
                        assert_eq!(ticket, submitted, "numbers have no gaps");
                        submitted += 1;
                    }
                    Err(SessionError::Full | SessionError::UnknownWord { word: 0x7777 }) => {}
                    Err(error) => panic!("{error}"),
                }
            }
            8 => host.resume(),
            9 => taken_back += u64::from(host.take_back()),
            10 if length % 8 == 0 => host.handle_disconnected(now),
            10 => host.handle_connected(now),
            11 => host.handle_transmitted(now),
            _ => host.handle_input(now, bytes),
        }
        host.handle_timeout(now);
        while let Some(event) = host.poll_event() {
            let (first, count) = match event {
                HostEvent::Done { first, count, unanswered, .. } => {
                    assert!(unanswered == 0 || settings & 1 != 0);
                    (first, count)
                }
                HostEvent::Answer { ticket } => {
                    assert_eq!(host.answer().check(), Ok(()));
                    (ticket, 1)
                }
                HostEvent::Refused { first, count, .. } | HostEvent::Unknown { first, count, .. } => {
                    (first, count)
                }
                _ => continue,
            };
            assert!(in_flight, "an outcome without a frame");
            in_flight = false;
            assert_eq!(first, reported, "every instruction is reported once, in order");
            reported += u64::from(count);
        }
        if !in_flight {
            // They were submitted after what was in flight, and have no event.
            reported += core::mem::take(&mut taken_back);
        }
        assert!(reported <= submitted);
        if let Some(n) = host.poll_transmit(now, &mut out) {
            let mut payload = [0; MAX_PAYLOAD];
            let (frame, used) = Frame::decode(&out[..n], &mut payload, &Profile::default()).unwrap().unwrap();
            assert_eq!((used, frame.items().check()), (n, Ok(())));
            in_flight = true;
            assert_eq!(host.poll_transmit(now, &mut out), None, "one frame at a time");
        }
        assert!(host.poll_timeout().is_some() || host.is_held() || !in_flight);
    }
}

/// An interpreted instruction whatever its parameters are, unless they begin with a byte of 13.
struct Job;

impl TryFrom<Instruction<'_>> for Job {
    type Error = ();

    fn try_from(instruction: Instruction<'_>) -> Result<Self, ()> {
        assert_eq!(instruction.parameters.check(), Ok(()));
        if instruction.parameters.as_bytes().get(2) == Some(&13) { Err(()) } else { Ok(Self) }
    }
}

/// Steps of an action, a pause, a length, and so many bytes from the line.
pub fn laser_eb90_controller(mut data: &[u8]) {
    let (writer, mut reader) = robot_work_queue::boxed::<Job>(10, 9999).unwrap();
    let mut controller = Controller::new(ControllerConfig::default(), writer).unwrap();
    let (mut now, mut out) = (Duration::ZERO, [0; Frame::MAX_LEN]);
    controller.handle_connected(now);
    let (mut received, mut answers, mut executing) = (0, 0, false);
    while let Some(([action, pause, length], bytes)) = step(&mut data) {
        now += Duration::from_millis(pause.into());
        match action % 8 {
            0 => drop(reader.take().map(|job| job.complete())),
            1 => {
                let outcome = controller.answer(now, |values| values.u8(bytes).map(drop));
                assert_eq!(outcome.is_ok(), executing);
                executing = false;
            }
            2 => {
                let outcome = controller.refuse(now, Refusal::BadParameters);
                assert_eq!(outcome.is_ok(), executing);
                executing = false;
            }
            3 if length % 8 == 0 => {
                controller.handle_disconnected(now);
                controller.handle_connected(now);
            }
            _ => {
                received += bytes.len();
                controller.handle_input(now, bytes);
            }
        }
        controller.handle_timeout(now);
        while let Some(event) = controller.poll_event() {
            if let ControllerEvent::Execute { class, word } = event {
                assert_ne!(class, Class::Interpreted);
                let instruction = controller.instruction().unwrap();
                assert_eq!((instruction.word, instruction.parameters.check()), (word, Ok(())));
                executing = true;
            }
        }
        if let Some(n) = controller.poll_transmit(now, &mut out) {
            assert!(!executing, "executed first, then answered");
            answers += 1;
            let mut payload = [0; MAX_PAYLOAD];
            let (frame, used) = Frame::decode(&out[..n], &mut payload, &Profile::default()).unwrap().unwrap();
            assert_eq!(used, n);
            Instruction::single(frame.items()).expect("an answer begins with a word");
            assert_eq!(controller.poll_transmit(now, &mut out), None, "one answer");
        }
        assert!(answers * Frame::MIN_LEN <= received, "it sends only when asked");
        assert!(reader.len() <= 10);
        // Whatever is waiting can be waited for.
        assert!(controller.poll_timeout().is_none_or(|at| at <= now + Duration::from_millis(66)));
    }
}
