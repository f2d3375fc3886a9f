//! The results of a decoder for bytes that are nearly a frame, and when it returns them.

use robot_session::Decoder as _;
use val2_alter::{
    DecodeError, Decoder, End, ErrorCode, Frame, Framing, LeadingDle, List, Message as _, Mode, Motion,
    MotionPhase, ReceivedMessage, RobotMessage, Start, Transform,
};

type Item = Result<ReceivedMessage<RobotMessage>, DecodeError>;

const MARK: &[u8] = b"\x10\x10\x02";

fn motion(segment_status: u8, segment: u16, transform: Option<Transform>) -> RobotMessage {
    let (phase, error, percent) = (MotionPhase::Running, ErrorCode::None, 0);
    let segment_status = segment_status.into();
    RobotMessage::Motion(Motion { phase, error, segment_status, segment, percent, transform })
}

fn start(words: &[i16]) -> RobotMessage {
    RobotMessage::Start(Start::new(Mode(23), List::new(words).unwrap()))
}

fn wire(message: RobotMessage, framing: Framing) -> Vec<u8> {
    let mut out = [0; Frame::MAX_LEN];
    let length = message.encode(framing, &mut out).unwrap();
    out[..length].to_vec()
}

fn items(framing: Framing, stream: &[u8]) -> Vec<Item> {
    let mut decoder = Decoder::new(framing);
    assert_eq!(decoder.push(stream), stream.len());
    core::iter::from_fn(|| decoder.next_frame()).collect()
}

#[test]
fn a_decoder_has_room_for_two_of_the_longest_frames() {
    let mut decoder = Decoder::<RobotMessage>::new(Framing::DEFAULT);
    assert_eq!(decoder.push(&[0; 300]), 2 * Frame::MAX_LEN);
    // Nor for single bytes.
    assert_eq!([&[0][..], &[0], &[0; 300]].map(|bytes| decoder.push(bytes)), [0; 3]);
    assert_eq!((decoder.next_frame(), decoder.pending()), (None, 2 * Frame::MAX_LEN));
    assert_eq!([&[0][..], &[0; 300]].map(|bytes| decoder.push(bytes)), [1, 2 * Frame::MAX_LEN - 1]);
}

#[test]
fn a_dle_that_neither_is_doubled_nor_ends_is_reported_at_once() {
    for found in (0..=255).filter(|found| ![0x10, 0x03].contains(found)) {
        let mut decoder = Decoder::<RobotMessage>::new(Framing::DEFAULT);
        assert_eq!(decoder.push(&[MARK, &[0x80]].concat()), 4);
        assert_eq!((decoder.next_frame(), decoder.corruption()), (None, None));
        assert_eq!(decoder.push(&[0x10, found]), 2);
        let error = DecodeError::EndMark { offset: 5, found };
        assert_eq!((decoder.next_frame(), decoder.corruption()), (None, Some(error)));
    }
}

#[test]
fn one_byte_too_many_is_reported_at_once() {
    let mut decoder = Decoder::<RobotMessage>::new(Framing::DEFAULT);
    for byte in [MARK, &[0x80; 30]].concat() {
        assert_eq!((decoder.push(&[byte]), decoder.next_frame(), decoder.corruption()), (1, None, None));
    }
    let error = DecodeError::TooLong { offset: 0, limit: 30 };
    assert_eq!((decoder.push(&[0]), decoder.next_frame(), decoder.corruption()), (1, None, Some(error)));
}

#[test]
fn no_wrong_checksum_passes_and_each_costs_its_frame_alone() {
    let next = motion(1, 1, None);
    let messages = [
        RobotMessage::End(End { error: ErrorCode::None }),
        motion(2, 0x1234, None),
        start(&[1, 2, 3]),
        start(&[-1, 20, -300, 4000]),
        motion(2, 0x1234, Some(Transform([0x7654; 12]))),
    ];
    for (message, leading_dle) in
        messages.into_iter().flat_map(|message| [LeadingDle::One, LeadingDle::Two].map(|dle| (message, dle)))
    {
        let framing = Framing { leading_dle, ..Framing::DEFAULT };
        let good = wire(message, framing);
        let (expected, frame) = good.split_last().unwrap();
        for found in (0..=255).filter(|found| found != expected) {
            let stream = [frame, &[found], &wire(next, framing)].concat();
            let items = items(framing, &stream);
            let error = DecodeError::Checksum { offset: frame.len(), expected: *expected, found };
            assert_eq!(items[0], Err(error), "{stream:02X?}");
            assert_eq!(items[1..].iter().map(|item| item.unwrap().message).collect::<Vec<_>>(), [next]);
        }
    }
}

#[test]
fn a_frame_ends_at_its_own_end_mark() {
    // 03h and the checksum stand in the data, where an end mark of a shorter message would have them.
    let shorter = start(&[0x0346, 0x55, 0, 0]);
    // And after it, where a longer message would have them.
    let first = start(&[1, 2, 3, 4]);
    let sum = *wire(first, Framing::DEFAULT).last().unwrap();
    let longer = [first, motion(3, sum.into(), None)];
    for messages in [&[shorter][..], &longer] {
        let stream: Vec<u8> = messages.iter().flat_map(|message| wire(*message, Framing::DEFAULT)).collect();
        let read = items(Framing::DEFAULT, &stream).into_iter().map(|item| item.unwrap().message);
        assert_eq!(read.collect::<Vec<_>>(), messages);
    }
}
