//! The division of streams, the evidence for a division, and the whole report of some small protocols.
#![allow(clippy::unwrap_used, clippy::indexing_slicing)]

use serde_json::{Value, json};

use super::super::super::Sender;
use super::super::look;
use super::super::tests::bytes;
use super::*;

fn of_bytes(bytes: &[u8]) -> Stream {
    Stream { sender: Sender::Unknown, parts: vec![bytes.to_vec()], arrivals: vec![] }
}

#[test]
fn a_pause_is_twice_as_long_as_others_and_not_rare() {
    assert_eq!(pauses(&[]), Vec::<Vec<usize>>::new());
    for (long, count, is_pause) in [(20, 5, true), (19, 5, false), (200, 4, false), (200, 1, false)] {
        let mut time = 0;
        let arrival = |at: usize| {
            time += if at.is_multiple_of(3) && at > 0 && at / 3 <= count { long } else { 10 };
            (at * 8, Duration::from_millis(time))
        };
        let arrivals: Vec<(usize, Duration)> = (0..20).map(arrival).collect();
        let mut expected = vec![(0..20).map(|at| at * 8).collect::<Vec<usize>>()];
        if is_pause {
            expected.push((0..=count).map(|at| at * 24).collect());
        }
        assert_eq!(pauses(&arrivals), expected, "{long} {count}");
    }
}

#[test]
fn the_most_frequent_strings_are_marks() {
    let bytes: Vec<u8> = (0x80..0xC0).collect();
    assert_eq!(marks(&Symbols::of(&[bytes.repeat(4)])), Vec::<Vec<u32>>::new());
    // Of those that come as often, the first.
    let expected: Vec<Vec<u32>> =
        (1..=4).flat_map(|length| (0..8 * length).map(move |from| (from..from + length).collect())).collect();
    assert_eq!(marks(&Symbols::of(&[bytes.repeat(5)])), expected);
}

#[test]
fn a_text_is_cut_before_and_behind_a_mark() {
    let cuts = |text: &[u8]| -> Vec<Vec<Vec<usize>>> {
        let symbols = Symbols::of(&[text.to_vec()]);
        let mark = &symbols.parts[0].symbols[1..2];
        cut(&symbols, mark).into_iter().map(|it| it.cuts).collect()
    };
    let places = |from: usize| (from..42).step_by(2).collect::<Vec<usize>>();
    // The first line is one if a tenth of the others begin as it does.
    let lines = |same: usize| [b"x;".repeat(1 + same), b"y;".repeat(20 - same)].concat();
    assert_eq!(cuts(&lines(1)), [[places(1)], [[places(2), vec![42]].concat()]]);
    assert_eq!(cuts(&lines(2)), [[places(1)], [[places(0), vec![42]].concat()]]);
    assert_eq!(cuts(&[1, 2].repeat(21)), [[places(1)]]);
}

fn bounds(messages: &[&[u8]], whole: bool) -> (Symbols, Bounds) {
    let mut cuts = vec![0];
    messages.iter().for_each(|it| cuts.push(cuts[cuts.len() - 1] + it.len()));
    cuts.truncate(if whole { messages.len() } else { cuts.len() });
    (Symbols::of(&[messages.concat()]), Bounds { cuts: vec![cuts], whole })
}

#[test]
fn a_packet_without_bytes_is_no_message() {
    for whole in [true, false] {
        let (symbols, bounds) = bounds(&[&[1, 2], &[], &[3, 4, 5], &[]], whole);
        let messages: Vec<(usize, usize)> =
            bounds.messages(&symbols).map(|(_, from, to)| (from, to)).collect();
        assert_eq!(messages, [(0, 2), (2, 5)]);
    }
}

