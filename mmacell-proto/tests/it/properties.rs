//! Properties of the codec over generated messages and bytes.

use core::fmt::Debug;

use arbitrary::Arbitrary;
use mmacell_proto::robot_session::Decoder as _;
use mmacell_proto::robot_session::Encode as _;
use mmacell_proto::{
    Angle, AnyPose, Command, DecodeError, Decoder, Dialect, EncodeError, ErrorCode, Length, Line, Mode,
    NoPose, PlatformPose, Pose, Reply, RobotPose, Status,
};
use proptest::collection::vec;
use proptest::prelude::*;

use crate::arbitrary::arbitrary;

/// Returns messages of uniform bytes, as many as the longest message needs.
fn messages<M: for<'a> Arbitrary<'a> + Debug>() -> impl Strategy<Value = M> {
    arbitrary(vec(any::<u8>(), 32))
}

/// Returns the lines of a stream split at these offsets.
fn lines(stream: &[u8], cuts: &[prop::sample::Index], dialect: Dialect) -> Vec<Result<Vec<u8>, DecodeError>> {
    let mut places: Vec<_> = cuts.iter().map(|cut| cut.index(stream.len() + 1)).collect();
    places.extend([0, stream.len()]);
    places.sort_unstable();
    let mut decoder = Decoder::new(dialect);
    let mut lines = Vec::new();
    for piece in places.windows(2) {
        let mut rest = &stream[piece[0]..piece[1]];
        while !rest.is_empty() {
            let taken = decoder.push(rest);
            assert!(taken > 0);
            rest = &rest[taken..];
            while let Some(line) = decoder.next_frame() {
                lines.push(line.map(|line| line.content().to_vec()));
            }
        }
    }
    lines
}

/// Returns almost valid messages: a message with a few bytes changed.
fn corrupt() -> impl Strategy<Value = Vec<u8>> {
    let message = prop_oneof![
        messages::<Command<AnyPose>>().prop_map(|c| {
            let mut bytes = vec![0; c.encoded_len()];
            c.encode(&mut bytes).unwrap();
            bytes
        }),
        messages::<Reply<AnyPose>>().prop_map(|r| {
            let mut bytes = vec![0; r.encoded_len()];
            r.encode(&mut bytes).unwrap();
            bytes
        }),
    ];
    let character = prop::sample::select(&b"+-0123456789. TFAROKENDSHCLP\r\n\0\xFF"[..]);
    (message, vec((any::<prop::sample::Index>(), character, 0..3u8), 0..4)).prop_map(
        |(mut bytes, corruption)| {
            for (at, byte, how) in corruption {
                let at = at.index(bytes.len());
                match how {
                    0 => bytes[at] = byte,
                    1 => bytes.insert(at, byte),
                    _ if bytes.len() > 1 => drop(bytes.remove(at)),
                    _ => {}
                }
            }
            bytes
        },
    )
}

