//! Messages that no link has.
#![allow(clippy::unwrap_used, clippy::indexing_slicing)]

use std::time::Duration;

use super::super::Sender;
use super::*;

fn look_at(messages: impl Iterator<Item = Vec<u8>>) -> StreamStructure {
    let stream =
        Stream { sender: Sender::Unknown, parts: vec![messages.flatten().collect()], arrivals: vec![] };
    look(&[stream]).remove(0)
}

/// Numbers that repeat in no short time.
fn noise(at: u32) -> u8 {
    u8::try_from(at.wrapping_mul(2_654_435_761).rotate_left(9) >> 24).unwrap()
}

/// Numbers that do not grow evenly.
fn random(at: u32) -> u8 {
    let product = at.wrapping_mul(2_654_435_761);
    (product ^ product >> 15).wrapping_mul(2_246_822_519).to_be_bytes()[0]
}

/// Returns `count` bytes of a message, none of which follows from the others.
pub(super) fn bytes(message: u32, count: usize) -> Vec<u8> {
    (message * 64..).take(count).map(random).collect()
}

#[test]
fn marks_lengths_counters_and_a_crc_are_seen() {
    let message = |at: u8| {
        let data: Vec<u8> = (0..4 + at % 5).map(|byte| noise(u32::from(at) * 16 + u32::from(byte))).collect();
        let body = [&[u8::try_from(data.len()).unwrap(), at], data.as_slice()].concat();
        let crc = crc::ALL[0].of_bytes(&body).to_le_bytes();
        [&[0xAA, 0x55], body.as_slice(), &crc[..2]].concat()
    };
    let seen = look_at((0..40).map(message));
    assert_eq!(seen.begin, [0xAA, 0x55], "{seen:?}");
    assert_eq!(seen.length, Some(Length { at: 2, width: 1, order: "big", beside: 6 }));
    assert_eq!(seen.counters, [Number { at: 3, kind: "u8", order: "big" }]);
    let check = seen.check.unwrap();
    assert_eq!((check.kind.as_str(), check.order, check.from_end), ("CRC-16/MODBUS", "little", 0));
    assert_eq!((check.first, check.before), (2, 0));
}

#[test]
fn a_line_ends_with_its_end_and_a_check_in_digits() {
    let message = |at: u32| {
        let body = format!("$T,{},{}", at * 37 % 1000, noise(at));
        let xor = body.bytes().skip(1).fold(0, |xor, byte| xor ^ byte);
        format!("{body}*{xor:02X}\r\n").into_bytes()
    };
    let seen = look_at((0..40).map(message));
    assert_eq!((seen.begin.as_slice(), seen.end.as_slice()), (&b"$T,"[..], &b"\r\n"[..]), "{seen:?}");
    let check = seen.check.unwrap();
    assert_eq!((check.kind.as_str(), check.order, check.first, check.before), ("xor", "hex", 1, 1));
}

/// Only the beginning is the same in all these messages. It is not a mark, since it is everywhere.
#[test]
fn messages_are_divided_by_the_pauses_between_them() {
    let message = |at: u32| -> Vec<u8> {
        let count = u8::try_from(at).unwrap();
        let data = (0..6 + at % 3).map(|byte| noise(at * 16 + byte) & 1);
        [1, count].into_iter().chain(data).collect()
    };
    let (mut bytes, mut arrivals, mut time) = (Vec::new(), Vec::new(), Duration::ZERO);
    for at in 2..42 {
        time += Duration::from_millis(40);
        // A driver hands over four bytes at a time.
        for chunk in message(at).chunks(4) {
            time += Duration::from_millis(4);
            arrivals.push((bytes.len(), time));
            bytes.extend_from_slice(chunk);
        }
    }
    let stream = Stream { sender: Sender::Unknown, parts: vec![bytes], arrivals };
    let seen = look(core::slice::from_ref(&stream)).remove(0);
    assert_eq!((seen.messages, seen.lengths), (40, [8, 10]), "{seen:?}");
    assert_eq!(seen.counters, [Number { at: 1, kind: "u8", order: "big" }]);
    let without = look(&[Stream { arrivals: vec![], ..stream }]).remove(0);
    assert_ne!(without.messages, 40, "{without:?}");
}