/// A value saves the logarithm of its share among the values at its place by its share in the stream; each beside 2 of the prior.
#[test]
fn the_bits_that_a_division_saves() {
    let bits = |messages: &[&[u8]], whole: bool, kind: Option<usize>| {
        let (symbols, bounds) = bounds(messages, whole);
        score(&symbols, &bounds, &[kind])
    };
    let same: [&[u8]; 2] = [&[1, 2], &[1, 3]];
    let of_kinds: Vec<&[u8]> = [&[1, 3][..], &[2, 4]].repeat(4);
    let of_one: [&[u8]; 2] = [&[1, 3], &[2, 3]];
    let rows = [
        // 1, 1 at the first place; 2, 3 at the last one save nothing.
        (bits(&same, true, None), (4.0_f64 / 3.0).log2()),
        // Their lengths, 2 and 2 of at most 2.
        (bits(&same, false, None), 2.0 * (4.0_f64 / 3.0).log2() - 2.0),
        // Each byte is at one place, of the beginning or of the end.
        (bits(&[&[1, 2, 3], &[1, 4, 3]], true, None), 2.0 * (5.0_f64 / 3.0).log2()),
        (bits(&[&[1, 3], &[1, 4, 5, 3]], true, None), 2.0 * (5.0_f64 / 3.0).log2()),
        // 1, 2, 1, 2 … and 3, 4, 3, 4 …
        (bits(&of_kinds, true, None), 2.0 * (70.0_f64 / 9.0).log2()),
        // 3, 3 … if the first byte is 1, 4, 4 … if it is 2, less the cost of the dependence.
        (bits(&of_kinds, true, Some(0)), (70.0_f64 / 9.0).log2() + 2.0 * 14_f64.log2() - 3.0),
        // The place of the kind does not depend on itself.
        (bits(&of_one.repeat(4), true, Some(0)), (70.0_f64 / 9.0).log2() + (256.0_f64 / 9.0).log2()),
        // There is no such position.
        (bits(&of_kinds, true, Some(2)), 2.0 * (70.0_f64 / 9.0).log2()),
    ];
    for (at, (found, expected)) in rows.into_iter().enumerate() {
        assert!((found - expected).abs() < 1e-9, "{at}: {found}, not {expected}");
    }
}

#[test]
fn what_speaks_for_a_division() {
    let rank = |messages: &[&[u8]], arrivals: &[usize]| {
        let (symbols, bounds) = bounds(messages, false);
        bounds.division(&symbols, &[vec![arrivals.to_vec()]]).rank
    };
    // Seven places of ten, and of eleven.
    let binary: Vec<&[u8]> = vec![&[1, 2, 3]; 9];
    let together = [0, 3, 6, 9, 12, 15, 18];
    let of_binary = DivisionRank { together: true, begins: true, closes: false, alike: 100, marks: 3 };
    assert_eq!(rank(&binary, &together), of_binary);
    assert_eq!(
        rank(&binary, &[&together[..], &[20]].concat()),
        DivisionRank { together: false, ..of_binary }
    );
    let closing = |byte| rank(&[&[b'a', byte], &[b'b', byte], &[b'c', byte]], &[]).closes;
    assert_eq!([b'\n', b'}', b'k'].map(closing), [true, true, false]);
    // One of ten begins otherwise, and one ends otherwise.
    let mut messages: Vec<&[u8]> = vec![&[1, 2, 3, 4]; 10];
    (messages[0], messages[1]) = (&[1, 9, 3, 4], &[1, 2, 3, 9]);
    let expected = DivisionRank { together: false, begins: true, closes: false, alike: 80, marks: 4 };
    assert_eq!(rank(&messages, &[]), expected);
}

fn report(bytes: &[u8]) -> Value {
    serde_json::to_value(look(&[of_bytes(bytes)])).unwrap()
}

/// Returns the report of messages with only these properties, and those in `other`.
fn seen(messages: usize, lengths: [usize; 2], marks: [&str; 2], other: &Value) -> Value {
    let mut seen = json!({"messages": messages, "lengths": lengths, "begin": marks[0], "end": marks[1], "doubled": null,
        "constant": [], "check": null, "length": null, "counters": [], "numbers": []});
    other.as_object().unwrap().iter().for_each(|(name, value)| seen[name] = value.clone());
    json!([seen])
}

fn sum_at(from_end: usize, first: usize) -> Value {
    json!({"kind": "sum", "width": 1, "order": "little", "from_end": from_end, "first": first, "before": 0, "constant": 0,
        "once": false})
}

fn sum(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0, |sum, byte| sum.wrapping_add(*byte))
}

/// Returns a counter and three bytes between marks, with their sum.
fn framed(at: u8) -> Vec<u8> {
    let body = [&[at + 10][..], &bytes(at.into(), 3)].concat();
    [&[2], &body[..], &[sum(&body), 3]].concat()
}

#[test]
fn frames_are_seen_from_five_on_and_between_noise() {
    let other = |place: usize| {
        let counter = json!({"at": place, "type": "u8", "order": "big"});
        json!({"check": sum_at(2 - place, place), "counters": [counter]})
    };
    let frames: Vec<u8> = (0..40).flat_map(framed).collect();
    let expected = |count: usize| seen(count, [7, 7], ["02", "03"], &other(1));
    // A frame is whole where the next one begins.
    assert_eq!(report(&frames[..35]), json!([]));
    assert_eq!(report(&frames[..36]), expected(5));
    assert_eq!(report(&frames), expected(39));
    assert_eq!(report(&frames[..frames.len() - 3]), expected(39));
    // Three bytes of noise follow some frames: both marks then begin messages, because the bytes after the end are not the
    // frame's.
    let noise = |at: u8| if at % 13 == 7 { bytes(100, 3) } else { vec![] };
    let frames = (0..40).flat_map(|at| [framed(at), noise(at)].concat());
    let frames: Vec<u8> = bytes(99, 5).into_iter().chain(frames).collect();
    assert_eq!(report(&frames), seen(35, [7, 17], ["03 02", ""], &other(2)));
}