proptest! {
    #[test]
    fn a_command_survives_the_wire(command in messages::<Command<AnyPose>>()) {
        let mut buffer = [0xAA; 38];
        let len = command.encode(&mut buffer).unwrap();
        prop_assert_eq!(len, command.encoded_len());
        prop_assert!(buffer[len..].iter().all(|b| *b == 0xAA));
        for dialect in [Dialect::STRICT, Dialect::TOLERANT] {
            let (line, used) = Line::decode(&buffer, &dialect).unwrap().unwrap();
            prop_assert_eq!(used, len);
            prop_assert_eq!(Command::decode(line, &dialect), Ok(command));
        }
    }

    /// A message is read by the dialect that wrote it, and by one that accepts every reading; its length is as
    /// announced.
    #[test]
    fn a_message_survives_any_dialect(command in messages::<Command<AnyPose>>(), reply in messages::<Reply<AnyPose>>(), dialect in messages::<Dialect>(), wide in -99_999..=99_999i32) {
        let grip = Command::<AnyPose>::Acquire { camera: wide };
        let mut buffer = [0xAA; 52];
        for command in [command, grip] {
            let written = command.in_dialect(dialect);
            let Ok(len) = written.encode(&mut buffer) else {
                prop_assert!(!dialect.wide_integers && i16::try_from(wide).is_err());
                continue;
            };
            prop_assert_eq!(len, written.encoded_len());
            let short = Err(EncodeError::Buffer { needed: len, found: len - 1 });
            prop_assert_eq!(written.encode(&mut { buffer }[..len - 1]), short);
            for dialect in [dialect, Dialect { lone_lf: dialect.lone_lf, ..Dialect::TOLERANT }] {
                let (line, used) = Line::decode(&buffer[..len], &dialect).unwrap().unwrap();
                prop_assert_eq!((used, Command::decode(line, &dialect)), (len, Ok(command)));
            }
        }
        let written = reply.in_dialect(dialect);
        let len = written.encode(&mut buffer).unwrap();
        prop_assert_eq!(len, written.encoded_len());
        let (line, used) = Line::decode(&buffer[..len], &dialect).unwrap().unwrap();
        prop_assert_eq!((used, Reply::decode(line, &dialect)), (len, Ok(reply)));
        let mut appended = Vec::new();
        written.append_to(&mut appended).unwrap();
        prop_assert_eq!(appended, &buffer[..len]);
    }

    #[test]
    fn a_reply_survives_the_wire(robot in messages::<Reply<RobotPose>>(), platform in messages::<Reply<PlatformPose>>()) {
        let mut buffer = [0xAA; 50];
        for dialect in [Dialect::STRICT, Dialect::TOLERANT] {
            let len = robot.encode(&mut buffer).unwrap();
            prop_assert_eq!(len, robot.encoded_len());
            let (line, used) = Line::decode(&buffer[..len], &dialect).unwrap().unwrap();
            prop_assert_eq!(used, len);
            prop_assert_eq!(Reply::decode(line, &dialect), Ok(robot));
            let len = platform.encode(&mut buffer).unwrap();
            prop_assert_eq!(len, platform.encoded_len());
            let (line, _) = Line::decode(&buffer[..len], &dialect).unwrap().unwrap();
            prop_assert_eq!(Reply::decode(line, &dialect), Ok(platform));
        }
    }

    #[test]
    fn appending_writes_the_same_bytes(command in messages::<Command<AnyPose>>(), reply in messages::<Reply<AnyPose>>()) {
        let mut appended = Vec::new();
        command.append_to(&mut appended).unwrap();
        reply.append_to(&mut appended).unwrap();
        let mut buffer = [0; 88];
        let len = command.encode(&mut buffer).unwrap();
        let len = len + reply.encode(&mut buffer[len..]).unwrap();
        prop_assert_eq!(appended, &buffer[..len]);
        let needed = command.encoded_len();
        let error = EncodeError::Buffer { needed, found: needed - 1 };
        prop_assert_eq!(command.append_to(&mut &mut buffer[..needed - 1]), Err(error));
        let needed = reply.encoded_len();
        let error = EncodeError::Buffer { needed, found: needed - 1 };
        prop_assert_eq!(reply.append_to(&mut &mut buffer[..needed - 1]), Err(error));
    }

    #[cfg(feature = "serde")]
    #[test]
    fn a_message_survives_its_object(command in messages::<Command<AnyPose>>(), reply in messages::<Reply<AnyPose>>()) {
        let text = serde_json::to_string(&command).unwrap();
        prop_assert_eq!(serde_json::from_str::<Command<AnyPose>>(&text).unwrap(), command);
        let text = serde_json::to_string(&reply).unwrap();
        prop_assert_eq!(serde_json::from_str::<Reply<AnyPose>>(&text).unwrap(), reply);
    }

    /// An accepted line has the same meaning however it was written: its strict form decodes to it again.
    #[test]
    fn what_is_accepted_encodes_and_decodes_to_itself(bytes in corrupt(), dialect in messages::<Dialect>()) {
        let Ok(Some((line, _))) = Line::decode(&bytes, &dialect) else { return Ok(()) };
        let mut buffer = [0; 50];
        if let Ok(command) = Command::<AnyPose>::decode(line, &dialect) {
            match command.encode(&mut buffer) {
                Ok(len) => {
                    let strict = Line::new(&buffer[..len - 2]);
                    prop_assert_eq!(Command::decode(strict, &Dialect::STRICT), Ok(command));
                    if dialect == Dialect::STRICT && !line.content().contains(&b'-') {
                        prop_assert_eq!(&buffer[..len - 2], line.content());
                    }
                }
                Err(error) => {
                    let wide = matches!(error, EncodeError::IntegerRange { .. });
                    prop_assert!(wide && dialect.wide_integers, "{}", error);
                }
            }
        }
        if let Ok(reply) = Reply::<AnyPose>::decode(line, &dialect)
            && let Ok(len) = reply.encode(&mut buffer)
        {
            prop_assert_eq!(Reply::decode(Line::new(&buffer[..len - 2]), &Dialect::STRICT), Ok(reply));
        }
    }

    /// A stricter dialect never reads another message from the same line, it only refuses more.
    #[test]
    fn tolerance_changes_no_meaning(bytes in corrupt(), dialect in messages::<Dialect>()) {
        let line = Line::new(&bytes);
        if let Ok(command) = Command::<AnyPose>::decode(line, &Dialect::STRICT) {
            prop_assert_eq!(Command::decode(line, &dialect), Ok(command));
        }
        if let Ok(reply) = Reply::<RobotPose>::decode(line, &Dialect::STRICT) {
            prop_assert_eq!(Reply::decode(line, &dialect), Ok(reply));
        }
        for result in [Command::<RobotPose>::decode(line, &dialect).err(), Reply::<RobotPose>::decode(line, &dialect).err()] {
            let Some(error) = result else { continue };
            let offset = match error {
                DecodeError::Unexpected { offset, .. } | DecodeError::Trailing { offset } => offset,
                DecodeError::IntegerRange { offset, .. } | DecodeError::Percent { offset, .. } => offset,
                DecodeError::Short { offset, .. } => {
                    prop_assert_eq!(offset, bytes.len());
                    continue;
                }
                _ => continue,
            };
            prop_assert!(offset < bytes.len(), "{}", error);
        }
    }

    #[test]
    fn any_chunking_gives_the_same_lines(
        pieces in vec(prop_oneof![corrupt(), vec(any::<u8>(), 0..100)], 0..8),
        cuts in vec(any::<prop::sample::Index>(), 0..12),
        dialect in messages::<Dialect>(),
    ) {
        let stream = pieces.concat();
        prop_assert_eq!(lines(&stream, &cuts, dialect), lines(&stream, &[], dialect));
    }

    /// Corruption costs the line that it is in, and the next one when it takes the end away.
    #[test]
    fn what_follows_the_next_end_is_found(garbage in vec(any::<u8>(), 0..200), command in messages::<Command<RobotPose>>()) {
        let mut buffer = [0; 38];
        let len = command.encode(&mut buffer).unwrap();
        let stream = [&garbage[..], b"\r\n", &buffer[..len], &buffer[..len]].concat();
        let lines = lines(&stream, &[], Dialect::STRICT);
        let found: Vec<_> = lines.iter().rev().take(2).map(|l| l.as_deref()).collect();
        prop_assert_eq!(found, [Ok(&buffer[..len - 2]), Ok(&buffer[..len - 2])]);
    }

    #[test]
    fn a_buffer_that_is_too_small_is_refused(command in messages::<Command<AnyPose>>(), reply in messages::<Reply<AnyPose>>(), len in 0..50usize) {
        let mut buffer = vec![0; len];
        let needed = command.encoded_len();
        if len < needed {
            prop_assert_eq!(command.encode(&mut buffer), Err(EncodeError::Buffer { needed, found: len }));
        }
        let needed = reply.encoded_len();
        if len < needed {
            prop_assert_eq!(reply.encode(&mut buffer), Err(EncodeError::Buffer { needed, found: len }));
        }
    }

    #[test]
    fn an_axis_out_of_range_is_never_widened(axis in 0..4usize, by in 1_000_000..i32::MAX, minus: bool) {
        let mut axes = [0; 4];
        axes[axis] = if minus { -by } else { by };
        let [x, y, z] = [axes[0], axes[1], axes[2]].map(Length::from_um);
        let pose = RobotPose { x, y, z, c: Angle::from_tenths_mrad(axes[3]) };
        let command = Command::Move { mode: Mode::Absolute, pose };
        prop_assert_eq!(command.encode(&mut [0; 38]), Err(EncodeError::AxisRange { axis, found: axes[axis] }));
    }
}

