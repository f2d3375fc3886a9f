//! Edge cases: JSON that is not a message, positions of errors, codecs at the end of a stream, getters and defaults.

use core::time::Duration;

use robot_session::end::{End as _, Machine as _};
use robot_session::{Decoder as _, Encode as _, Session};
use val2_alter::host::machine::{Answer, Draft, HostMachine, Input, OutputMode};
use val2_alter::{
    ConfigError, Controller, ControllerConfig, DecodeError, Decoder, EncodeError, End, ErrorCode, Exception,
    Frame, Framed, Framing, Host, HostConfig, HostMessage, LeadingDle, Limiter, Limits, List, Message, Mode,
    Motion, MotionPhase, Policy, ReceivedMessage, Reply, RobotMessage, SegmentStatus, Start, StartCode,
    timing,
};

#[test]
fn a_decoder_takes_less_than_half_a_kilobyte() {
    let size = size_of::<Decoder<RobotMessage>>();
    assert!(size < 512, "{size} bytes");
}

#[test]
fn a_reply_is_discarded_when_the_controller_has_ended_its_alter() {
    let config = HostConfig { silence_cycles: 5, ..HostConfig::default() };
    let host = Host::new(config).unwrap();
    assert_eq!(Session::discards_after(&host), Some(timing::CYCLE * 5));
}

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
fn bytes_that_begin_with_no_mark_are_reported_by_the_frame_itself() {
    assert_eq!(
        Frame::decode(&[0x02, 0x10], Framing::DEFAULT),
        Err(DecodeError::StartMark { offset: 0, length: 2 })
    );
    // One DLE is enough if the framing permits it.
    let one = Framing { leading_dle: LeadingDle::One, ..Framing::DEFAULT };
    let bytes = [0x10, 0x02, 0xE0, 0x10, 0x03, 0xE0];
    assert_eq!(Frame::decode(&bytes, Framing::DEFAULT), Err(DecodeError::StartMark { offset: 0, length: 6 }));
    let (frame, used) = Frame::decode(&bytes, one).unwrap().unwrap();
    assert_eq!((frame, used), (Frame::new(&[0xE0]).unwrap(), 6));
    // More than enough belong to it.
    for (framing, dles) in [(one, 2), (one, 3), (Framing::DEFAULT, 3)] {
        let bytes = [&[0x10; 3][..dles], &bytes[1..]].concat();
        assert_eq!(Frame::decode(&bytes, framing), Ok(Some((frame, 5 + dles))));
    }
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
    assert_eq!((<Host as Session>::MAX_TRANSMIT, HostMessage::MAX_DATA), (34, 14));
}

#[test]
fn what_is_whole_comes_before_the_rest_is_given_up() {
    let end = RobotMessage::End(End { error: ErrorCode::None });
    let mut wire = Vec::new();
    end.append_to(Framing::DEFAULT, &mut wire);
    wire.extend_from_slice(&[0x10, 0x10, 0x02]);
    let mut decoder = Decoder::<RobotMessage>::new(Framing::DEFAULT);
    assert_eq!(decoder.push(&wire), 10);
    assert_eq!(decoder.next_frame(), Some(Ok(ReceivedMessage { offset: 0, length: 7, message: end })));
    assert_eq!((decoder.next_frame(), decoder.pending()), (None, 3));
    decoder.finish();
    assert_eq!(decoder.next_frame(), Some(Err(DecodeError::Incomplete { offset: 7, length: 3 })));
    assert_eq!((decoder.next_frame(), decoder.position(), decoder.pending()), (None, 10, 0));
}

#[test]
fn a_message_in_its_envelope_writes_itself() {
    let framing = Framing { negated_sum: true, ..Framing::DEFAULT };
    let framed = Framed { message: HostMessage::StartReply(StartCode::Repeat), framing };
    let mut out = [0; 7];
    assert_eq!((framed.encoded_len(), framed.encode(&mut out)), (7, Ok(7)));
    assert_eq!(&out, b"\x10\x10\x02\x01\x10\x03\xFF");
    let short = EncodeError::BufferTooSmall { needed: 7, available: 6 };
    assert_eq!(framed.encode(&mut out[..6]), Err(short));
}

