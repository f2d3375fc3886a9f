//! The checks that are found in messages which were built with a check.
#![allow(clippy::unwrap_used, clippy::indexing_slicing)]

use super::super::tests::bytes;
use super::*;

type Row = (&'static str, usize, &'static str, usize, usize, usize, u32);

fn check((kind, width, order, from_end, first, before, constant): Row) -> Check {
    Check { kind: kind.into(), width, order, from_end, first, before, constant, once: false }
}

fn found(messages: &[Vec<u8>], end: usize, doubled: Option<u8>) -> Option<Check> {
    find(&messages.iter().map(Vec::as_slice).collect::<Vec<_>>(), end, doubled)
}

fn sum(bytes: &[u8]) -> u32 {
    bytes.iter().map(|it| u32::from(*it)).sum()
}

/// Returns twenty messages of different lengths with a check as `check` states; beside it are bytes that nothing checks.
fn checked(check: &Check, of: &dyn Fn(&[u8]) -> u32) -> Vec<Vec<u8>> {
    let message = |at: u32| {
        let body = bytes(at, 4 + usize::try_from(at % 5).unwrap());
        let value = of(&body);
        let value = match (check.order, check.width) {
            ("hex", 2) => format!("{:02X}", value & 0xFF).into_bytes(),
            ("hex", _) => format!("{:04x}", value & 0xFFFF).into_bytes(),
            ("big", width) => value.to_be_bytes()[4 - width..].to_vec(),
            (_, width) => value.to_le_bytes()[..width].to_vec(),
        };
        let [head, between, tail] = [(20, check.first), (40, check.before), (60, check.from_end)]
            .map(|(from, count)| bytes(at + from, count));
        [head, body, between, value, tail].concat()
    };
    (0..20).map(message).collect()
}

#[test]
fn sums_and_xors_are_found_wherever_they_are() {
    let rows: [Row; 15] = [
        ("sum", 1, "little", 0, 0, 0, 0),
        ("sum", 1, "little", 3, 8, 3, 0),
        ("sum", 1, "little", 0, 1, 0, 0x5A),
        ("sum", 2, "little", 0, 2, 0, 0),
        ("sum", 2, "big", 0, 0, 2, 0x1234),
        ("sum", 4, "big", 0, 3, 1, 0),
        ("sum", 2, "hex", 2, 1, 1, 0),
        ("sum", 4, "hex", 0, 0, 0, 0),
        ("negated sum", 1, "little", 0, 0, 0, 0),
        ("negated sum", 1, "little", 1, 2, 0, 1),
        ("negated sum", 2, "big", 0, 1, 0, 0xFFFF),
        ("negated sum", 4, "hex", 1, 0, 0, 0),
        ("xor", 1, "little", 2, 1, 0, 0),
        ("xor", 1, "little", 0, 0, 0, 0xFF),
        ("xor", 2, "hex", 2, 1, 1, 0),
    ];
    for row in rows {
        let check = check(row);
        let of = |body: &[u8]| match check.kind.as_str() {
            "sum" => sum(body) + check.constant,
            "negated sum" => check.constant.wrapping_sub(sum(body)),
            _ => u32::from(body.iter().fold(0, |xor, byte| xor ^ byte)) ^ check.constant,
        };
        let messages = checked(&check, &of);
        // The end mark is where the check is searched for first, and not only.
        for end in [0, check.from_end] {
            assert_eq!(found(&messages, end, None), Some(check.clone()));
        }
    }
}

#[test]
fn every_crc_is_found_by_its_name_in_the_catalogue() {
    let orders = ["little", "big"];
    for (crc, order) in ALL.iter().flat_map(|crc| orders.map(|order| (crc, order))) {
        let (width, (_, name)) = (usize::from(crc.bits / 8), crc.name[4..].split_once('_').unwrap());
        let kind = format!("CRC-{}/{}", crc.bits, name.replace('_', "-"));
        let order = if width == 1 { "little" } else { order };
        let check = Check { kind, ..check(("", width, order, 1, 2, 0, 0)) };
        assert_eq!(found(&checked(&check, &|body| crc.of_bytes(body)), 1, None), Some(check));
    }
}