#[test]
fn a_range_is_refused_with_a_clear_sentence() {
    let mut buffer = [0; 64];
    let refusal = |result: Result<usize, EncodeError>| result.unwrap_err().to_string();
    let pose = PlatformPose::from_rad(0.0, 100.0);
    assert_eq!(
        refusal(Command::Move { mode: Mode::Absolute, pose }.encode(&mut buffer)),
        "axis 1 at 1000000 is outside ±999999 (units of the last digit: 1 µm or 0.1 mrad)"
    );
    assert_eq!(
        refusal(Command::<NoPose>::Acquire { camera: 32768 }.encode(&mut buffer)),
        "the integer 32768 does not fit its field"
    );
    assert_eq!(
        refusal(Command::<NoPose>::Override { percent: 101 }.encode(&mut buffer)),
        "the override 101 % is above 100 %"
    );
    for error in [ErrorCode::None, ErrorCode::Other(0)] {
        assert_eq!(
            refusal(Reply::<NoPose>::Error { error }.encode(&mut buffer)),
            "an error reply needs a number other than 0"
        );
    }
    assert_eq!(
        refusal(Command::<NoPose>::Status.encode(&mut buffer[..4])),
        "5 bytes are needed, the buffer has 4"
    );
}

#[test]
fn a_decode_error_reads_as_one_clear_sentence() {
    let command = |line: &[u8]| {
        Command::<PlatformPose>::decode(Line::new(line), &Dialect::STRICT).unwrap_err().to_string()
    };
    assert_eq!(command(b"P\n\xFF"), r#"there is no command "P\n\xff""#);
    assert_eq!(command(b"MOVA+00.5"), "the line ends at byte 9, where a digit is expected");
    assert_eq!(command(b"MOVA+00,5000-00.2500"), "',' at byte 7, where a decimal point is expected");
    assert_eq!(command(b"STPP"), "expected the end of the line at byte 3");
    assert_eq!(command(b"ACQ+40000"), "the integer 40000 at byte 3 is outside −32768 to 32767");
    assert_eq!(command(b"OVR+00101"), "the override 101 % at byte 3 is outside 0 to 100 %");
    let reply =
        |line: &[u8]| Reply::<NoPose>::decode(Line::new(line), &Dialect::STRICT).unwrap_err().to_string();
    assert_eq!(reply(b"QoK"), r#"a reply begins with OK or ER, not with "Qo""#);
    assert_eq!(reply(b"ER+00000"), "an error reply with the number 0, which means no error");
    assert_eq!(reply(b"OKFT"), "'T' at byte 3, where no axis is expected");
}

/// The lengths that the source prints for each message, its end included (§4.1 to §4.10).
#[test]
fn the_lengths_of_the_source_hold() {
    let pose = RobotPose::from_mm_rad(10.0, -2.0, 5.999, -1.2322);
    let platform = PlatformPose::from_rad(0.5, -0.25);
    let mode = Mode::Absolute;
    let commands = [
        (Command::Status, 5),
        (Command::Servo { on: true }, 7),
        (Command::Servo { on: false }, 7),
        (Command::Override { percent: 50 }, 11),
        (Command::Move { mode, pose }, 38),
        (Command::Stop, 5),
        (Command::Reset, 5),
        (Command::Close, 5),
        (Command::Acquire { camera: 1 }, 11),
        (Command::Grip { gripper: 0, open: true }, 15),
        // The source says 15; its own fields, 3 + 6 + 5 + 2, are 16.
        (Command::Grip { gripper: 0, open: false }, 16),
    ];
    for (command, len) in commands {
        assert_eq!(command.encode(&mut [0; 38]), Ok(len), "{command:?}");
    }
    assert_eq!(Command::Move { mode, pose: platform }.encode(&mut [0; 38]), Ok(22));
    fn status<P>(pose: P) -> Reply<P> {
        Reply::Status(Status { moving: false, pose, servo: true, percent: 80, error: ErrorCode::None })
    }
    assert_eq!(Reply::<RobotPose>::Ok.encode(&mut [0; 50]), Ok(4));
    assert_eq!(Reply::<RobotPose>::Error { error: ErrorCode::Generic }.encode(&mut [0; 50]), Ok(10));
    assert_eq!(status(pose).encode(&mut [0; 50]), Ok(50));
    assert_eq!(status(platform).encode(&mut [0; 50]), Ok(34));
}

#[test]
fn a_sum_stays_in_the_range_of_its_field() {
    let pose = RobotPose::from_mm_rad(900.0, 0.0, 0.0, -99.0);
    let sum = pose.plus(RobotPose::from_mm_rad(99.999, 1.0, -1.0, -0.9999)).unwrap();
    assert_eq!(sum, RobotPose::from_mm_rad(999.999, 1.0, -1.0, -99.9999));
    assert_eq!(sum.plus(RobotPose::from_mm_rad(0.001, 0.0, 0.0, 0.0)), None);
    assert_eq!(sum.plus(RobotPose::from_mm_rad(0.0, 0.0, 0.0, -0.0001)), None);
    assert!(sum.is_near(RobotPose::from_mm_rad(999.999, 1.002, -1.0, -99.9999), 2));
    assert!(!sum.is_near(RobotPose::from_mm_rad(999.999, 1.003, -1.0, -99.9999), 2));
}