#[test]
fn what_was_set_is_what_is_read() {
    let config = ControllerConfig { mode: Mode::CUMULATIVE_23, ..ControllerConfig::default() };
    let controller = Controller::new(config).unwrap();
    assert_eq!(controller.config().mode, Mode::CUMULATIVE_23);
    let host = Host::new(HostConfig::default()).unwrap();
    assert_eq!(host.config().mode, Mode::CUMULATIVE_23);
    assert_eq!(Limits::default(), Limits::GENTLE);
    assert_eq!(*Limiter::new(Limits::default()).limits(), Limits::GENTLE);
    let reply = Reply::all([1, -2, 3, -4, 5, -6]);
    assert_eq!((reply.exception, reply.select()), (Exception::None, 0x3F));
    assert_eq!(reply.values, [Some(1), Some(-2), Some(3), Some(-4), Some(5), Some(-6)]);
    let start = Start::new(Mode(23), List::new(&[1, -2]).unwrap());
    assert_eq!(format!("{:?}", start.data), "[1, -2]");
    assert_eq!(timing::max_reply_len(7, Framing::DEFAULT), timing::max_reply_len(6, Framing::DEFAULT));
    assert_eq!(timing::transmission_time(48, 38_400), Duration::from_micros(12_500));
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
    assert_eq!(decoder.next_frame(), Some(Ok(ReceivedMessage { offset: 5, length, message: end })));
    assert_eq!(decoder.pending(), 0);
}

#[test]
fn a_checksum_of_dle_may_begin_the_next_frame_unless_it_is_doubled() {
    // A0h and 70h make 110h.
    let message = RobotMessage::Start(Start::new(Mode(0x70), List::EMPTY));
    for (stuffed_checksum, length) in [(false, 8), (true, 9)] {
        let framing = Framing { stuffed_checksum, ..Framing::DEFAULT };
        let mut bytes = [0; Frame::MAX_LEN];
        assert_eq!(message.encode(framing, &mut bytes), Ok(length));
        assert_eq!(bytes[length - 1], 0x10);
        let mut decoder = Decoder::new(framing);
        assert_eq!(decoder.push(&bytes[..length]), length);
        assert_eq!(decoder.next_frame(), Some(Ok(ReceivedMessage { offset: 0, length, message })));
        assert_eq!((decoder.next_frame(), decoder.pending(), decoder.position()), (None, 0, length as u64));
    }
}

/// The first checksum is lost: the first DLE of the next frame is read in its place.
#[test]
fn a_lost_checksum_of_dle_costs_no_frame() {
    let message = RobotMessage::Start(Start::new(Mode(0x70), List::EMPTY));
    let good = RobotMessage::End(End { error: ErrorCode::None });
    let mut stream = Vec::new();
    message.append_to(Framing::DEFAULT, &mut stream);
    stream.pop();
    good.append_to(Framing::DEFAULT, &mut stream);
    let mut decoder = Decoder::<RobotMessage>::new(Framing::DEFAULT);
    assert_eq!(decoder.push(&stream), 14);
    assert_eq!(decoder.next_frame(), Some(Ok(ReceivedMessage { offset: 0, length: 8, message })));
    assert_eq!(decoder.next_frame(), Some(Ok(ReceivedMessage { offset: 8, length: 6, message: good })));
    assert_eq!((decoder.next_frame(), decoder.position()), (None, 14));
}

fn items(stream: &[u8]) -> Vec<(Result<ReceivedMessage<RobotMessage>, DecodeError>, u64)> {
    let mut decoder = Decoder::new(Framing::DEFAULT);
    let mut items = Vec::new();
    assert_eq!(decoder.push(stream), stream.len());
    for finished in [false, true] {
        if finished {
            decoder.finish();
        }
        while let Some(item) = decoder.next_frame() {
            items.push((item, decoder.position()));
        }
    }
    items
}

/// A cut frame, and a whole one whose start mark looks like its data.
#[test]
fn messages_are_reported_where_they_are() {
    let stream = b"\x10\x10\x02\x0e\x01\x10\x10\x02\xa0\x16\x05\x00\xff\xff\x10\x03\xb9";
    let start = Start::new(Mode(22), List::new(&[5, -1]).unwrap());
    let message = RobotMessage::Start(start);
    let sum = DecodeError::Checksum { offset: 16, expected: 0xDA, found: 0xB9 };
    assert_eq!(items(stream), [(Err(sum), 5), (Ok(ReceivedMessage { offset: 5, length: 12, message }), 17)]);
}