/// Returns a short text about the structure of messages that are already divided.
fn told(messages: &[Vec<u8>]) -> String {
    let it = of_messages(messages).unwrap();
    let hex = |bytes: &[u8]| bytes.iter().map(|byte| format!("{byte:02X}")).collect::<String>();
    let list = |all: &[Number]| {
        let all: Vec<String> =
            all.iter().map(|it| format!("{} {} at {}", it.kind, it.order, it.at)).collect();
        all.join(", ")
    };
    let constant: Vec<String> = it.constant.iter().map(|(at, byte)| format!("{byte:02X} at {at}")).collect();
    let length = it.length.map(|it| format!("{} {} at {}, and {}", it.width, it.order, it.at, it.beside));
    let parts = [
        ("begin", hex(&it.begin)),
        ("end", hex(&it.end)),
        ("doubled", it.doubled.map(|byte| hex(&[byte])).unwrap_or_default()),
        ("constant", constant.join(", ")),
        ("check", it.check.map(|it| it.kind).unwrap_or_default()),
        ("length", length.unwrap_or_default()),
        ("counter", list(&it.counters)),
        ("numbers", list(&it.numbers)),
    ];
    let parts: Vec<String> = parts
        .into_iter()
        .filter(|(_, text)| !text.is_empty())
        .map(|(name, text)| format!("{name} {text}"))
        .collect();
    parts.join("; ")
}

fn of<T>(values: impl IntoIterator<Item = T>, message: impl Fn(u32, T) -> Vec<u8>) -> Vec<Vec<u8>> {
    (0..).zip(values).map(|(at, value)| message(at, value)).collect()
}

/// Takes four values in turn.
fn one_of_four(at: u8) -> u8 {
    at / 3 % 4 + 1
}

/// Returns a number that grows by these steps from message to message.
fn steps(from: u16, steps: &[u16]) -> Vec<u16> {
    core::iter::once(0)
        .chain(steps.iter().copied())
        .scan(from, |value, step| {
            *value = value.wrapping_add(step);
            Some(*value)
        })
        .collect()
}

/// Seven steps of ten are by one, one of them where the number wraps; or six.
const SEVEN: [u16; 10] = [1, 1, 1, 1, 1, 1, 1, 5, 5, 5];
const SIX: [u16; 10] = [1, 1, 1, 1, 1, 1, 5, 5, 5, 5];

#[test]
fn a_counter_grows_by_one_in_seven_messages_of_ten() {
    let u8s = |steps: Vec<u16>| of(steps, |_, value| vec![0xAA, value.to_le_bytes()[0]]);
    let little = |steps: Vec<u16>| of(steps, |_, value| [&[0xAA][..], &value.to_le_bytes()].concat());
    let big = |steps: Vec<u16>| of(steps, |_, value| [&[0xAA][..], &value.to_be_bytes()].concat());
    let behind = |high: u8| of(0..20_u8, move |_, value| vec![0xAA, value, high, one_of_four(value)]);
    let before = |high: u8| of(0..20_u8, move |_, value| vec![0xAA, one_of_four(value), high, value]);
    for (messages, expected) in [
        (u8s(steps(252, &SEVEN)), "begin AA; counter u8 big at 1"),
        (u8s(steps(252, &SIX)), "begin AA"),
        (u8s(steps(0, &[1; 4])), "begin AA; counter u8 big at 1"),
        (u8s(steps(0, &[1; 3])), "begin AA"),
        (little(steps(65532, &SEVEN)), "begin AA; counter u16 little at 1"),
        (little(steps(65532, &SIX)), "begin AA; numbers i16 little at 1"),
        (big(steps(65532, &SEVEN)), "begin AA; counter u16 big at 1"),
        (big(steps(65532, &SIX)), "begin AA; numbers i16 big at 1"),
        // A byte that is constant, and not 0, is not part of it.
        (behind(0), "begin AA; constant 00 at 2; counter u16 little at 1"),
        (behind(7), "begin AA; constant 07 at 2; counter u8 big at 1"),
        (before(0), "begin AA; constant 00 at 2; counter u16 big at 2"),
        (before(7), "begin AA; constant 07 at 2; counter u8 big at 3"),
        // Nor is the end.
        (of(0..20, |_, value| vec![0xAA, value, 0]), "begin AA; end 00; counter u8 big at 1"),
        // One message is cut short.
        (
            of(0..20, |_, value| {
                let message = [0xAA, one_of_four(value), value];
                message[..if value < 19 { 3 } else { 2 }].to_vec()
            }),
            "begin AA; numbers i16 big at 1",
        ),
    ] {
        assert_eq!(told(&messages), expected, "{messages:02X?}");
    }
}

