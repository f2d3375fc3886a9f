//! fanuc-ls: the source's listing, read and written; and the kinematics of its arm.

use std::hint::black_box;

use benches::{Count, Link, Timing};
use cellwire_motion::{Arm, Kinematics};
use fanuc_ls::{Document, Program, Rules};

const TEXT: &str = include_str!("../../../reference/ls/figure-4.canonical.ls");

pub(super) const LINK: Link = Link {
    name: "fanuc-ls",
    counts: &[
        Count::byte("read the source's listing as it is", TEXT.len(), document)
            .goal(25.0)
            .timed("decode-document", Timing::OURS),
        Count::byte("read it as values", TEXT.len(), read).goal(25.0).timed("decode", Timing::OURS),
        Count::byte("… by hand: its numbers alone", TEXT.len(), numbers_by_hand)
            .timed("decode", "by hand, its numbers alone"),
        Count::byte("write the values", TEXT.len(), write).goal(25.0).timed("encode", Timing::OURS),
        Count::op("forward kinematics", forward),
    ],
    ..Link::EMPTY
};

fn document(rounds: u64) {
    for _ in 0..rounds {
        black_box(Document::decode(black_box(TEXT)).expect("the listing reads"));
    }
}

fn read(rounds: u64) {
    for _ in 0..rounds {
        black_box(Program::decode(black_box(TEXT)).expect("the listing reads"));
    }
}

/// Reads every number of the listing, in the order of the text, without its meaning.
fn numbers_by_hand(rounds: u64) {
    const POWERS: [f64; 4] = [1.0, 10.0, 100.0, 1000.0];
    for _ in 0..rounds {
        let (mut numbers, mut rest) = (Vec::with_capacity(128), black_box(TEXT).as_bytes());
        while let [first, after @ ..] = rest {
            rest = after;
            if !matches!(first, b'-' | b'.' | b'0'..=b'9') {
                continue;
            }
            let (mut whole, mut decimals, mut is_point) = (0u32, 0, *first == b'.');
            if first.is_ascii_digit() {
                whole = u32::from(first - b'0');
            }
            while let [byte @ (b'.' | b'0'..=b'9'), after @ ..] = rest {
                match byte {
                    b'.' => is_point = true,
                    digit => {
                        whole = whole * 10 + u32::from(digit - b'0');
                        decimals += usize::from(is_point);
                    }
                }
                rest = after;
            }
            let value = f64::from(whole) / POWERS[decimals];
            numbers.push(if *first == b'-' { -value } else { value });
        }
        black_box(numbers);
    }
}

fn write(rounds: u64) {
    let program = Program::decode(TEXT).expect("the listing reads");
    for _ in 0..rounds {
        black_box(black_box(&program).to_text(&Rules::default()).expect("it can be written"));
    }
}

fn forward(rounds: u64) {
    for _ in 0..rounds {
        black_box(Arm::LR_MATE_200ID.forward(black_box(&[10.0, 20.0, 30.0, 40.0, 50.0, 60.0])));
    }
}