#[test]
fn a_mark_of_the_same_byte_twice_begins_one_message() {
    let message = |at: u8| [&[0x7E, 0x7E][..], &bytes(at.into(), 3 + usize::from(at % 4)), &[0x10]].concat();
    let messages: Vec<u8> = (0..40).flat_map(message).collect();
    assert_eq!(report(&messages), seen(39, [6, 9], ["7E 7E", "10"], &json!({})));
}

#[test]
fn the_sum_of_a_counter_is_no_counter() {
    let message = |at: u16| {
        let body = [&[0xAA, 0x55][..], &(at + 230).to_be_bytes()].concat();
        [&body[..], &[sum(&body)]].concat()
    };
    let other = json!({"check": sum_at(0, 0), "counters": [{"at": 2, "type": "u16", "order": "big"}]});
    let messages: Vec<u8> = (0..40).flat_map(message).collect();
    assert_eq!(report(&messages), seen(39, [5, 5], ["AA 55", ""], &other));
}

#[test]
fn a_check_says_more_than_a_longer_mark() {
    let message = |at: u32| {
        let body = [&[0xAA][..], &bytes(at, 3), &[0x81, 0x82], &bytes(at + 50, 3)].concat();
        [&body[..], &[sum(&body)]].concat()
    };
    let messages: Vec<u8> = (0..40).flat_map(message).skip(1).collect();
    let numbers =
        [(3, "little"), (5, "big")].map(|(at, order)| json!({"at": at, "type": "i16", "order": order}));
    let other = json!({"constant": [[4, 0x81], [5, 0x82]], "check": sum_at(0, 0), "numbers": numbers});
    assert_eq!(report(&messages), seen(38, [10, 10], ["AA", ""], &other));
}

#[test]
fn lines_begin_behind_the_end_of_others() {
    let line = |at: u32| {
        let word = ["START", "STOP", "MOVE", "OPEN"][usize::from(bytes(at, 1)[0] % 4)];
        format!("{word} {},{}\n", at + 5, bytes(at, 2)[1]).into_bytes()
    };
    let lines: Vec<u8> = (0..40).flat_map(line).skip(3).collect();
    let other = json!({"counters": [{"at": 0, "type": "digits", "order": "big"}]});
    assert_eq!(report(&lines), seen(39, [10, 13], ["", "0A"], &other));
}

#[test]
fn bytes_that_never_come_again_show_nothing() {
    let arrivals = (0..6).map(|at| (8 * at, Duration::ZERO)).collect();
    assert!(look(&[Stream { arrivals, ..of_bytes(&(0x80..0xB0).collect::<Vec<u8>>()) }]).is_empty());
}

/// Returns messages of a mark, one of two words, and a number of bytes that depends on the word.
fn of_kinds(mark: &[u8], count: u32) -> Vec<u8> {
    let message = |at: u32| {
        let kind = bytes(at, 1)[0] % 2;
        [mark, &bytes(1000 + u32::from(kind), 2), &bytes(at + 500, 1 + usize::from(kind))].concat()
    };
    (0..count).flat_map(message).collect()
}

#[test]
fn divisions_that_are_nearly_as_good_are_kept_in_the_same_order_each_time() {
    let divisions = |bytes: &[u8]| -> Vec<(usize, u8)> {
        divide(&of_bytes(bytes)).iter().map(|it| (it.messages.len(), it.messages[0][0])).collect()
    };
    let frames: Vec<u8> = (0..40).flat_map(framed).collect();
    for _ in 0..16 {
        let expected = [(59, 0x90), (59, 0x90), (29, 0xDC), (29, 0x2D)];
        assert_eq!(divisions(&of_kinds(&[0x90, 0x91], 60)), expected);
        assert_eq!(divisions(&frames), [(39, 2), (39, 3), (38, 3)]);
    }
}

#[test]
fn messages_of_two_kinds_begin_with_the_mark_of_both() {
    let other = json!({"numbers": [{"at": 2, "type": "i16", "order": "big"}]});
    assert_eq!(report(&of_kinds(&[0x90], 40)), seen(39, [4, 5], ["90", ""], &other));
}
