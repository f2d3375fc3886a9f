//! Properties of every message, every stream and every packet.

#![allow(clippy::cast_possible_truncation)]

use bytes::{BufMut, BytesMut};
use kawasaki_msg::robot_session::{Decoder as _, Encode as _, Session as _};
use kawasaki_msg::{
    AddResult, Charset, DecodeError, Decoder, EncodeError, Job, Limits, Line, Message, Packet, Values,
};
use proptest::prelude::*;

use super::packet::{fillings, push};
use super::{decoded, wire};

/// A message read byte by byte, as the grammar says: its name, how many values its header has, its data part, its length.
type Plain = Result<Option<(String, usize, Vec<u8>, usize)>, DecodeError>;

fn plain(wire: &[u8], charset: Charset) -> Plain {
    use DecodeError::*;
    let ends = |byte: u8| b"<>#".contains(&byte) || (charset == Charset::Ascii && byte > 127);
    let text_end = |from: usize| (from..wire.len()).find(|at| ends(wire[*at]));
    let no_data_mark = |offset: usize| match wire[offset] {
        found @ (b'<' | b'>') => Err(Mark { offset, found }),
        found => Err(NotAscii { offset, found }),
    };
    let Some(first) = wire.first() else { return Ok(None) };
    if *first != b'<' {
        let length = wire.iter().position(|byte| *byte == b'<').unwrap_or(wire.len());
        return Err(Garbage { offset: 0, length });
    }
    let Some(header_end) = text_end(1) else { return Ok(None) };
    if wire[header_end] != b'#' {
        return no_data_mark(header_end);
    }
    let header: Vec<&[u8]> = wire[1..header_end].split(|byte| *byte == b'$').collect();
    let length_at = header_end - header.last().unwrap().len();
    let length = core::str::from_utf8(header.last().unwrap())
        .ok()
        .map(|text| text.trim_matches([' ', '\t', '\n', '\r', '\x0C']));
    let length = length.filter(|text| !text.starts_with('+')).and_then(|text| text.parse::<i32>().ok());
    if header.len() == 1 {
        return Err(NoLength { offset: header_end });
    }
    let Some(length) = length.and_then(|length| usize::try_from(length).ok()) else {
        return Err(NoLength { offset: length_at });
    };
    if header[0].is_empty() {
        return Err(NoName { offset: 1 });
    }
    let data_at = header_end + 1;
    if data_at + length + 2 > Message::MAX_LEN {
        return Err(TooLong { offset: 1, limit: Message::MAX_LEN });
    }
    let Some(end) = text_end(data_at) else { return Ok(None) };
    if wire[end] != b'#' {
        return no_data_mark(end);
    }
    if end - data_at != length {
        return Err(Length { offset: data_at, expected: length, found: end - data_at });
    }
    match wire.get(end + 1) {
        None => Ok(None),
        Some(b'>') => {
            let name = header[0].iter().map(|byte| char::from(*byte)).collect();
            Ok(Some((name, header.len() - 2, wire[data_at..end].to_vec(), end + 2)))
        }
        Some(found @ b'<') => Err(Mark { offset: end + 1, found: *found }),
        Some(found) => Err(NoEndMark { offset: end + 1, found: *found }),
    }
}

/// A message as the program holds it.
#[derive(Debug, Clone, PartialEq)]
struct Owned {
    name: String,
    header: Vec<String>,
    fields: Vec<String>,
}

impl Owned {
    /// Returns the wire form in the character set.
    fn encode(&self, charset: Charset) -> Result<Vec<u8>, EncodeError> {
        let texts =
            |texts: &'_ [String]| texts.iter().map(|text| text.clone().leak() as &str).collect::<Vec<_>>();
        wire(charset, &self.name, &texts(&self.header), &texts(&self.fields))
    }
}

fn owned(message: &Message<'_>) -> Owned {
    let list = |values: &Values<'_>| values.iter().map(|value| value.to_string()).collect();
    Owned { name: message.name.to_string(), header: list(&message.header), fields: list(&message.fields) }
}

fn text(latin1: bool, least: usize) -> impl Strategy<Value = String> {
    let character = prop_oneof![
        4 => prop::char::range('0', '9'),
        2 => prop::char::range('A', 'z'),
        1 => prop::char::range('\0', if latin1 { 'ÿ' } else { '\x7F' }),
    ];
    let character = character.prop_filter("a mark", |c| !"<>$#".contains(*c));
    prop::collection::vec(character, least..8).prop_map(|chars| chars.into_iter().collect())
}

fn message(latin1: bool) -> impl Strategy<Value = Owned> {
    let values = || prop::collection::vec(text(latin1, 0), 0..6);
    (text(latin1, 1), values(), values()).prop_map(|(name, header, mut fields)| {
        if fields == [""] {
            fields.clear(); // the same bytes
        }
        Owned { name, header, fields }
    })
}

