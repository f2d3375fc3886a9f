//! Messages that no link has.
#![allow(clippy::unwrap_used, clippy::indexing_slicing)]

use std::time::Duration;

use super::super::Sender;
use super::*;

fn look_at(messages: impl Iterator<Item = Vec<u8>>) -> Seen {
    let stream =
        Stream { sender: Sender::Unknown, parts: vec![messages.flatten().collect()], arrivals: vec![] };
    look(&[stream]).remove(0)
}

/// Numbers that repeat in no short time.
fn noise(at: u32) -> u8 {
    u8::try_from(at.wrapping_mul(2_654_435_761).rotate_left(9) >> 24).unwrap()
}

/// As many bytes of a message as are given, of which none follows from the others.
pub(super) fn random(message: u32, count: usize) -> Vec<u8> {
    let mix = |at: u32| {
        let mixed = at.wrapping_mul(2_654_435_761);
        (mixed ^ mixed >> 15).wrapping_mul(2_246_822_519).to_be_bytes()[0]
    };
    (message * 64..).take(count).map(mix).collect()
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

/// Nothing is the same in these messages but their beginning, which is no mark: it is everywhere.
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
