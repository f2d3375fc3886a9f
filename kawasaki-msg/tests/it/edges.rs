//! The borders: tables and configurations that cannot work, comparisons of values, the display of a name.

use bytes::BytesMut;
use kawasaki_msg::robot_session::Decoder as _;
use kawasaki_msg::robot_session::tokio::Codec;
use kawasaki_msg::{
    Acks, Bounds, Charset, ConfigError, DecodeError, Decoder, Dialect, EncodeError, Entry, Field, Job,
    JobKind, JobSource, Limits, Line, Message, MessageError, Name, Pc, PcConfig, Point, RecoveryLimits,
    Robot, RobotConfig, Role, Supply, Takeover,
};

use super::{decoded, wire};

/// Returns the error of the default table after a change.
fn table(change: impl FnOnce(&mut Vec<Entry>)) -> Option<ConfigError> {
    let mut entries = Dialect::DEFAULT.entries().to_vec();
    change(&mut entries);
    Dialect::new(entries.leak()).err()
}

fn entry(entries: &mut [Entry], role: Role) -> &mut Entry {
    entries.iter_mut().find(|entry| entry.role == role).unwrap()
}

#[test]
fn a_table_has_every_role_once_with_its_fields_and_a_name_of_its_own() {
    let role = |role| Some(ConfigError::Role { role });
    assert_eq!(table(|entries| entries.retain(|entry| entry.role != Role::Status)), role(Role::Status));
    assert_eq!(table(|entries| entries.push(entries[0])), role(Role::Job));
    let fields = |role| Some(ConfigError::Fields { role });
    let missing = ConfigError::MissingField { role: Role::EndAck, field: Field::Executed };
    assert_eq!(table(|entries| entry(entries, Role::EndAck).fields = &[Field::Ended]), Some(missing));
    let twice: &[Field] = &[Field::Order, Field::Order];
    assert_eq!(table(|entries| entry(entries, Role::OrderAck).fields = twice), fields(Role::OrderAck));
    let foreign: &[Field] = &[Field::Order, Field::Phase];
    assert_eq!(table(|entries| entry(entries, Role::OrderAck).fields = foreign), fields(Role::OrderAck));
    let in_header: &[Field] = &[Field::Work];
    assert_eq!(table(|entries| entry(entries, Role::Job).header = in_header), fields(Role::Job));
    const MANY: [Field; 17] = {
        let mut fields = [Field::Unused; 17];
        fields[0] = Field::Order;
        fields[1] = Field::Queued;
        fields
    };
    let too_many = ConfigError::TooManyFields { role: Role::Pause, found: 17 };
    assert_eq!(table(|entries| entry(entries, Role::Pause).fields = &MANY), Some(too_many));
    assert_eq!(table(|entries| entry(entries, Role::Pause).fields = MANY.first_chunk::<16>().unwrap()), None);
    let name = |role| Some(ConfigError::Name { role });
    assert_eq!(table(|entries| entry(entries, Role::Filler).name = ""), name(Role::Filler));
    assert_eq!(table(|entries| entry(entries, Role::Filler).name = "Tyo"), name(Role::Job));
    assert_eq!(Dialect::default(), Dialect::DEFAULT);
    let latin1 = Dialect::DEFAULT.with_charset(Charset::Latin1);
    assert_eq!((latin1.charset(), Dialect::DEFAULT.charset()), (Charset::Latin1, Charset::Ascii));
    assert_eq!(Dialect::DEFAULT.entry(Role::Command(7)), None, "a command that the table lacks");
}

