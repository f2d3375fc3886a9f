//! The borders: JSON that is no message, places of errors, codecs at the end of a stream, getters and defaults.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

use core::time::Duration;

use bytes::BytesMut;
use tokio_util::codec::Decoder as _;
use val2_alter::viewer::{PosePacket, ViewerError};
use val2_alter::{
    Codec, Controller, ControllerConfig, DecodeError, Decoder, EncodeError, End, ErrorCode, Exception, Frame,
    Framing, Host, HostConfig, HostMessage, LeadingDle, Limiter, Limits, List, Message, Mode, Motion, Pose,
    Received, Reply, RobotMessage, Start, Transform, timing,
};

#[test]
fn json_without_a_field_names_it() {
    let motion =
        r#"{"kind":"motion","phase":"running","error":0,"segment_status":2,"segment":1,"percent":8192}"#;
    for (json, field) in [
        (r#"{"kind":"start","data":[]}"#.to_string(), "mode"),
        (r#"{"kind":"start","mode":23}"#.to_string(), "data"),
        (r#"{"kind":"end"}"#.to_string(), "error"),
        (motion.replace(r#""phase":"running","#, ""), "phase"),
        (motion.replace(r#""error":0,"#, ""), "error"),
        (motion.replace(r#""segment_status":2,"#, ""), "segment_status"),
        (motion.replace(r#""segment":1,"#, ""), "segment"),
        (motion.replace(r#","percent":8192"#, ""), "percent"),
    ] {
        let error = serde_json::from_str::<RobotMessage>(&json).unwrap_err().to_string();
        assert_eq!(error, format!("missing field `{field}`"), "{json}");
    }
    assert!(matches!(serde_json::from_str(motion).unwrap(), RobotMessage::Motion(Motion { segment: 1, .. })));
}

#[test]
fn json_of_another_shape_says_what_is_wrong() {
    let robot = |json: &str| serde_json::from_str::<RobotMessage>(json).unwrap_err().to_string();
    assert!(robot(r#"{"kind":"end","error":8}"#).starts_with("an error code has three bits"));
    let words = ["0"; List::MAX + 1].join(",");
    let long = robot(&format!(r#"{{"kind":"start","mode":23,"data":[{words}]}}"#));
    assert!(long.starts_with("invalid length 15, expected up to 14 words"), "{long}");
    let none = robot(r#"{"kind":"start","mode":23,"data":7}"#);
    assert!(none.starts_with("invalid type: integer `7`, expected up to 14 words"), "{none}");
    assert!(
        robot(r#"{"kind":"start","mode":23,"data":[40000]}"#)
            .starts_with("invalid value: integer `40000`, expected i16")
    );
    assert!(robot("7").starts_with("invalid type: integer `7`"));
    let host = |json: &str| serde_json::from_str::<HostMessage>(json).unwrap_err().to_string();
    let rule = "a start_reply has exactly `reply`, a reply exactly `exception` and `values`";
    assert!(host(r#"{"kind":"reply","exception":0}"#).starts_with(rule));
    assert!(host(r#"{"kind":"start_reply","reply":"accept","exception":0}"#).starts_with(rule));
    assert!(host("7").starts_with("invalid type: integer `7`"));
}

#[test]
fn a_start_mark_has_one_or_two_leading_dles_in_json_too() {
    for (leading, count) in [(LeadingDle::One, 1u8), (LeadingDle::Two, 2)] {
        assert_eq!(serde_json::to_string(&leading).unwrap(), count.to_string());
        assert_eq!(serde_json::from_str::<LeadingDle>(&count.to_string()).unwrap(), leading);
        assert_eq!((u8::from(leading), leading.count()), (count, usize::from(count)));
    }
    let error = serde_json::from_str::<LeadingDle>("3").unwrap_err();
    assert!(error.to_string().starts_with("a start mark has one or two leading DLEs"), "{error}");
}

#[test]
fn every_error_knows_its_place_and_its_code() {
    let offset = 7;
    for (error, code) in [
        (DecodeError::StartMark { offset, length: 2 }, ErrorCode::Mark),
        (DecodeError::EndMark { offset, found: 1 }, ErrorCode::Mark),
        (DecodeError::Checksum { offset, expected: 1, found: 2 }, ErrorCode::Checksum),
        (DecodeError::TooLong { offset, limit: 30 }, ErrorCode::Overflow),
        (DecodeError::Incomplete { offset, length: 3 }, ErrorCode::Incomplete),
        (DecodeError::Control { offset, found: 0 }, ErrorCode::Format),
        (DecodeError::Length { offset, found: 4 }, ErrorCode::Format),
        (DecodeError::StartReply { offset, found: 2 }, ErrorCode::Format),
        (DecodeError::Select { offset, found: 0xC0 }, ErrorCode::Format),
        (DecodeError::ReplyLength { offset, expected: 4, found: 3 }, ErrorCode::Format),
    ] {
        assert_eq!((error.offset(), error.code()), (7, code), "{error}");
    }
}

#[test]
fn bytes_that_begin_with_no_mark_are_told_by_the_frame_itself() {
    assert_eq!(
        Frame::decode(&[0x02, 0x10], Framing::DEFAULT),
        Err(DecodeError::StartMark { offset: 0, length: 2 })
    );
    // One DLE is enough where the framing says so.
    let one = Framing { leading_dle: LeadingDle::One, ..Framing::DEFAULT };
    let bytes = [0x10, 0x02, 0xE0, 0x10, 0x03, 0xE0];
    assert_eq!(Frame::decode(&bytes, Framing::DEFAULT), Err(DecodeError::StartMark { offset: 0, length: 6 }));
    let (frame, used) = Frame::decode(&bytes, one).unwrap().unwrap();
    assert_eq!((frame, used), (Frame::new(&[0xE0]).unwrap(), 6));
}

#[test]
fn the_longest_frame_has_every_byte_doubled() {
    let all = Framing { stuffed_checksum: true, ..Framing::DEFAULT };
    // 30 times 10h are E0h: the checksum is doubled only when it is a DLE itself.
    let longest = Frame::new(&[0x10; 30]).unwrap();
    assert_eq!((Frame::MAX_DATA, Frame::MAX_LEN, longest.encoded_len(all)), (30, 67, 66));
    let eleven = Frame::new(&[0x10; 17]).unwrap();
    assert_eq!((eleven.checksum(all), eleven.encoded_len(all)), (0x10, 3 + 34 + 2 + 2));
    let mut out = [0; 41];
    assert_eq!(eleven.encode(all, &mut out), Ok(41));
    assert_eq!(out[36..], [0x10, 0x10, 0x03, 0x10, 0x10][..]);
    assert_eq!(Frame::decode(&out, all), Ok(Some((eleven, 41))));
    assert_eq!(Frame::decode(&out[..40], all), Ok(None), "the second half of the checksum");
    out[40] = 0x11;
    assert_eq!(Frame::decode(&out, all), Err(DecodeError::EndMark { offset: 40, found: 0x11 }));
    assert_eq!(Frame::new(&[0; 31]), Err(EncodeError::TooLong { found: 31, limit: 30 }));
    let short = EncodeError::BufferTooSmall { needed: 41, available: 40 };
    assert_eq!(eleven.encode(all, &mut [0; 40]), Err(short));
    assert_eq!(Host::MAX_TRANSMIT, 34);
}

#[test]
fn a_codec_gives_what_is_whole_before_it_gives_up_the_rest() {
    let end = RobotMessage::End(End { error: ErrorCode::None });
    let mut wire = BytesMut::new();
    end.append_to(Framing::DEFAULT, &mut wire);
    wire.extend_from_slice(&[0x10, 0x10, 0x02]);
    let mut codec = Codec::<RobotMessage>::new(Framing::DEFAULT);
    let mut next = || codec.decode_eof(&mut wire).unwrap();
    assert_eq!(next(), Some(Ok(Received { offset: 0, length: 7, message: end })));
    assert_eq!(next(), Some(Err(DecodeError::Incomplete { offset: 7, length: 3 })));
    assert_eq!(next(), None);
}

#[test]
fn what_was_set_is_what_is_read() {
    let config = ControllerConfig { mode: Mode::CUMULATIVE_23, ..ControllerConfig::default() };
    let mut controller = Controller::new(config);
    assert_eq!(controller.config().mode, Mode::CUMULATIVE_23);
    let mut path = Pose::default();
    assert_eq!(path, Pose::IDENTITY);
    path.p = [100.0, 0.0, -50.0];
    controller.set_path(path);
    assert_eq!(controller.pose(), path, "without values the tool is on its path");
    let host = Host::new(HostConfig::default());
    assert_eq!(host.mode(), Mode::default(), "none was started");
    assert_eq!(Limits::default(), Limits::GENTLE);
    assert_eq!(*Limiter::new(Limits::default()).limits(), Limits::GENTLE);
    let reply = Reply::all([1, -2, 3, -4, 5, -6]);
    assert_eq!((reply.exception, reply.select()), (Exception::None, 0x3F));
    assert_eq!(reply.values, [Some(1), Some(-2), Some(3), Some(-4), Some(5), Some(-6)]);
    let start = Start::new(Mode(23), List::new(&[1, -2]).unwrap());
    assert_eq!(format!("{:?}", start.data), "[1, -2]");
    assert_eq!(timing::max_reply_len(7, Framing::DEFAULT), timing::max_reply_len(6, Framing::DEFAULT));
    assert_eq!(timing::transmission(48, 38_400), Duration::from_micros(12_500));
}

#[test]
fn each_part_of_a_pose_line_is_checked_in_its_place() {
    let mut line = [0; PosePacket::MAX_LEN];
    let packet = PosePacket { count: 65_535, pose: Transform([-32_768; 12]) };
    let length = packet.encode(&mut line).unwrap();
    assert_eq!(length, PosePacket::MAX_LEN, "the longest line there is");
    assert_eq!(PosePacket::decode(&line), Ok(Some((packet, length))));
    let with = |at: usize, byte: u8| {
        let mut line = line;
        line[at] = byte;
        PosePacket::decode(&line)
    };
    let star = length - 5;
    assert_eq!(with(star, b'+'), Err(ViewerError::Format { offset: star }));
    assert_eq!(with(star + 1, b'g'), Err(ViewerError::Format { offset: star + 1 }));
    assert_eq!(with(star + 2, b'G'), Err(ViewerError::Format { offset: star + 2 }));
    assert_eq!(with(star + 3, b' '), Err(ViewerError::Format { offset: star + 3 }));
    assert_eq!(with(star + 4, b' '), Err(ViewerError::TooLong { limit: PosePacket::MAX_LEN }));
    assert_eq!(with(6, b'7'), Err(ViewerError::Number { offset: 6 }), "75535 packets");
}

#[test]
fn what_is_cleared_is_forgotten_and_offsets_count_on() {
    let end = RobotMessage::End(End { error: ErrorCode::None });
    let mut bytes = [0; Frame::MAX_LEN];
    let length = end.encode(Framing::DEFAULT, &mut bytes).unwrap();
    let mut decoder = Decoder::<RobotMessage>::new(Framing::DEFAULT);
    assert_eq!(decoder.push(&bytes[..5]), 5);
    assert_eq!((decoder.next_frame(), decoder.pending()), (None, 5));
    decoder.clear();
    assert_eq!((decoder.next_frame(), decoder.pending()), (None, 0));
    assert_eq!(decoder.push(&bytes[..length]), length);
    assert_eq!(decoder.next_frame(), Some(Ok(Received { offset: 5, length, message: end })));
    assert_eq!(decoder.pending(), 0);
}

#[test]
fn a_checksum_of_dle_may_begin_the_next_frame_unless_it_is_doubled() {
    // A0h and 70h make 110h.
    let message = RobotMessage::Start(Start::new(Mode(0x70), List::EMPTY));
    for (stuffed_checksum, length, pending) in [(false, 8, 1), (true, 9, 0)] {
        let framing = Framing { stuffed_checksum, ..Framing::DEFAULT };
        let mut bytes = [0; Frame::MAX_LEN];
        assert_eq!(message.encode(framing, &mut bytes), Ok(length));
        assert_eq!(bytes[length - 1], 0x10);
        let mut decoder = Decoder::new(framing);
        decoder.push(&bytes[..length]);
        assert_eq!(decoder.next_frame(), Some(Ok(Received { offset: 0, length, message })));
        assert_eq!(decoder.pending(), pending);
        assert_eq!(decoder.next_frame(), None);
    }
}