#[test]
fn the_numbers_of_a_text_count() {
    let text = |steps: Vec<u16>, end: &str| {
        of(steps, |at, value| {
            let pad = usize::try_from(at % 3).unwrap();
            let [a, b, c] = [0, 100, 200].map(|from| random(from + at));
            format!("{:09} {a:03}{b:03}{c:03}{},{value:02}{:pad$}{end}", 3_700_193 * u32::from(a), a % 10, "")
                .into_bytes()
        })
    };
    for (messages, expected) in [
        (text(steps(6, &SEVEN), ""), "constant 20 at 9, 2C at 20; counter digits big at 1"),
        (text(steps(6, &SIX), ""), "constant 20 at 9, 2C at 20"),
        // Nine bytes of ten are those of a text, or fewer.
        (
            text(steps(6, &SEVEN), "\t  \n\x01\x01\x01"),
            "end 0920200A010101; constant 20 at 9, 2C at 20; counter digits big at 1",
        ),
        (text(steps(6, &SEVEN), "  \n\x01\x01\x01\x01"), "end 20200A01010101; constant 20 at 9, 2C at 20"),
    ] {
        assert_eq!(told(&messages), expected, "{messages:02X?}");
    }
}

#[test]
fn a_length_grows_with_the_message() {
    type Write = fn(u16) -> Vec<u8>;
    type Found = Option<(usize, usize, &'static str, i64)>;
    type Run = (usize, usize, u16);
    let [u8, big, little, text]: [Write; 4] = [
        |it| vec![0xAA, it.to_le_bytes()[0]],
        |it| [&[0xAA][..], &it.to_be_bytes()].concat(),
        |it| [&[0xAA][..], &it.to_le_bytes()].concat(),
        |it| format!("L7={it:02};").into_bytes(),
    ];
    // The number of messages, their length, and the number of bytes that their field gives.
    let cases: [(Write, &[Run], Found); 13] = [
        (u8, &[(27, 8, 6), (1, 20, 18), (1, 19, 17), (1, 18, 16)], Some((1, 1, "big", 2))),
        (big, &[(9, 300, 297), (3, 20, 17)], Some((1, 2, "big", 3))),
        (little, &[(9, 300, 297), (3, 20, 17)], Some((1, 2, "little", 3))),
        (text, &[(9, 30, 24), (3, 20, 14)], Some((1, 0, "digits", 6))),
        // Too few are of another length.
        (u8, &[(28, 8, 6), (1, 20, 18), (1, 19, 17), (1, 18, 16)], None),
        (u8, &[(8, 8, 6), (1, 20, 18), (1, 19, 17)], None),
        // More than half of these must be right.
        (u8, &[(25, 8, 6), (3, 20, 18), (2, 19, 50)], Some((1, 1, "big", 2))),
        (u8, &[(24, 8, 6), (2, 20, 18), (2, 19, 50)], None),
        // And nearly all messages.
        (u8, &[(3, 8, 50), (3, 8, 60), (4, 8, 70), (5, 20, 18), (4, 19, 17)], None),
        // Some bytes may not count, or more than there are.
        (u8, &[(9, 72, 8), (3, 84, 20)], Some((1, 1, "big", 64))),
        (u8, &[(9, 73, 8), (3, 85, 20)], None),
        (u8, &[(9, 8, 16), (3, 20, 28)], Some((1, 1, "big", -8))),
        (u8, &[(9, 8, 17), (3, 20, 29)], None),
    ];
    for (write, runs, expected) in cases {
        let message = |length: usize, value: u16| {
            let mut bytes = write(value);
            bytes.resize(length, b' ');
            bytes
        };
        let messages: Vec<Vec<u8>> =
            runs.iter().flat_map(|(count, length, value)| vec![message(*length, *value); *count]).collect();
        let messages: Vec<&[u8]> = messages.iter().map(Vec::as_slice).collect();
        let found = fields::length(&messages).map(|it| (it.at, it.width, it.order, it.beside));
        assert_eq!(found, expected, "{runs:?}");
    }
}

#[test]
fn a_number_changes_slowly() {
    let little = |steps: &[u16]| of(steps.iter(), |_, value| [&[0xAA][..], &value.to_le_bytes()].concat());
    let big = |steps: &[u16]| of(steps.iter(), |_, value| [&[0xAA][..], &value.to_be_bytes()].concat());
    for (from, by, expected) in [
        (3044, &[7; 7][..], true),
        (3044, &[7; 6], false),
        (3044, &[7, 0, 7, 0, 7, 0, 7, 7], true),
        (3044, &[7, 0, 7, 0, 7, 0, 7, 0], false),
        (3044, &[100, 101, 102, 103, 1023, 1123, 1123, 1123], true),
        (3044, &[100, 101, 102, 103, 1024, 1123, 1123, 1123], false),
        (2816, &[1, 1, 1, 1, 31, 256, 256, 256], true),
        (2816, &[1, 1, 1, 1, 32, 256, 256, 256], false),
    ] {
        let all = steps(from, by);
        for (order, messages) in [("little", little(&all)), ("big", big(&all))] {
            let numbers = if expected { format!("; numbers i16 {order} at 1") } else { String::new() };
            assert_eq!(told(&messages), format!("begin AA{numbers}"), "{from} {by:?}");
        }
    }
}

#[test]
fn a_real_number_is_of_a_sensible_size_and_changes() {
    let some = |at: u32| 1.5 + f32::from(random(at)) / 7.0;
    // In how many of twenty messages the number is another.
    for (other, count, expected) in [
        (1e20, 0, true),
        (1e20, 3, true),
        (1e20, 4, false),
        (1e-20, 4, false),
        (0.0, 9, true),
        (0.0, 10, false),
    ] {
        let values = (0..20).map(|at| if at < count { other } else { some(at) });
        for (order, write) in [("little", f32::to_le_bytes as fn(f32) -> [u8; 4]), ("big", f32::to_be_bytes)]
        {
            let messages = of(values.clone(), |_, value| [&[0xAA][..], &write(value)].concat());
            let found = told(&messages).contains(&format!("numbers f32 {order} at 1"));
            assert_eq!(found, expected, "{order} {other} {count}: {messages:02X?}");
        }
    }
}

#[test]
fn no_field_has_bytes_of_another_or_of_a_mark() {
    let real = |at: u32| 1.5 + f32::from(random(at)) / 7.0;
    let message = |at: u32, value: u16| {
        let [count, ..] = at.to_le_bytes();
        let number = real(at).to_le_bytes();
        [&[0xAA][..], &number, &value.to_be_bytes(), &[random(at + 50), count]].concat()
    };
    let messages = of(steps(3044, &[7; 20]), message);
    assert_eq!(told(&messages), "begin AA; counter u8 big at 8; numbers f32 little at 1, i16 big at 5");
    let messages = of(0..20, |_, at| vec![0xAA, random(at), random(at + 30), random(at + 60), 0x42]);
    assert_eq!(told(&messages), "begin AA; end 42");
}

#[test]
fn a_byte_of_the_marks_is_doubled_inside() {
    // Of how many messages the byte is doubled in how many, and how often it is alone.
    for (count, pairs, singles, expected) in [
        (11, 1, 0, false),
        (11, 2, 0, true),
        (11, 2, 13, true),
        (11, 3, 14, false),
        (25, 2, 29, false),
        (25, 3, 30, true),
    ] {
        let messages = of(0..count, |_, at| {
            let pair: &[u8] = if at < pairs { &[0x10, 0x10, 0] } else { &[] };
            let single = [0x10, 0].repeat((singles + count - 1 - at) / count);
            [&[0x10, 2, 1, 7, 7][..], pair, &single, &[0x10, 3]].concat()
        });
        let messages: Vec<&[u8]> = messages.iter().map(Vec::as_slice).collect();
        let found = messages::doubled(&messages, 2, &[0x10, 3]);
        assert_eq!(found, expected.then_some(0x10), "{count} {pairs} {singles}");
    }
}

#[test]
fn arrivals_of_nothing_divide_nothing() {
    let arrivals = (0..12).map(|at| (3, Duration::from_millis(at))).collect();
    let stream = Stream { sender: Sender::Unknown, parts: vec![b"\x01\x02\x03".to_vec()], arrivals };
    assert!(look(&[stream]).is_empty());
    assert!(look(&[]).is_empty());
}