#[test]
fn a_configuration_that_cannot_work_is_refused() {
    let robot = |config: RobotConfig, max_number| {
        let (writer, _reader) = robot_work_queue::boxed::<Job<Line>>(4, max_number).unwrap();
        Robot::new(RobotConfig { max_number, ..config }, writer).err()
    };
    let (writer, _reader) = robot_work_queue::boxed::<Job<Line>>(4, 99).unwrap();
    let other = Robot::new(RobotConfig::tcp(), writer).err();
    assert_eq!(other, Some(ConfigError::QueueNumbers { queue: 99, config: 9999 }));
    assert_eq!(robot(RobotConfig::default(), 9999), None);
    assert_eq!(robot(RobotConfig::tcp(), 10_000), Some(ConfigError::MaxNumber { found: 10_000 }));
    let origin = Point::new(0, 0);
    let bounds = |min, max| {
        let (writer, _reader) = robot_work_queue::boxed::<Job<Line>>(4, 9999).unwrap();
        <Robot<_>>::with_ranges(RobotConfig::tcp(), writer, Bounds { min, max }).err()
    };
    let empty = |field| Some(ConfigError::EmptyRange { field: Name::of(field) });
    assert_eq!(bounds(origin, origin), None, "a single point");
    assert_eq!(bounds(Point::new(1, 0), origin), empty("x1"));
    assert_eq!(bounds(Point::new(0, 1), origin), empty("y1"));
    let pc = |min, max| <Pc<&[Line]>>::with_ranges(PcConfig::tcp(), Bounds { min, max }).err();
    assert_eq!(pc(Point::new(1, 0), origin), empty("x1"));
    let limits = |element, packet| PcConfig { limits: Limits { element, packet }, ..PcConfig::default() };
    type Nothing = fn(u32) -> Supply<Line>;
    let pc = |config| Pc::<Nothing>::new(config).err();
    assert_eq!(pc(PcConfig::tcp()), None);
    // A job has two numbers of up to 12 characters with their `$`, and its own fields.
    let longest = "<Tyo$61#-2147483648$-2147483648$2$#>".len() + 4 * "-9999999$".len() - 1;
    assert_eq!(pc(limits(1, longest)), None);
    assert_eq!(pc(limits(1, longest - 1)), Some(ConfigError::Limits { element: 1, packet: longest - 1 }));
    assert_eq!(pc(limits(0, 4096)), Some(ConfigError::Limits { element: 0, packet: 4096 }));
    assert_eq!(pc(limits(255, 4097)), Some(ConfigError::Limits { element: 255, packet: 4097 }));
    for (found, outcome) in [(1, true), (2, false), (9999, false), (10_000, true)] {
        let error = outcome.then_some(ConfigError::MaxNumber { found });
        assert_eq!(pc(PcConfig { max_number: found, ..PcConfig::tcp() }), error);
    }
    assert_eq!(
        (Limits::default(), RecoveryLimits::default()),
        (Limits::TCP, RecoveryLimits { resends: 3, pauses: 3, clears: 1 })
    );
}