/// DLEs before a start mark belong to its frame.
#[test]
fn offsets_count_through_the_stream() {
    let frame = b"\x10\x10\x02\xa0\x17\x10\x03\xb7";
    let stream = [&frame[..], frame, b"noise", frame, b"\x10\x10", frame].concat();
    let places: Vec<_> = items(&stream).into_iter().map(|(item, _)| item.map(|r| r.offset)).collect();
    let noise = DecodeError::StartMark { offset: 16, length: 5 };
    assert_eq!(places, [Ok(0), Ok(8), Err(noise), Ok(21), Ok(29)]);
}

#[test]
fn a_wrong_checksum_is_reported_as_such_and_covers_its_frame() {
    let frame = b"\x10\x10\x02\xe0\x10\x03\xe1";
    let sum = |offset| Err(DecodeError::Checksum { offset, expected: 0xE0, found: 0xE1 });
    assert_eq!(items(frame), [(sum(6), 7)]);
    assert_eq!(items(&[*frame, *frame].concat()), [(sum(6), 7), (sum(13), 14)]);
    assert_eq!(items(&[b"noise".as_slice(), frame, b"noise"].concat())[1], (sum(11), 17));
    // The error is reported before the next frame shows where the corruption ends.
    let mut decoder = Decoder::<RobotMessage>::new(Framing::DEFAULT);
    assert_eq!(decoder.push(frame), 7);
    assert_eq!(decoder.next_frame(), None);
    assert_eq!((decoder.corruption(), decoder.corruption()), (sum(6).err(), None));
}

/// "000 … 110" (§3.2.2): seven has no meaning.
#[test]
fn error_code_7_is_not_named() {
    let motion = |error: u8| {
        let frame = [0x80 | error, 2, 1, 0, 0, 32];
        RobotMessage::decode(&frame, Framing::DEFAULT).unwrap()
    };
    assert!((0..7).all(|error| motion(error).is_plausible()));
    let RobotMessage::Motion(seven) = motion(7) else { panic!() };
    assert_eq!((seven.error, motion(7).is_plausible()), (ErrorCode::Other(7), false));
    assert!(!RobotMessage::End(End { error: ErrorCode::Other(7) }).is_plausible());
}

#[test]
fn what_cannot_work_is_refused() {
    let host = |change: fn(&mut HostConfig)| {
        let mut config = HostConfig::default();
        change(&mut config);
        Host::new(config).map(|_| ())
    };
    assert_eq!(host(|config| config.baud = 19_200), Ok(()));
    let window = ConfigError::Window { baud: 9600, mode: 23 };
    assert_eq!(host(|config| config.baud = 9600), Err(window));
    let text = "at 9600 baud no value fits the reply window of mode 23: take a higher baud rate or a mode without transformation";
    assert_eq!(window.to_string(), text);
    assert_eq!(host(|config| (config.baud, config.mode) = (9600, Mode(19))), Ok(()));
    assert_eq!(host(|config| config.baud = 0), Err(ConfigError::Window { baud: 0, mode: 23 }));
    assert_eq!(
        host(|config| config.reserve = Duration::MAX),
        Err(ConfigError::Window { baud: 38_400, mode: 23 })
    );
    assert_eq!(host(|config| config.silence_cycles = 1), Err(ConfigError::SilenceCycles { found: 1 }));
    let controller = |config| Controller::new(config).map(|_| ());
    let default = ControllerConfig::default();
    assert_eq!(controller(ControllerConfig { attempts: 0, ..default }), Err(ConfigError::Attempts));
    assert_eq!(controller(ControllerConfig { baud: 9600, ..default }), Err(window));
}

/// The longest reply takes 8.854 ms (34 bytes at 38400 baud) of the window of 15 ms, and 1 ms is kept.
#[test]
fn while_the_longest_reply_fits_it_has_all_words() {
    let config = HostConfig::default();
    let longest = Draft { bare: 10, words: [4; 6], moving: 0 };
    let mut asked = HostMachine::new(Policy::Accept, false);
    let sent = Input::Sent { moving: 0, at_rest: true };
    for input in [Input::Connected, Input::Start { is_expected: true }, sent] {
        asked.on(Duration::ZERO, input, &config).unwrap();
    }
    assert!(!asked.fits(Duration::ZERO, 34, &config), "nothing is to be answered");
    let motion = Input::Motion { phase: MotionPhase::Running, error: ErrorCode::None, len: 36 };
    asked.on(Duration::ZERO, motion, &config).unwrap();
    let last = Duration::from_nanos(5_145_834);
    assert!(asked.fits(last, 34, &config));
    assert_eq!(asked.select(last, &longest, &config), Some((0b11_1111, 0)));
    let after = last + Duration::from_nanos(1);
    assert!(!asked.fits(after, 34, &config));
    assert_eq!(asked.select(after, &longest, &config), Some((0, 0)));
}

