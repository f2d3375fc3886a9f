//! Edge cases: JSON that is not a message, texts of errors and codes, poses of which only one side has axes.

use bytes::BytesMut;
use mmacell_proto::robot_session::Decoder as _;
use mmacell_proto::robot_session::Encode as _;
use mmacell_proto::robot_session::tokio::Codec;
use mmacell_proto::{
    AnyPose, CentralConfig, Command, DecodeError, Decoder, DeviceConfig, Dialect, EncodeError, ErrorCode,
    Expected, Line, Mode, NoPose, PlatformPose, Pose, Reply, RobotPose, Status,
};
use tokio_util::codec::{Decoder as _, Encoder as _};

#[test]
fn json_without_a_field_names_it() {
    for (json, field) in [
        (r#"{"command":"SRV"}"#, "on"),
        (r#"{"command":"OVR"}"#, "percent"),
        (r#"{"command":"MOV","axes":[0,0]}"#, "mode"),
        (r#"{"command":"MOV","mode":"absolute"}"#, "axes"),
        (r#"{"command":"ACQ"}"#, "camera"),
        (r#"{"command":"HND","open":true}"#, "gripper"),
        (r#"{"command":"HND","gripper":1}"#, "open"),
    ] {
        let error = serde_json::from_str::<Command<AnyPose>>(json).unwrap_err();
        assert_eq!(error.to_string(), format!("missing field `{field}`"), "{json}");
    }
    for (json, field) in [
        (r#"{"reply":"error"}"#, "error"),
        (r#"{"reply":"status","axes":[0,0],"servo":true,"override":1,"error":0}"#, "moving"),
        (r#"{"reply":"status","moving":true,"servo":true,"override":1,"error":0}"#, "axes"),
        (r#"{"reply":"status","moving":true,"axes":[0,0],"override":1,"error":0}"#, "servo"),
        (r#"{"reply":"status","moving":true,"axes":[0,0],"servo":true,"error":0}"#, "override"),
        (r#"{"reply":"status","moving":true,"axes":[0,0],"servo":true,"override":1}"#, "error"),
    ] {
        let error = serde_json::from_str::<Reply<AnyPose>>(json).unwrap_err();
        assert_eq!(error.to_string(), format!("missing field `{field}`"), "{json}");
    }
}

#[test]
fn json_of_another_shape_says_what_it_should_be() {
    let axes = |json: &str| serde_json::from_str::<AnyPose>(json).map_err(|error| error.to_string());
    assert_eq!(axes("[0.5,-1]"), Ok(AnyPose::Platform(PlatformPose::from_units([5_000, -10_000]))));
    assert_eq!(axes("[1,2,3,4]"), Ok(AnyPose::Robot(RobotPose::from_units([1_000, 2_000, 3_000, 40_000]))));
    let wanted = "expected four axes (mm, mm, mm, rad) or two (rad, rad)";
    assert!(axes("[1,2,3]").unwrap_err().starts_with(&format!("invalid length 3, {wanted}")));
    assert!(axes("[1,2,3,4,5]").unwrap_err().starts_with(&format!("invalid length 5, {wanted}")));
    assert!(axes("7").unwrap_err().starts_with(&format!("invalid type: integer `7`, {wanted}")));
    assert!(axes(r#"[1,"2"]"#).unwrap_err().starts_with("invalid type: string \"2\", expected f64"));
    let none = serde_json::from_str::<NoPose>("[]").unwrap_err();
    assert!(none.to_string().starts_with("this device has no axes"), "{none}");
    assert!(
        serde_json::from_str::<Command<AnyPose>>("7").is_err()
            && serde_json::from_str::<Reply<AnyPose>>("7").is_err()
    );
}

#[test]
fn what_is_expected_reads_as_a_phrase() {
    for (expected, phrase) in [
        (Expected::Command, "a command"),
        (Expected::Reply, "OK or ER"),
        (Expected::Sign, "+ or -"),
        (Expected::Digit, "a digit"),
        (Expected::Point, "a decimal point"),
        (Expected::TrueOrFalse, "T or F"),
        (Expected::AbsoluteOrRelative, "A or R"),
        (Expected::OnOrOff, "ON or OF"),
        (Expected::OpenOrClose, "OPEN or CLOSE"),
        (Expected::NoAxes, "no axis"),
    ] {
        assert_eq!(expected.to_string(), phrase);
    }
    for (number, phrase) in [
        (0, "no error"),
        (1, "generic error (1)"),
        (2, "error of servo motor 1 (2)"),
        (3, "error of servo motor 2 (3)"),
        (-4, "error -4"),
    ] {
        assert_eq!(
            (ErrorCode::from(number).to_string(), i32::from(ErrorCode::from(number))),
            (phrase.into(), number)
        );
    }
}

#[test]
fn poses_add_and_compare_within_their_kind() {
    let robot = |units| AnyPose::Robot(RobotPose::from_units(units));
    let platform = |units| AnyPose::Platform(PlatformPose::from_units(units));
    assert_eq!(robot([1, 2, 3, 4]).plus(robot([10, 20, 30, -40])), Some(robot([11, 22, 33, -36])));
    assert_eq!(platform([999_998, 0]).plus(platform([1, -999_999])), Some(platform([999_999, -999_999])));
    assert_eq!(platform([999_998, 0]).plus(platform([2, 0])), None, "beyond the field");
    assert_eq!(robot([i32::MAX, 0, 0, 0]).plus(robot([1, 0, 0, 0])), None);
    assert_eq!((robot([0; 4]).plus(platform([0; 2])), platform([0; 2]).plus(robot([0; 4]))), (None, None));
    assert!(robot([999_999, 0, 0, 0]).has_form() && platform([0, -999_999]).has_form());
    assert!(!robot([1_000_000, 0, 0, 0]).has_form() && !platform([0, -1_000_000]).has_form());
    assert!(robot([0, 0, 0, 5]).is_near(robot([0, 0, 0, 2]), 3));
    assert!(!robot([0, 0, 0, 5]).is_near(robot([0, 0, 0, 1]), 3));
    assert!(
        platform([-2, 0]).is_near(platform([1, 0]), 3) && !platform([-2, 0]).is_near(platform([2, 0]), 3)
    );
    assert!(
        !robot([0; 4]).is_near(platform([0; 2]), u32::MAX) && !platform([0; 2]).is_near(robot([0; 4]), 9)
    );
}

#[test]
fn each_field_is_refused_where_it_goes_wrong() {
    let command = |line: &[u8]| Command::<RobotPose>::decode(Line::new(line), &Dialect::STRICT);
    let short = |offset, expected| Err(DecodeError::Short { offset, expected });
    assert_eq!(command(b"MOV"), short(3, Expected::AbsoluteOrRelative));
    let found =
        Err(DecodeError::Unexpected { offset: 3, found: b'B', expected: Expected::AbsoluteOrRelative });
    assert_eq!(command(b"MOVB"), found);
    let reply = |line: &[u8]| Reply::<PlatformPose>::decode(Line::new(line), &Dialect::STRICT);
    assert_eq!(
        reply(b"OKT+00.5000-00.2500"),
        Err(DecodeError::Short { offset: 19, expected: Expected::TrueOrFalse })
    );
    assert_eq!(
        reply(b"OKX"),
        Err(DecodeError::Unexpected { offset: 2, found: b'X', expected: Expected::TrueOrFalse })
    );
    let tolerant = Dialect { ovrd: true, ..Dialect::STRICT };
    assert_eq!(
        Command::<RobotPose>::decode(Line::new(b"OVRD+00007"), &tolerant),
        Ok(Command::Override { percent: 7 })
    );
}

#[test]
fn a_word_is_cut_short_or_another_or_goes_on() {
    let command = |line: &[u8]| Command::<NoPose>::decode(Line::new(line), &Dialect::STRICT);
    let expected = Expected::OnOrOff;
    assert_eq!(command(b"SRV"), Err(DecodeError::Short { offset: 3, expected }));
    assert_eq!(command(b"SRVO"), Err(DecodeError::Short { offset: 4, expected }));
    assert_eq!(command(b"SRVX"), Err(DecodeError::Unexpected { offset: 3, found: b'X', expected }));
    assert_eq!(command(b"SRVONX"), Err(DecodeError::Trailing { offset: 5 }));
    assert_eq!(command(b"SRVOFF"), Err(DecodeError::Trailing { offset: 5 }));
    assert_eq!(command(b"SRVON"), Ok(Command::Servo { on: true }));
}

/// A character that does not fit is found in either number, even if its bits would make a small value, and in both at
/// once.
#[test]
fn each_character_of_the_numbers_that_end_a_status_counts() {
    let reply = |numbers: &[u8]| {
        let line = [b"OKF+00.5000-00.2500T", numbers].concat();
        Reply::<PlatformPose>::decode(Line::new(&line), &Dialect::STRICT).map(drop)
    };
    let unexpected = |offset, found, expected| Err(DecodeError::Unexpected { offset, found, expected });
    assert_eq!(reply(b"+00100+00003"), Ok(()));
    assert_eq!(reply(b",00080+00000"), unexpected(20, b',', Expected::Sign));
    assert_eq!(reply(b"+00080,00000"), unexpected(26, b',', Expected::Sign));
    assert_eq!(reply(b",00080,00000"), unexpected(20, b',', Expected::Sign));
    assert_eq!(reply(b"+000:0+00000"), unexpected(24, b':', Expected::Digit));
    assert_eq!(reply(b"+00101+00000"), Err(DecodeError::Percent { offset: 20, found: 101 }));
    assert_eq!(reply(b"-00001+00000"), Err(DecodeError::Percent { offset: 20, found: -1 }));
    assert_eq!(reply(b"+00080+00000F"), Err(DecodeError::Trailing { offset: 32 }));
    for byte in 0..=0xFF {
        assert!(reply(&[&b"+00080"[..], &[byte; 6]].concat()).is_err(), "{byte:02X}");
    }
}

#[test]
fn a_blank_is_allowed_once_after_the_sign_of_an_integer_where_the_dialect_says_so() {
    let blank = Dialect { blank: true, ..Dialect::STRICT };
    let command = |line: &[u8], dialect| Command::<PlatformPose>::decode(Line::new(line), dialect);
    let unexpected = |offset, found, expected| Err(DecodeError::Unexpected { offset, found, expected });
    assert_eq!(command(b"ACQ- 00001", &blank), Ok(Command::Acquire { camera: -1 }));
    assert_eq!(command(b"ACQ- 00001", &Dialect::STRICT), unexpected(4, b' ', Expected::Digit));
    assert_eq!(command(b"ACQ+ 00x01", &blank), unexpected(7, b'x', Expected::Digit));
    assert_eq!(command(b"ACQ+  0001", &blank), unexpected(5, b' ', Expected::Digit));
    assert_eq!(command(b"ACQ+ 000012", &blank), Err(DecodeError::Trailing { offset: 10 }));
    assert_eq!(
        command(b"ACQ+ 0000", &blank),
        Err(DecodeError::Short { offset: 9, expected: Expected::Digit })
    );
    assert_eq!(command(b"MOVA+ 0.5000-00.2500", &blank), unexpected(5, b' ', Expected::Digit));
}

#[test]
fn an_axis_is_written_to_the_last_of_its_digits() {
    let mut out = [0; 38];
    let pose = RobotPose::from_units([999_999, -999_999, 0, -1]);
    assert_eq!(Command::Move { mode: Mode::Relative, pose }.encode(&mut out), Ok(38));
    assert_eq!(&out, b"MOVR+999.999-999.999+000.000-00.0001\r\n");
}

#[test]
fn what_does_not_fit_its_field_is_not_written() {
    let status = Status {
        moving: true,
        pose: PlatformPose::ORIGIN,
        servo: false,
        percent: 100,
        error: ErrorCode::None,
    };
    let mut out = [0; 50];
    let mut refused = |reply: Reply<PlatformPose>| reply.encode(&mut out).unwrap_err().to_string();
    assert_eq!(
        refused(Reply::Status(Status { percent: 101, ..status })),
        "the override 101 % is above 100 %"
    );
    let wide = refused(Reply::Status(Status { error: ErrorCode::Other(32_768), ..status }));
    assert_eq!(wide, "the integer 32768 does not fit its field");
    assert_eq!(wide, refused(Reply::Error { error: ErrorCode::Other(32_768) }));
    let mut grip = [0; 16];
    let grip = Command::<NoPose>::Grip { gripper: -32_769, open: true }.encode(&mut grip).unwrap_err();
    assert_eq!(grip.to_string(), "the integer -32769 does not fit its field");
    for (room, outcome) in [(33, Err(EncodeError::Buffer { needed: 34, found: 33 })), (34, Ok(()))] {
        let mut buffer = [0; 34];
        assert_eq!(Reply::Status(status).append_to(&mut &mut buffer[..room]), outcome);
        let mut buffer = [0; 34];
        let servo = Command::<NoPose>::Servo { on: false }.append_to(&mut &mut buffer[..room - 27]);
        assert_eq!(
            (servo, &buffer[..5] == b"SRVOF"),
            match room {
                33 => (Err(EncodeError::Buffer { needed: 7, found: 6 }), false),
                _ => (Ok(()), true),
            }
        );
    }
    assert_eq!(
        Reply::Status(Status { percent: 101, ..status })
            .append_to(&mut BytesMut::new())
            .unwrap_err()
            .to_string(),
        "the override 101 % is above 100 %"
    );
}

#[test]
fn a_codec_reads_on_after_corrupt_lines_and_to_the_end_of_the_stream() {
    let dialect = Dialect::STRICT;
    let mut central =
        Codec::new(Decoder::new(dialect), |line: Line<'_>| Reply::<PlatformPose>::decode(line, &dialect));
    let mut device =
        Codec::new(Decoder::new(dialect), |line: Line<'_>| Command::<PlatformPose>::decode(line, &dialect));
    let mut wire = BytesMut::new();
    central.encode(Command::<PlatformPose>::Status, &mut wire).unwrap();
    wire.extend_from_slice(b"what?\r\n");
    central.encode(Command::<PlatformPose>::Stop, &mut wire).unwrap();
    wire.extend_from_slice(b"ST");
    let read: Vec<_> = core::iter::from_fn(|| device.decode_eof(&mut wire).unwrap()).take(9).collect();
    let unknown = DecodeError::UnknownCommand { found: *b"wha" };
    let expected =
        [Ok(Ok(Command::Status)), Ok(Err(unknown)), Ok(Ok(Command::Stop)), Err(DecodeError::Incomplete)];
    assert_eq!(read, expected);
    device.encode(Reply::<PlatformPose>::Ok, &mut wire).unwrap();
    assert_eq!(central.decode(&mut wire).unwrap(), Some(Ok(Ok(Reply::Ok))));
    assert_eq!(central.decode(&mut wire).unwrap(), None);
    let refused = central.encode(Command::<PlatformPose>::Override { percent: 101 }, &mut wire).unwrap_err();
    assert_eq!(refused.to_string(), "the override 101 % is above 100 %");
    assert!(wire.is_empty());
}

#[test]
fn the_defaults_are_the_documented_ones() {
    assert_eq!(CentralConfig::default(), CentralConfig::DEFAULT);
    assert_eq!(DeviceConfig::default(), DeviceConfig::DEFAULT);
}

#[test]
fn what_has_no_end_when_the_stream_ends_is_an_error_also_if_nobody_has_looked_at_it() {
    for held in [&b"S"[..], b"ST", b"\r", b"\n"] {
        let mut decoder = Decoder::new(Dialect::STRICT);
        assert_eq!(decoder.push(held), held.len());
        decoder.finish();
        assert_eq!(decoder.next_frame(), Some(Err(DecodeError::Incomplete)), "{}", held.escape_ascii());
        assert_eq!((decoder.position(), decoder.next_frame()), (held.len() as u64, None));
    }
}

#[test]
fn what_ended_is_reported_before_more_is_taken() {
    let mut decoder = Decoder::new(Dialect::STRICT);
    assert_eq!(decoder.push(b"ST"), 2);
    decoder.finish();
    assert_eq!(decoder.push(b"A\r\n"), 0);
    assert_eq!(decoder.next_frame(), Some(Err(DecodeError::Incomplete)));
    assert_eq!(decoder.push(b"STA\r\n"), 5);
    assert_eq!(decoder.next_frame(), Some(Ok(Line::new(b"STA"))));
    assert_eq!(decoder.push(b"ST"), 2);
    decoder.clear();
    assert_eq!((decoder.position(), decoder.next_frame()), (9, None));
}

#[test]
fn sixteen_ends_in_a_row_are_sixteen_lines() {
    let mut decoder = Decoder::new(Dialect { lone_lf: true, ..Dialect::STRICT });
    assert_eq!(decoder.push(b"\n\n\n\n\n\n\n\n\n\n\n\n\n\n\n\nSTA\r\n"), 21);
    for _ in 0..16 {
        assert_eq!(decoder.next_frame(), Some(Ok(Line::new(b""))));
    }
    assert_eq!(decoder.next_frame(), Some(Ok(Line::new(b"STA"))));
    assert_eq!(decoder.next_frame(), None);
}

#[test]
fn an_end_that_is_cut_in_two_ends_a_line_that_is_too_long() {
    let mut decoder = Decoder::new(Dialect::STRICT);
    assert_eq!(decoder.push(&[&[b'x'; 63][..], b"\r"].concat()), 64);
    assert_eq!(decoder.next_frame(), None);
    assert_eq!(decoder.push(b"\nSTA\r\n"), 6);
    assert_eq!(decoder.next_frame(), Some(Err(DecodeError::TooLong { limit: 64 })));
    assert_eq!(decoder.position(), 65);
    assert_eq!(decoder.next_frame(), Some(Ok(Line::new(b"STA"))));
}