#[test]
fn a_value_is_a_character_a_byte() {
    let wire = b"<A$a$$ 7$4#\xC3\xA9$b#>";
    let message = decoded(wire, Charset::Latin1);
    let other = decoded(b"<B$a$$ 7$2#$b#>", Charset::Latin1);
    assert!(
        message.name == *"A" && message.name == "A" && message.name != "AA" && message.name != other.name
    );
    assert_eq!((message.header, message.header.count()), (other.header, 3));
    assert_ne!(message.fields, other.fields);
    assert_eq!(format!("{:?}", message.header), r#"["a", "", " 7"]"#);
    let field = message.fields.iter().next().unwrap();
    // A character is a byte, whatever two of them would be in UTF-8.
    assert_eq!(serde_json::to_string(&field).unwrap(), "\"\u{C3}\u{A9}\"");
    assert_eq!((field.to_string().as_str(), field.as_bytes()), ("\u{C3}\u{A9}", &b"\xC3\xA9"[..]));
}

#[test]
fn a_character_that_no_byte_stands_for_is_refused_with_it() {
    let text = |text, charset| wire(charset, "A", &[], &[text]).map(|wire| wire.len());
    assert_eq!(text("\u{ff}", Charset::Latin1), Ok(8));
    assert_eq!(text("\u{100}", Charset::Latin1), Err(EncodeError::Character { found: '\u{100}' }));
    assert_eq!(text("\u{80}", Charset::Ascii), Err(EncodeError::Character { found: '\u{80}' }));
    assert_eq!(wire(Charset::Ascii, "", &["a"], &[]), Err(EncodeError::NoName));
    let message = decoded(b"<A$ 1#b#>", Charset::Ascii);
    let mut short = [0; 7];
    assert_eq!(
        message.append_to(&mut &mut short[..]),
        Err(EncodeError::BufferTooSmall { needed: 8, available: 7 })
    );
    assert_eq!(short, [0; 7], "nothing is appended");
    let mut enough = [0; 8];
    assert_eq!(message.append_to(&mut &mut enough[..]), Ok(()));
    assert_eq!(&enough, b"<A$1#b#>");
}

#[test]
fn bytes_that_begin_no_message_are_told_by_the_message_itself() {
    let decode = |bytes: &[u8]| Message::decode(bytes, Charset::Ascii).map(drop);
    assert_eq!(decode(b"abc<A$0##>"), Err(DecodeError::Garbage { offset: 0, length: 3 }));
    assert_eq!(decode(b"abc"), Err(DecodeError::Garbage { offset: 0, length: 3 }));
    let long = [b"<".as_slice(), &[b'x'; 4095]].concat();
    assert_eq!(decode(&long), Err(DecodeError::TooLong { offset: 0, limit: 4096 }));
    assert_eq!(decode(&long[..4095]), Ok(()), "the next byte may still be a mark");
}

/// Wherever a message was truncated: the next one begins there, and is not lost.
#[test]
fn a_message_that_the_next_one_cuts_off_says_where() {
    for (bytes, offset) in [("<<", 1), ("<Til<", 4), ("<Tila$2<", 7), ("<Tila$2#5<", 9), ("<Tila$2#50#<", 11)]
    {
        let error = DecodeError::Mark { offset, found: b'<' };
        assert_eq!(Message::decode(bytes.as_bytes(), Charset::Ascii), Err(error), "{bytes}");
    }
}

#[test]
fn a_message_has_at_most_4096_bytes() {
    let text = "x".repeat(4087);
    let written = |data: usize| wire(Charset::Ascii, "X", &[], &[&text[..data]]).map(|wire| wire.len());
    assert_eq!(written(4086), Ok(4096));
    assert_eq!(written(4087), Err(EncodeError::TooLong { length: 4097, limit: 4096 }));
    // A length that is too large is reported before the data comes, at the name.
    assert_eq!(Message::decode(b"<X$4086#", Charset::Ascii), Ok(None));
    let too_long = DecodeError::TooLong { offset: 1, limit: 4096 };
    assert_eq!(Message::decode(b"<X$4087#", Charset::Ascii), Err(too_long));
}

#[test]
fn a_decoder_holds_the_longest_message_and_not_a_byte_more() {
    let mut decoder = Decoder::new(Charset::Ascii);
    assert_eq!(decoder.push(&[b'x'; 4000]), 4000);
    assert_eq!(decoder.push(&[b'x'; 97]), 96);
    assert_eq!(decoder.push(b"x"), 0);
    assert!(decoder.next_frame().is_none(), "garbage is told when a message begins");
    // The space of the garbage is free again.
    assert_eq!(decoder.push(&[b'x'; 5000]), 4096);
    assert!(decoder.next_frame().is_none());
    assert_eq!(decoder.push(b"<"), 1);
    assert_eq!(decoder.next_frame(), Some(Err(DecodeError::Garbage { offset: 0, length: 8192 })));
}

/// However reads split the message, only the end of the buffer ends it.
#[test]
fn a_message_without_an_end_is_given_up_when_the_buffer_is_full() {
    let mut decoder = Decoder::new(Charset::Ascii);
    assert_eq!(decoder.push(b"<"), 1);
    for _ in 1..4096 {
        assert!(decoder.next_frame().is_none());
        assert_eq!(decoder.push(b"x"), 1);
    }
    assert!(decoder.next_frame().is_none(), "how much is skipped shows at the next message");
    assert_eq!(decoder.push(b"<"), 1);
    let error = DecodeError::TooLong { offset: 0, limit: 4096 };
    assert_eq!(decoder.next_frame(), Some(Err(error)));
    assert_eq!(decoder.position(), 4096);
}

#[test]
fn bounds_hold_both_of_their_ends() {
    let bounds = Bounds { min: Point::new(-1, -2), max: Point::new(3, 4) };
    for (x, y, within) in
        [(-1, -2, true), (3, 4, true), (-2, 0, false), (4, 0, false), (0, -3, false), (0, 5, false)]
    {
        assert_eq!(bounds.contains(Point::new(x, y)), within, "{x} {y}");
    }
    assert_eq!(Bounds::default(), Bounds::WIDEST);
    assert_eq!(
        [1, 2, 3].map(|code| JobKind::try_from(code).ok()),
        [Some(JobKind::Draw), Some(JobKind::Move), None]
    );
}

/// Roles that a plant omits make some configurations impossible.
#[test]
fn a_configuration_needs_what_the_table_lacks() {
    let without = |role| {
        let entries = Dialect::DEFAULT.entries().iter().filter(|entry| entry.role != role);
        entries.copied().collect::<Vec<_>>()
    };
    let robot = |config: RobotConfig| {
        let (writer, _reader) = robot_work_queue::boxed::<Job<Line>>(4, 9999).unwrap();
        Robot::new(config, writer).err()
    };
    let pc = |config| Pc::<&[Line]>::new(config).err();
    let lacks = |role| Some(ConfigError::Lacks { role });

    let table = without(Role::JobAck);
    let dialect = Dialect::new(table.leak()).unwrap();
    assert_eq!(robot(RobotConfig { dialect, ..RobotConfig::tcp() }), None);
    let acks = Acks::Individual;
    assert_eq!(robot(RobotConfig { dialect, acks, ..RobotConfig::tcp() }), lacks(Role::JobAck));
    assert_eq!(pc(PcConfig { dialect, ..PcConfig::tcp() }), None);
    let config = PcConfig { dialect, cumulative_acks: false, ..PcConfig::tcp() };
    assert_eq!(pc(config), lacks(Role::JobAck));

    let table = without(Role::OrderInterrupt);
    let dialect = Dialect::new(table.leak()).unwrap();
    assert_eq!(pc(PcConfig { dialect, ..PcConfig::tcp() }), lacks(Role::OrderInterrupt));
    assert_eq!(pc(PcConfig { dialect, takeover: Takeover::End, ..PcConfig::tcp() }), None);

    let mut table = Dialect::DEFAULT.entries().to_vec();
    entry(&mut table, Role::Job).fields = &[Field::Number, Field::Work];
    let dialect = Dialect::new(table.leak()).unwrap();
    let late = Some(ConfigError::LateMessages { role: Role::Job });
    assert_eq!(robot(RobotConfig { dialect, ..RobotConfig::udp() }), late);
    assert_eq!(pc(PcConfig { dialect, ..PcConfig::udp() }), late);
    assert_eq!(robot(RobotConfig { dialect, ..RobotConfig::tcp() }), None);

    let mut table = Dialect::DEFAULT.entries().to_vec();
    entry(&mut table, Role::Pause).fields = &[Field::Order, Field::Queued, Field::Constant("a$")];
    let dialect = Dialect::new(table.leak()).unwrap();
    let constant = Some(ConfigError::Constant { role: Role::Pause, found: '$' });
    assert_eq!(robot(RobotConfig { dialect, ..RobotConfig::tcp() }), constant);
}

#[test]
fn a_name_that_is_not_in_the_table_is_shown() {
    let message = decoded(b"<Outo$0##>", Charset::Ascii);
    let Err(error @ MessageError::UnknownName { name }) = Dialect::DEFAULT.read(&message) else {
        panic!("known")
    };
    assert_eq!((format!("{name}"), format!("{name:?}")), ("Outo".into(), "\"Outo\"".into()));
    assert_eq!(serde_json::to_string(&name).unwrap(), "\"Outo\"");
    assert!(error.to_string().contains("Outo"), "{error}");
}

#[test]
fn a_slice_is_a_source_of_jobs_until_it_ends() {
    let line = Line { kind: JobKind::Draw, start: Point::new(0, 0), end: Point::new(9, 9) };
    let lines = [line];
    let mut source = &lines[..];
    assert_eq!((source.job(0), source.job(1)), (Supply::Job(line), Supply::End));
}

#[test]
fn a_codec_gives_what_is_whole_before_it_gives_up_the_rest() {
    let mut wire = BytesMut::from("<A$1#b#><C");
    let mut codec = Codec::new(Decoder::new(Charset::Ascii), |message: Message<'_>| message.name.to_string());
    let mut next = || tokio_util::codec::Decoder::decode_eof(&mut codec, &mut wire).unwrap();
    assert_eq!(next(), Some(Ok("A".to_string())));
    assert!(matches!(next(), Some(Err(DecodeError::Incomplete { .. }))));
    assert_eq!(next(), None);
    let mut decoder = Decoder::new(Charset::Ascii);
    assert_eq!(decoder.push(b"<A"), 2);
    assert!(decoder.is_inside_message());
    decoder.clear();
    assert!(!decoder.is_inside_message());
}

#[test]
fn a_stream_that_ends_anywhere_is_told_whatever_the_pieces() {
    let wire = b"x<Tila$h$4#a$bc#><X$0##>x<X$1#ab#><X$1#a#<Y$1#\n#!>#<$2#<X$9999#";
    for length in 0..=wire.len() {
        let results = |size| {
            let mut decoder = Decoder::<32>::sized(Charset::Ascii);
            let mut results = Vec::new();
            let mut take = |decoder: &mut Decoder<32>| {
                while let Some(item) = decoder.next_frame() {
                    let item = item.map(|message| format!("{message:?}"));
                    results.push((item, decoder.position()));
                }
            };
            for piece in wire[..length].chunks(size) {
                assert_eq!(decoder.push(piece), piece.len());
                take(&mut decoder);
            }
            decoder.finish();
            take(&mut decoder);
            assert!(!decoder.is_inside_message());
            results
        };
        let whole = results(16);
        assert_eq!(whole.last().map_or(0, |(_, position)| *position), length as u64);
        for size in [1, 2, 3, 5] {
            assert_eq!(results(size), whole, "{length} bytes in pieces of {size}");
        }
    }
}

#[test]
fn every_code_of_a_phase_survives() {
    for code in 0..=u8::MAX {
        assert_eq!(u8::from(kawasaki_msg::Phase::from(code)), code);
    }
}