#[test]
fn a_zero_before_a_check_is_no_part_of_it() {
    let crc = ALL.iter().find(|it| it.name == "CRC_8_SMBUS").unwrap();
    let before = |at: u32| bytes(at, 4 + usize::try_from(at % 5).unwrap());
    let messages = |of: &dyn Fn(&[u8]) -> u8| -> Vec<Vec<u8>> {
        (0..20).map(|at| [before(at), vec![0, of(&before(at))]].concat()).collect()
    };
    let xor = messages(&|body| body.iter().fold(0, |xor, byte| xor ^ byte));
    assert_eq!(found(&xor, 0, None), Some(check(("xor", 1, "little", 0, 0, 0, 0))));
    let crc = messages(&|body| crc.of_bytes(body).to_le_bytes()[0]);
    assert_eq!(found(&crc, 0, None), Some(check(("CRC-8/SMBUS", 1, "little", 0, 0, 1, 0))));
}

#[test]
fn a_byte_that_is_doubled_counts_once_or_twice() {
    for once in [true, false] {
        let message = |at: u32| {
            let body = [vec![0x10; 2], bytes(at, 3)].concat();
            let sum = sum(&body[usize::from(once)..]).to_le_bytes()[0];
            [body, vec![sum]].concat()
        };
        let messages: Vec<Vec<u8>> = (0..20).map(message).collect();
        let check = Check { once, ..check(("sum", 1, "little", 0, 0, 0, 0)) };
        assert_eq!(found(&messages, 0, Some(0x10)), Some(check));
    }
}

#[test]
fn a_few_messages_or_values_show_no_check() {
    let sum = check(("sum", 1, "little", 0, 0, 0, 0));
    let messages = checked(&sum, &super::tests::sum);
    // The same again is not another message.
    let repeated = |different: usize| [&messages[..different]; 5].concat();
    assert_eq!(found(&repeated(3), 0, None), None);
    assert_eq!(found(&repeated(4), 0, None), Some(sum.clone()));
    // The last byte is that before it, which has as many values.
    let values = |count: u32| -> Vec<Vec<u8>> {
        (0..20).map(|at| [bytes(at, 1), bytes(at % count, 1).repeat(2)].concat()).collect()
    };
    assert_eq!(found(&values(2), 0, None), None);
    assert_eq!(found(&values(3), 0, None), Some(Check { first: 1, ..sum }));
    // Nothing checks these.
    let none: Vec<Vec<u8>> = (0..20).map(|at| bytes(at, 4 + usize::try_from(at % 5).unwrap())).collect();
    assert_eq!(found(&none, 0, None), None);
}

#[test]
fn a_check_may_be_wrong_in_some_messages() {
    let sum = check(("sum", 1, "little", 0, 0, 0, 0));
    let wrong = |places: &[usize]| {
        let mut messages = checked(&sum, &super::tests::sum);
        places.iter().zip(1..).for_each(|(at, by)| messages[*at][0] ^= 16 * by);
        found(&messages, 0, None)
    };
    assert_eq!(wrong(&[0, 2, 4]), Some(sum.clone()));
    assert_eq!(wrong(&[17, 18, 19]), Some(sum.clone()));
    assert_eq!(wrong(&[16, 17, 18, 19]), None);
}

#[test]
fn what_checks_nothing_in_most_messages_is_no_check() {
    // A flag after three bytes, and in a few messages after twelve.
    let flag = |at: u32| {
        [bytes(at, if at < 34 { 3 } else { 12 }), vec![u8::try_from(at.saturating_sub(33)).unwrap()]]
    };
    let flags: Vec<Vec<u8>> = (0..40).map(|at| flag(at).concat()).collect();
    assert_eq!(found(&flags, 0, None), None);
    // A sum of the bytes after the first two: none in every second message.
    let message = |at: u32| {
        let body = bytes(at + 20, if at.is_multiple_of(2) { 0 } else { 5 });
        let sum = sum(&body).to_le_bytes()[0];
        [bytes(at, 2), body, vec![sum]].concat()
    };
    let messages: Vec<Vec<u8>> = (0..20).map(message).collect();
    assert_eq!(found(&messages, 0, None), Some(check(("sum", 1, "little", 0, 2, 0, 0))));
}