/// Returns the messages and errors with the offset after each.
fn decode(charset: Charset, chunks: &[&[u8]]) -> Vec<(Result<String, DecodeError>, u64)> {
    let mut decoder = Decoder::new(charset);
    let mut said = Vec::new();
    for mut chunk in chunks.iter().copied() {
        while !chunk.is_empty() {
            chunk = &chunk[decoder.push(chunk)..];
            drain(&mut decoder, &mut said);
        }
    }
    decoder.finish();
    drain(&mut decoder, &mut said);
    said
}

fn drain(decoder: &mut Decoder, said: &mut Vec<(Result<String, DecodeError>, u64)>) {
    loop {
        let item = decoder.next_frame().map(|frame| frame.map(|message| format!("{message:?}")));
        let Some(item) = item else { break };
        said.push((item, decoder.position()));
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn decode_is_the_inverse_of_encode(latin1: bool, owned_message in message(true)) {
        let charset = if latin1 { Charset::Latin1 } else { Charset::Ascii };
        let texts = owned_message.header.iter().chain(&owned_message.fields).chain([&owned_message.name]);
        let ascii = texts.into_iter().all(|text| text.is_ascii());
        match owned_message.encode(charset) {
            Ok(wire) => {
                prop_assert!(latin1 || wire.is_ascii());
                let message = decoded(&wire, charset);
                prop_assert_eq!(owned(&message), owned_message);
                prop_assert_eq!(message.encoded_len(), wire.len());
                let mut grown = BytesMut::new();
                grown.put_slice(b"before");
                message.append_to(&mut grown).unwrap();
                prop_assert_eq!(&grown[6..], &wire[..]);
            }
            Err(EncodeError::Character { found }) => prop_assert!(!latin1 && !found.is_ascii() && !ascii),
            Err(error) => prop_assert!(false, "{}", error),
        }
    }

    #[test]
    fn a_mark_in_a_value_is_refused(original in message(false), place in 0usize..3, mark in "[<>$#]") {
        let mut bad = original.clone();
        match place {
            0 => bad.name += &mark,
            1 => bad.header.push(mark.clone()),
            _ => bad.fields.push(mark.clone()),
        }
        prop_assert_eq!(bad.encode(Charset::Ascii), Err(EncodeError::Forbidden { found: mark.as_bytes()[0] }));
    }

    #[test]
    fn a_message_is_read_as_byte_by_byte(
        original in message(true),
        latin1: bool,
        damage in prop::collection::vec((any::<prop::sample::Index>(), "[<>$# 09x]|\\PC".prop_map(|c| c.as_bytes()[0])), 0..3),
        cut in prop::option::of(any::<prop::sample::Index>()),
    ) {
        let charset = if latin1 { Charset::Latin1 } else { Charset::Ascii };
        let mut wire = original.encode(Charset::Latin1).unwrap();
        for (at, byte) in damage {
            let at = at.index(wire.len());
            wire[at] = byte;
        }
        wire.truncate(cut.map_or(wire.len(), |cut| cut.index(wire.len())));
        let read = Message::decode(&wire, charset).map(|read| read.map(|(message, used)| {
            (message.name.to_string(), message.header.iter().count(), data(&message), used)
        }));
        prop_assert_eq!(read, plain(&wire, charset), "{}", wire.escape_ascii());
    }

    #[test]
    fn any_bytes_in_any_pieces_give_the_same(
        parts in prop::collection::vec(prop_oneof![
            message(false).prop_map(|m| m.encode(Charset::Ascii).unwrap()),
            prop::collection::vec(prop_oneof![3 => prop::sample::select(b"<>$#0123A".to_vec()), 1 => any::<u8>()], 0..12),
        ], 0..8),
        sizes in prop::collection::vec(1usize..9, 1..9),
    ) {
        let stream = parts.concat();
        let whole = decode(Charset::Ascii, &[&stream]);
        let mut rest = &stream[..];
        let mut pieces = Vec::new();
        for size in sizes.iter().cycle() {
            if rest.is_empty() { break }
            let (piece, tail) = rest.split_at((*size).min(rest.len()));
            pieces.push(piece);
            rest = tail;
        }
        prop_assert_eq!(&decode(Charset::Ascii, &pieces), &whole);
        // Every byte is in one message or in one error.
        let ends: Vec<u64> = whole.iter().map(|(_, end)| *end).collect();
        prop_assert!(ends.windows(2).all(|w| w[0] < w[1]), "{:?}", whole);
        prop_assert_eq!(ends.last().copied().unwrap_or(0), stream.len() as u64);
    }

    #[test]
    fn corruption_costs_only_the_messages_that_it_touches(
        messages in prop::collection::vec(message(false), 3..8),
        hit in 1usize..7,
        at in any::<prop::sample::Index>(),
        byte: u8,
        lose: bool,
    ) {
        let mut wires: Vec<Vec<u8>> = messages.iter().map(|m| m.encode(Charset::Ascii).unwrap()).collect();
        let hit = hit % (wires.len() - 1);
        let at = at.index(wires[hit].len());
        if lose { wires[hit].remove(at); } else { wires[hit][at] = byte; }
        let stream = wires.concat();
        let said = decode(Charset::Ascii, &[&stream]);
        let mut ends = wires.iter().scan(0, |end, wire| { *end += wire.len() as u64; Some(*end) });
        let read: Vec<u64> = said.iter().filter(|(item, _)| item.is_ok()).map(|(_, end)| *end).collect();
        for (i, end) in ends.by_ref().enumerate() {
            // A lost end mark or a new one can take the neighbour's first byte with it, never more.
            prop_assert!(i == hit || read.contains(&end), "message {} of {:?}", i, said);
        }
    }

    #[test]
    fn a_packet_keeps_both_limits(
        lengths in prop::collection::vec(0usize..400, 1..60),
        udp: bool,
    ) {
        let limits = if udp { Limits::UDP } else { Limits::TCP };
        let mut buffer = [0; 5000];
        let mut packet = Packet::new(&mut buffer, limits, fillings());
        let mut expected = Vec::new();
        for length in lengths {
            let room = push(&mut packet, length).unwrap();
            let own: String = (0..length).map(|at| if at % 256 == 255 { '$' } else { 'x' }).collect();
            let message = format!("<X${}#1${own}#>", length + 2);
            let fits = expected.len() + message.len() <= limits.packet;
            prop_assert_eq!(room, if fits { AddResult::Added } else { AddResult::Full });
            if fits {
                expected.extend(message.into_bytes());
            }
            prop_assert_eq!(packet.as_bytes(), &expected[..]);
        }
        prop_assert!(packet.as_bytes().len() <= limits.packet);
        let elements: Vec<&[u8]> = packet.elements().collect();
        prop_assert_eq!(elements.concat(), expected);
        prop_assert!(elements.iter().all(|e| !e.is_empty() && e.len() <= limits.element));
        prop_assert!(elements.len() <= limits.packet.div_ceil(limits.element));
    }
}

/// Reads a 4096-byte packet whole, split in two at every byte, and as its strings of 255.
#[test]
fn every_split_point_of_a_full_packet_gives_the_same_messages() {
    let (mut bytes, mut number) = (Vec::new(), 0);
    while bytes.len() < 4096 - 60 {
        number += 1;
        let fields = [50, number, 1, number * 17, -number, 31 * number, 0].map(|n: i32| n.to_string());
        let fields: Vec<&str> = fields.iter().map(String::as_str).collect();
        bytes.extend(wire(Charset::Ascii, "Tyo", &[], &fields).unwrap());
    }
    let rest = "x".repeat(4096 - bytes.len() - "<X$00##>".len());
    bytes.extend(wire(Charset::Ascii, "X", &[], &[&rest]).unwrap());
    assert_eq!(bytes.len(), 4096);
    let bytes = &bytes[..];
    let mut expected = Vec::new();
    let mut rest = bytes;
    while let Some((message, used)) = Message::decode(rest, Charset::Ascii).unwrap() {
        expected.push(data(&message));
        rest = &rest[used..];
    }
    assert_eq!((expected.len() as i32, rest.len()), (number + 1, 0));
    for at in 1..bytes.len() {
        let (head, tail) = bytes.split_at(at);
        gives(&expected, &[head, tail]);
        // After another message the packet no longer fits the buffer as it is.
        gives(&[&[Vec::new()], &expected[..]].concat(), &[b"<Huuhaa$0##>", head, tail]);
    }
    gives(&expected, &bytes.chunks(255).collect::<Vec<_>>());
    gives(&expected, &bytes.chunks(1).collect::<Vec<_>>());
}

/// Returns the data part in its wire form.
fn data(message: &Message<'_>) -> Vec<u8> {
    let fields: Vec<&[u8]> = message.fields.iter().map(|field| field.as_bytes()).collect();
    fields.join(&b'$')
}

/// Asserts that the pieces give messages with these data parts and nothing else.
fn gives(expected: &[Vec<u8>], pieces: &[&[u8]]) {
    let (mut decoder, mut found) = (Decoder::new(Charset::Ascii), 0);
    for mut piece in pieces.iter().copied() {
        while !piece.is_empty() {
            piece = &piece[decoder.push(piece)..];
            while let Some(frame) = decoder.next_frame() {
                assert_eq!(data(&frame.unwrap()), expected[found]);
                found += 1;
            }
        }
    }
    decoder.finish();
    assert!(decoder.next_frame().is_none() && found == expected.len());
}

/// A name that is too long to be compared at once.
const LONG_NAME: &str = "TyoJokaLuetaanYleisestiEikaNopeasti";

/// Returns the jobs and events of an answer for a robot in order 50 whose table has this name for a job.
fn queue_of(name: &str, answer: &str) -> (Vec<Job<Line>>, Vec<kawasaki_msg::RobotEvent>) {
    use core::time::Duration;
    use kawasaki_msg::{Bounds, Dialect, Point, Robot, RobotConfig, Role};
    let mut table = Dialect::DEFAULT.entries().to_vec();
    table
        .iter_mut()
        .filter(|entry| entry.role == Role::Job)
        .for_each(|entry| entry.name = name.to_owned().leak());
    let dialect = Dialect::new(table.leak()).unwrap();
    let bounds = Bounds { min: Point::new(-1000, 0), max: Point::new(1000, 500) };
    let (writer, reader) = robot_work_queue::boxed(9, 12).unwrap();
    let config = RobotConfig { dialect, max_number: 12, ..RobotConfig::tcp() };
    let mut robot = <Robot<Line>>::with_ranges(config, writer, bounds).unwrap();
    robot.handle_timeout(Duration::ZERO);
    robot.handle_connected(Duration::ZERO);
    robot.handle_input(Duration::ZERO, b"<TilausAlkaa$4#50$1#>");
    robot.handle_input(Duration::ZERO, answer.replace("<Tyo$", &format!("<{name}$")).as_bytes());
    let events = core::iter::from_fn(|| robot.poll_event());
    let events = events.filter(|event| !matches!(event, kawasaki_msg::RobotEvent::Corrupt(_))).collect();
    (reader.iter().map(|(_, job)| *job).collect(), events)
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    /// A long name is read in the general way, a short one in one pass.
    #[test]
    fn both_ways_of_reading_jobs_queue_the_same(
        jobs in prop::collection::vec((
            prop_oneof![8 => Just(1u16), 1 => 0u16..=14],
            prop_oneof![9 => Just(50), 1 => Just(51)],
            prop_oneof![9 => 1..=2, 1 => 0..=3],
            -1010..=1010,
            -3..=505,
            prop_oneof![9 => Just(""), 1 => Just(" "), 1 => Just("<"), 1 => Just("$"), 1 => Just("x")],
            prop_oneof![9 => Just(0), 1 => Just(1), 1 => Just(10)],
        ), 1..20),
    ) {
        let mut number = 0;
        let messages = jobs.iter().map(|(step, order, kind, x, y, damage, too_long)| {
            number = if *step == 1 { number % 12 + 1 } else { *step };
            let data = format!("{order}${number}${kind}${x}${y}$0$0{damage}");
            format!("<Tyo${}#{data}#>", data.len() + too_long)
        });
        let answer: String = messages.collect();
        prop_assert_eq!(queue_of("Tyo", &answer), queue_of(LONG_NAME, &answer));
    }
}

/// A framed transport of tokio gives the same messages and the same errors, and writes the messages that were read.
#[test]
fn the_codec_reads_and_writes_the_stream() {
    use kawasaki_msg::robot_session::tokio::Codec;
    use tokio_util::codec::{Decoder as _, Encoder as _};
    let stream = b"<TilausAlkaa$4#50$1#>roskaa<X$2#1#><Huuhaa$ 0##><Til";
    let written = |message: Message<'_>| {
        let mut wire = vec![0; message.encoded_len()];
        message.encode(&mut wire).unwrap();
        wire
    };
    let mut codec = Codec::new(Decoder::new(Charset::Ascii), written);
    let (mut items, mut src, mut wire) = (Vec::new(), BytesMut::new(), BytesMut::new());
    for byte in stream {
        src.put_u8(*byte);
        while let Some(item) = codec.decode(&mut src).unwrap() {
            items.push(item);
        }
    }
    while let Some(item) = codec.decode_eof(&mut src).unwrap() {
        items.push(item);
    }
    let messages: Vec<_> = items.iter().flatten().collect();
    for bytes in &messages {
        codec.encode(decoded(bytes, Charset::Ascii), &mut wire).unwrap();
    }
    assert_eq!(&wire[..], b"<TilausAlkaa$4#50$1#><Huuhaa$0##>");
    let errors: Vec<_> = items.iter().filter_map(|item| item.as_ref().err()).collect();
    assert_eq!(
        errors,
        [
            &DecodeError::Garbage { offset: 21, length: 6 },
            &DecodeError::Length { offset: 32, expected: 2, found: 1 },
            &DecodeError::Incomplete { offset: 48, found: 4 },
        ]
    );
}