/// "Speeds go to zero, an offset stays."
#[test]
fn without_a_target_speeds_go_to_zero_and_an_offset_stays() {
    for (mode, course) in
        [(Mode::CUMULATIVE_23, OutputMode::Zero), (Mode::NON_CUMULATIVE_22, OutputMode::Hold)]
    {
        let config = HostConfig { mode, ..HostConfig::default() };
        let mut host = HostMachine::new(Policy::Accept, false);
        let sent = Input::Sent { moving: 0, at_rest: true };
        let motion = Input::Motion { phase: MotionPhase::Running, error: ErrorCode::None, len: 36 };
        for input in [Input::Connected, Input::Start { is_expected: true }, sent, motion] {
            host.on(Duration::ZERO, input, &config).unwrap();
        }
        let exception = Exception::None;
        let reply = Some(Answer::Reply { course, exception });
        assert_eq!(host.transmit(Duration::ZERO, &config), reply, "no target was set");
        host.on(Duration::ZERO, Input::Target, &config).unwrap();
        let aimed = Some(Answer::Reply { course: OutputMode::Target, exception });
        assert_eq!(host.transmit(Duration::ZERO, &config), aimed);
        host.on(Duration::ZERO, Input::NoTarget, &config).unwrap();
        assert_eq!(host.transmit(Duration::ZERO, &config), reply, "it was cleared");
    }
}

/// Every time that a session takes may be the last one there is, in its configuration too.
#[test]
fn the_end_of_time_is_survived() {
    const MAX: Duration = Duration::MAX;
    let start = b"\x10\x10\x02\xA0\x17\x10\x03\xB7";
    let motion = b"\x10\x10\x02\x80\x02\x01\x00\x00\x20\x10\x03\xA3";
    let configs = [
        HostConfig { subroutine: true, ..HostConfig::default() },
        HostConfig { gap: Some(MAX), subroutine: true, ..HostConfig::default() },
        HostConfig {
            target_timeout: MAX,
            max_delay: MAX,
            silence_cycles: u32::MAX,
            subroutine: true,
            ..HostConfig::default()
        },
    ];
    let mut out = [0; Frame::MAX_LEN];
    for config in configs {
        for times in [
            [MAX; 4],
            [Duration::ZERO, MAX, Duration::ZERO, MAX],
            [MAX - Duration::from_millis(28); 4],
            [MAX - Duration::from_nanos(111_999_999); 4],
        ] {
            let [a, b, c, d] = times;
            let mut host = Host::new(config).unwrap();
            host.handle_connected(a);
            host.handle_input(a, start);
            let accepted = host.poll_transmit(a, &mut out);
            host.set_target(b, [80; 6]);
            host.handle_input(b, &motion[..4]);
            host.handle_timeout(b);
            host.handle_input(b, &motion[4..]);
            let _ = host.exception(b, Exception::CloseGripper);
            host.poll_transmit(b, &mut out);
            host.handle_input(c, motion);
            host.handle_input(c, b"\x10\x10\x02\x80\x10\x04");
            host.poll_timeout();
            host.stop(c);
            host.clear_target(c);
            host.handle_timeout(d);
            host.poll_transmit(d, &mut out);
            host.handle_disconnected(d);
            assert!(accepted.is_some() || a == MAX);
        }
        for now in [MAX, MAX - Duration::from_millis(1)] {
            let mut controller =
                Controller::new(ControllerConfig { gap: config.gap, ..Default::default() }).unwrap();
            controller.handle_connected(now);
            assert_eq!(controller.start(now), Ok(()));
            let sent = controller.poll_transmit(now, &mut out);
            assert!(sent == Some(8) || now == MAX, "{sent:?}");
            controller.handle_input(now, b"\x10\x10\x02\x00");
            controller.handle_input(MAX, b"\x10\x03\x00");
            controller.poll_transmit(MAX, &mut out);
            controller.handle_timeout(MAX);
            controller.poll_timeout();
            let _ = controller.finish(MAX);
        }
    }
}

/// HALT, REACTI or BREAK, a fault or a panic stop, a signal; and a value without a name.
#[test]
fn each_segment_status_says_whether_the_arm_is_stopped() {
    let moves: Vec<u8> = (0..=255).filter(|code| !SegmentStatus::from(*code).is_stop()).collect();
    assert_eq!(moves, [1, 2, 3, 4, 5, 13]);
}
