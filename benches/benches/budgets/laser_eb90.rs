//! laser-eb90: a batch of seven six-axis moves, and the 16 ms cycle of the controller.

use std::hint::black_box;

use benches::{Budget, Count, Link};
use laser_eb90::{Decoder, Frame, Item, MAX_PAYLOAD, Payload, Profile};

pub const LINK: Link = Link { name: "laser-eb90", counts: COUNTS, budgets };

const MOVE: u16 = 0x0160;
const AXES: [f32; 6] = [100.0, -50.5, 250.0, 0.0, 90.0, -45.25];
const BATCH_LEN: usize = 217;

const COUNTS: &[Count] = &[
    Count {
        what: "217-byte batch: unstuff, sum, check, read 7 words and 42 floats",
        goal: Some(2.5),
        units: BATCH_LEN as f64,
        unit: "byte",
        run: decode,
    },
    Count {
        what: "the same from a stream, through the decoder",
        goal: None,
        units: BATCH_LEN as f64,
        unit: "byte",
        run: stream,
    },
    Count { what: "217-byte batch: write", goal: None, units: BATCH_LEN as f64, unit: "byte", run: encode },
];

fn batch() -> Vec<u8> {
    let mut buffer = [0; MAX_PAYLOAD];
    let mut payload = Payload::new(&mut buffer, &Profile::default());
    for _ in 0..7 {
        payload.word(MOVE).and_then(|p| p.f32(&AXES)).expect("a batch has room");
    }
    let frame = payload.frame().expect("seven instructions");
    let mut out = vec![0; frame.encoded_len()];
    frame.encode(&mut out).expect("as long as it says");
    assert_eq!(out.len(), BATCH_LEN);
    out
}

/// Seven words and 42 floats, read as their types.
fn read(frame: &Frame<'_>) {
    for item in frame.items() {
        match item {
            Ok(Item::I16(values)) => drop(values.array::<1>().map(black_box)),
            Ok(Item::F32(values)) => drop(values.array::<6>().map(black_box)),
            other => panic!("{other:?}"),
        }
    }
}

fn decode(rounds: u64) {
    let (bytes, profile) = (batch(), Profile::default());
    let mut payload = [0; MAX_PAYLOAD];
    for _ in 0..rounds {
        let frame = Frame::decode(black_box(&bytes), &mut payload, black_box(&profile));
        let Ok(Some((frame, BATCH_LEN))) = frame else { panic!("{frame:?}") };
        read(&frame);
    }
}

fn stream(rounds: u64) {
    let bytes = batch();
    let mut decoder = Decoder::new(&Profile::default());
    for _ in 0..rounds {
        decoder.push(black_box(&bytes));
        let Some(Ok(frame)) = decoder.next_frame() else { panic!("the batch is whole") };
        read(&frame);
    }
}

fn encode(rounds: u64) {
    let mut buffer = [0; MAX_PAYLOAD];
    let mut out = [0; Frame::MAX_LEN];
    for _ in 0..rounds {
        let mut payload = Payload::new(&mut buffer, &Profile::default());
        for _ in 0..7 {
            payload.word(black_box(MOVE)).and_then(|p| p.f32(black_box(&AXES))).expect("a batch has room");
        }
        let frame = payload.frame().expect("seven instructions");
        black_box(frame.encode(&mut out)).expect("long enough");
    }
}

fn budgets() -> Vec<Budget> {
    Vec::new()
}
