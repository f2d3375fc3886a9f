//! Edge cases: JSON that is not a message, values at the end of their range, buffers that are one byte short.

use core::time::Duration;

use laser_eb90::robot_session::{Decoder as _, Encode as _, Session as _};
use laser_eb90::{
    Controller, ControllerConfig, ControllerEvent, DecodeError, Decoder, EncodeError, ErrorCodes, Frame,
    Host, HostConfig, HostEvent, Instruction, Instructions, Item, Items, MAX_PAYLOAD, Payload, Profile,
    Refusal, SessionError, Tags, Width,
};
use serde::de::DeserializeSeed as _;

fn read(json: &str) -> Result<Vec<u8>, String> {
    let mut buffer = [0; MAX_PAYLOAD];
    let mut payload = Payload::new(&mut buffer, &Profile::default());
    let outcome = (&mut payload).deserialize(&mut serde_json::Deserializer::from_str(json));
    outcome.map(|()| payload.as_bytes().to_vec()).map_err(|error| error.to_string())
}

#[test]
fn json_that_is_no_message_says_what_it_should_be() {
    assert_eq!(
        read(r#"{"items":[{"u8":[1,255]},{"char":"\u0041\u00ff"}]}"#),
        Ok(vec![0xF2, 2, 1, 255, 0xF3, 2, 0x41, 0xFF])
    );
    let many = format!(r#"{{"items":[{{"u8":[{}]}}]}}"#, ["0"; 256].join(","));
    let long = format!(r#"{{"items":[{{"char":"{}"}}]}}"#, "x".repeat(256));
    for (json, expected) in [
        ("[]", "invalid type: sequence, expected an object with one field `items`"),
        ("{}", "missing field `items`"),
        (r#"{"values":[]}"#, "unknown field `values`, expected `items`"),
        (r#"{"items":[],"items":[]}"#, "duplicate field `items`"),
        (r#"{"items":[],"rest":1}"#, "unknown field `rest`, expected `items`"),
        (r#"{"items":1}"#, "invalid type: integer `1`, expected a list of items"),
        (
            r#"{"items":[1]}"#,
            "invalid type: integer `1`, expected an item: an object with one field, `f32`, `i16`, `u8` or `char`",
        ),
        (r#"{"items":[{}]}"#, "an item without a type"),
        (r#"{"items":[{"u8":[],"i16":[]}]}"#, "an item holds values of one type"),
        (
            r#"{"items":[{"u8":[],"u16":[]}]}"#,
            "unknown field `u16`, expected one of `f32`, `i16`, `u8`, `char`",
        ),
        (r#"{"items":[{"f32":"1"}]}"#, "invalid type: string \"1\", expected a list of up to 255 numbers"),
        (r#"{"items":[{"i16":[32768]}]}"#, "invalid value: integer `32768`, expected i16"),
        (
            r#"{"items":[{"char":7}]}"#,
            "invalid type: integer `7`, expected a string of up to 255 characters U+0000 to U+00FF",
        ),
        (r#"{"items":[{"char":"ā"}]}"#, "'ā' is no character U+0000 to U+00FF"),
        (&many, "an item holds at most 255 values, not 256"),
        (&long, "an item holds at most 255 values, not 256"),
    ] {
        let error = read(json).unwrap_err();
        assert!(error.starts_with(expected), "{json}: {error}");
    }
    let mut buffer = [0; 64];
    let mut payload = Payload::new(&mut buffer, &Profile::default());
    let error = payload.deserialize(serde_json::json!({"items": [{"f32": vec![0; 16]}]})).unwrap_err();
    assert_eq!(error.to_string(), "66 bytes are needed, the buffer has 64");
    assert!(payload.as_bytes().is_empty());
}

#[test]
fn a_corrupt_item_has_no_json() {
    let mut buffer = [0; 8];
    let bytes = [0xEB, 0x90, 0x82, 0xF0, 0xF2, 5, 0x90, 0x82, 0xF7];
    let corrupt = Frame::decode(&bytes, &mut buffer, &Profile::default());
    let (frame, used) = corrupt.unwrap().unwrap();
    assert_eq!((used, frame.items().check()), (9, Err(DecodeError::Item { offset: 0, needed: 7, found: 2 })));
    let error = serde_json::to_string(&frame).unwrap_err();
    assert_eq!(error.to_string(), "an item needs 7 bytes, the payload has 2 left (at payload byte 0)");
    assert_eq!(Instruction::single(frame.items()), Err(DecodeError::Item { offset: 0, needed: 7, found: 2 }));
}

#[test]
fn four_tags_differ_in_code_and_in_json() {
    let tags = Tags::new(1, 2, 3, 4).unwrap();
    let json = r#"{"f32":1,"i16":2,"u8":3,"char":4}"#;
    assert_eq!(serde_json::to_string(&tags).unwrap(), json);
    assert_eq!(serde_json::from_str::<Tags>(json).unwrap(), tags);
    // Each pair once.
    for [f32, i16, u8, char] in
        [[1, 1, 3, 4], [1, 2, 1, 4], [1, 2, 3, 1], [1, 2, 2, 4], [1, 2, 3, 2], [1, 2, 3, 3]]
    {
        assert_eq!(Tags::new(f32, i16, u8, char), None);
    }
    let error = serde_json::from_str::<Tags>(&json.replace('4', "1")).unwrap_err();
    assert!(error.to_string().starts_with("two value types have the same tag"), "{error}");
}

#[test]
fn values_print_and_compare_by_what_they_are() {
    let (mut one, mut two) = ([0; 32], [0; 32]);
    let big = Profile { byte_order: laser_eb90::ByteOrder::Big, ..Profile::default() };
    let (mut little, mut big) = (Payload::new(&mut one, &Profile::default()), Payload::new(&mut two, &big));
    for payload in [&mut little, &mut big] {
        payload.f32(&[1.5, -2.0]).unwrap().i16(&[]).unwrap();
    }
    assert_ne!(little.as_bytes(), big.as_bytes());
    let (little, big) = (little.frame().unwrap(), big.frame().unwrap());
    let (Some(Ok(Item::F32(a))), Some(Ok(Item::F32(b)))) = (little.items().next(), big.items().next()) else {
        panic!("no floats");
    };
    assert_eq!(a, b, "the order of bytes is not a value");
    assert_eq!((format!("{a:?}"), a.len(), a.is_empty()), ("[1.5, -2.0]".into(), 2, false));
    let Some(Ok(Item::I16(none))) = little.items().nth(1) else { panic!("no shorts") };
    assert_eq!((none.len(), none.is_empty(), none.array::<0>()), (0, true, Some([])));
    assert_eq!((Width::U8.len(), Width::U16Be.len(), Width::U8.is_empty()), (1, 2, false));
}

#[test]
fn values_differ_in_a_number_or_in_how_many_there_are() {
    let floats = |values: &[f32]| {
        let mut buffer = [0; 32];
        let mut payload = Payload::new(&mut buffer, &Profile::default());
        payload.f32(values).unwrap().as_bytes().to_vec()
    };
    let (one, other, longer) = (floats(&[1.5]), floats(&[1.25]), floats(&[1.5, 1.5]));
    let first = |payload| Items::new(payload, &Profile::default()).next().unwrap().unwrap();
    assert_eq!(first(&one), first(&one));
    assert_ne!(first(&one), first(&other));
    assert_ne!(first(&one), first(&longer));
}

#[test]
fn the_first_instruction_of_a_batch_is_what_it_is_alone() {
    let mut buffer = [0; 32];
    let mut payload = Payload::new(&mut buffer, &Profile::default());
    payload.word(0x0101).unwrap().u8(&[7]).unwrap();
    let alone = payload.as_bytes().to_vec();
    payload.word(0x0102).unwrap();
    let [alone, batch] = [&alone[..], payload.as_bytes()]
        .map(|bytes| Instructions::new(Items::new(bytes, &Profile::default())));
    let (alone, batch): (Vec<_>, Vec<_>) =
        (alone.map(Result::unwrap).collect(), batch.map(Result::unwrap).collect());
    assert_eq!((alone.len(), batch.len()), (1, 2));
    assert_eq!(alone[0], batch[0]);
    assert_eq!((batch[0].parameters.as_bytes(), batch[1].parameters.is_empty()), (&[0xF2, 1, 7][..], true));
}

#[test]
fn a_payload_without_items_makes_no_frame() {
    let mut buffer = [0; 3];
    let mut payload = Payload::new(&mut buffer, &Profile::default());
    assert_eq!(payload.frame(), Err(EncodeError::Empty));
    assert_eq!(payload.word(0x0101).map(drop), Err(EncodeError::BufferTooSmall { needed: 4, available: 3 }));
    assert_eq!(payload.u8(&[7]).map(drop), Ok(()));
    assert_eq!(Frame::MAX_LEN, 3 + 1 + 1024 + 2 + 2);
    assert_eq!((Frame::MIN_LEN, payload.frame().unwrap().encoded_len()), (8, 10));
}

#[test]
fn bytes_that_begin_with_no_head_are_an_error_of_the_frame_itself() {
    let decode = |bytes: &[u8]| Frame::decode(bytes, &mut [0; 8], &Profile::default()).map(drop);
    assert_eq!(decode(&[0xEB, 0x91, 0x82]), Err(DecodeError::NoHead { skipped: 3 }));
    assert_eq!(decode(&[0xEB, 0x90]), Ok(()));
    // The checksum is right: a false head can be followed by that too.
    let no_tag = [0xEB, 0x90, 0x82, 0xF0, 0x55, 0x01, 0x90, 0x82, 0x56];
    assert_eq!(decode(&no_tag), Err(DecodeError::Tag { offset: 0, found: 0x55 }));
}

#[test]
fn a_frame_decodes_without_a_decoder() {
    let mut buffer = [0; 7];
    let mut payload = Payload::new(&mut buffer, &Profile::default());
    let frame = payload.char(b"HELLO").unwrap().frame().unwrap();
    let mut bytes = vec![0; frame.encoded_len()];
    assert_eq!(frame.encode(&mut bytes), Ok(bytes.len()));
    let mut appended = Vec::new();
    frame.append_to(&mut appended);
    assert_eq!(appended, bytes);
    let mut payload = [0; 7];
    for cut in 0..bytes.len() {
        assert_eq!(Frame::decode(&bytes[..cut], &mut payload, &Profile::default()), Ok(None));
    }
    let (frame, used) = Frame::decode(&bytes, &mut payload, &Profile::default()).unwrap().unwrap();
    assert_eq!((frame.payload(), used), (&b"\xF3\x05HELLO"[..], bytes.len()));
    let error = Frame::decode(&bytes, &mut [0; 6], &Profile::default()).unwrap_err();
    assert_eq!(error.to_string(), "the payload is longer than 6 bytes (at byte 10)");
}

#[test]
fn noise_is_an_error_as_soon_as_there_are_512_bytes_of_it() {
    let mut decoder = Decoder::new(&Profile::default());
    assert_eq!(decoder.push(&[0x55; 511]), 511);
    assert_eq!(decoder.next_frame(), None);
    assert_eq!(decoder.push(&[0x55]), 1);
    assert_eq!(decoder.next_frame(), Some(Err(DecodeError::NoHead { skipped: 512 })));
    assert_eq!(decoder.next_frame(), None);
    assert_eq!((decoder.position(), decoder.is_empty()), (512, true));
}

#[test]
fn what_comes_byte_by_byte_is_given_with_its_last_byte() {
    let noise = [0x55, 0xEB];
    let frame = [0xEB, 0x90, 0x82, 0xF0, 0xF2, 2, 0x90, 0x90, 0x82, 0x90, 0x82, 0x06];
    let corrupt = [0xEB, 0x90, 0x82, 0xF0, 0xF2, 2, 1, 0x90, 0x55];
    let mut decoder = Decoder::new(&Profile::default());
    let mut given = Vec::new();
    for (at, byte) in [&noise[..], &frame, &corrupt, &frame].concat().into_iter().enumerate() {
        assert_eq!(decoder.push(&[byte]), 1);
        while let Some(item) = decoder.next_frame() {
            given.push((at, item.map(|frame| frame.payload().to_vec())));
        }
    }
    let payload = Ok(vec![0xF2, 2, 0x90, 0x82]);
    let stuffing = Err(DecodeError::Stuffing { offset: 8, found: 0x55 });
    let no_head = Err(DecodeError::NoHead { skipped: 2 });
    assert_eq!(given, [(4, no_head), (13, payload.clone()), (22, stuffing), (34, payload)]);
}

#[test]
fn what_is_given_does_not_depend_on_the_pieces_that_came() {
    let doubled = [0xEB, 0x90, 0x82, 0xF0, 0xF2, 2, 0x90, 0x90, 0x82, 0x90, 0x82, 0x06];
    let stream = [&[0x55, 0xEB], &word(0x0101)[..], &doubled, &word(0x0102)].concat();
    let given = |decoder: &mut Decoder, piece: &[u8]| {
        assert_eq!(decoder.push(piece), piece.len());
        let mut given = Vec::new();
        while let Some(item) = decoder.next_frame() {
            given.push(item.map(|frame| frame.payload().to_vec()));
        }
        given
    };
    for end in 1..=stream.len() {
        let whole = given(&mut Decoder::new(&Profile::default()), &stream[..end]);
        for (first, second) in (0..end).flat_map(|first| (first..end).map(move |second| (first, second))) {
            let mut decoder = Decoder::new(&Profile::default());
            let pieces = [&stream[..first], &stream[first..second], &stream[second..end]];
            let found = pieces.map(|piece| given(&mut decoder, piece)).concat();
            assert_eq!(found, whole, "{first}, {second}, {end}");
        }
    }
}

#[test]
fn what_is_held_when_the_stream_ends_is_given_to_its_last_byte() {
    let doubled = [0xEB, 0x90, 0x82, 0xF0, 0xF2, 2, 0x90, 0x90, 0x82, 0x90, 0x82, 0x06];
    let whole = word(0x0101);
    for first in [&whole[..], &doubled, &[0x55]] {
        let mut decoder = Decoder::new(&Profile::default());
        let _ = decoder.push(&[first, &whole[..6]].concat());
        decoder.finish();
        assert!(decoder.next_frame().is_some());
        assert_eq!(decoder.next_frame(), Some(Err(DecodeError::Incomplete { held: 6 })), "{first:02X?}");
        assert_eq!(decoder.next_frame(), None);
    }
}

#[test]
fn corruption_costs_the_bytes_that_were_examined_and_no_error_more() {
    for (corrupt, error) in [
        (
            &[0xEB, 0x90, 0x82, 0xF0, 0xF2, 2, 1, 0x90, 0x55][..],
            DecodeError::Stuffing { offset: 8, found: 0x55 },
        ),
        (&[0xEB, 0x90, 0x82, 0xF0, 0x55], DecodeError::Tag { offset: 0, found: 0x55 }),
        (&[0xEB, 0x90, 0x82, 0x55], DecodeError::Flag { offset: 3, expected: 0xF0, found: 0x55 }),
    ] {
        let mut decoder = Decoder::new(&Profile::default());
        let _ = decoder.push(&[corrupt, &word(0x0101)].concat());
        assert_eq!(decoder.next_frame(), Some(Err(error)));
        assert_eq!(decoder.position(), corrupt.len() as u64);
        assert_eq!(decoder.next_frame().unwrap().unwrap().payload(), [0xF1, 1, 1, 1]);
    }
}

#[test]
fn a_payload_is_too_long_with_its_513th_byte() {
    let mut stream = vec![0xEB, 0x90, 0x82, 0xF0];
    stream.extend([0xF2; 517]);
    for first in [516, 521] {
        let mut decoder = Decoder::new(&Profile::default());
        assert_eq!(decoder.push(&stream[..first]), first);
        if first == 516 {
            assert_eq!(decoder.next_frame(), None);
            assert_eq!(decoder.push(&stream[first..]), stream.len() - first);
        }
        assert_eq!(decoder.next_frame(), Some(Err(DecodeError::TooLong { offset: 516, limit: 512 })));
        assert_eq!(decoder.position(), 517);
    }
}

#[test]
fn what_came_before_a_frame_was_sent_is_no_part_of_its_answer() {
    let (mut host, mut out) = (Host::new(HostConfig::default()).unwrap(), [0; Frame::MAX_LEN]);
    let now = Duration::from_secs(2);
    host.handle_connected(Duration::ZERO);
    for first in [0, 1] {
        assert_eq!(host.submit(0x0101, |_| Ok(())), Ok(first));
        let length = host.poll_transmit(now, &mut out).unwrap();
        assert_eq!(out[..length], word(0x0101));
        // After the answer the beginning of another frame: with the next answer after it, it would be a corrupt one.
        host.handle_input(now, &[&word(0x0101)[..], &word(0x0101)[..6]].concat());
        let done = HostEvent::Done { first, count: 1, resends: 0, unanswered: 0 };
        assert_eq!(host.poll_event(), Some(done));
    }
}

/// An instruction of any kind.
struct AnyInstruction;

impl TryFrom<Instruction<'_>> for AnyInstruction {
    type Error = ();

    fn try_from(_: Instruction<'_>) -> Result<Self, ()> {
        Ok(Self)
    }
}

/// Returns a frame of one word.
fn word(word: u16) -> Vec<u8> {
    let (mut buffer, mut out) = ([0; 4], vec![0; 16]);
    let mut payload = Payload::new(&mut buffer, &Profile::default());
    let length = payload.word(word).unwrap().frame().unwrap().encode(&mut out).unwrap();
    out.truncate(length);
    out
}

#[test]
fn an_instruction_that_cannot_be_executed_is_answered_with_its_error_code() {
    let (writer, _reader) = robot_work_queue::boxed::<AnyInstruction>(4, 99).unwrap();
    let mut controller = Controller::new(ControllerConfig::default(), writer).unwrap();
    controller.handle_connected(Duration::ZERO);
    let (now, mut out) = (Duration::ZERO, [0; Frame::MAX_LEN]);
    assert_eq!(controller.refuse(now, Refusal::BadParameters), Err(SessionError::NotExecuting));
    controller.handle_input(now, &word(0x0201));
    assert!(matches!(controller.poll_event(), Some(ControllerEvent::Execute { .. })));
    let too_many = controller.answer(now, |values| values.u8(&[0; 256]).map(drop));
    assert_eq!(too_many, Err(SessionError::Encode(EncodeError::TooManyValues { count: 256 })));
    // Bytes that arrive meanwhile wait in the decoder, and then outside.
    let noise = vec![0x55; 3 * Frame::MAX_LEN];
    controller.handle_input(now, &noise);
    assert_eq!((controller.poll_transmit(now, &mut out), controller.poll_timeout()), (None, None));
    assert_eq!(controller.refuse(now, Refusal::BadParameters), Ok(()));
    let later = now + Duration::from_secs(1);
    let length = controller.poll_transmit(later, &mut out).unwrap();
    assert_eq!(out[..length], word(ErrorCodes::default().bad_parameters));
    assert_eq!(controller.queue_mut().free(), 4);
}
