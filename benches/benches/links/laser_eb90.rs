//! laser-eb90: a batch of seven six-axis moves, and the 16 ms cycle of the controller.

use core::time::Duration;
use std::hint::black_box;

use benches::{Budget, Count, Link, Ratio, Timing};
use laser_eb90::robot_session::{Decoder as _, Encode as _, Session as _};
use laser_eb90::{
    Controller, ControllerConfig, ControllerEvent, Decoder, Frame, Host, HostConfig, HostEvent, Instruction,
    Item, MAX_PAYLOAD, Payload, Profile, timing,
};

use super::streams::{self, Decoding};

const MOVE: u16 = 0x0160;
const AXES: [f32; 6] = [100.0, -50.5, 250.0, 0.0, 90.0, -45.25];
/// The third is 00 00 90 41.
const STUFFED: [f32; 6] = [100.0, -50.5, 18.0, 0.0, 90.0, -45.25];
const BATCH_LEN: usize = 217;
const ECHO_LEN: usize = 11;

const MOVE_WRITTEN: &str = "one move: built and written";
const ECHO_READ: &str = "its echo from a stream, through the decoder";
const HOST: &str = "host: submit the move, send it, receive its echo";

pub(super) const LINK: Link = Link {
    name: "laser-eb90",
    counts: &[
        batch_row("217-byte batch: unstuffed, summed, 14 items by their types", |rounds| {
            decode(rounds, &AXES, view);
        })
        .goal(2.5),
        batch_row("the same, and its 7 words and 42 floats read", |rounds| decode(rounds, &AXES, read))
            .goal(2.8)
            .timed("decode", Timing::OURS),
        batch_row("the same with a 90h to unstuff in each instruction", |rounds| {
            decode(rounds, &STUFFED, read);
        })
        .goal(6.0)
        .timed("decode-stuffed", Timing::OURS),
        batch_row("… by hand, byte by byte", |rounds| by_hand(rounds, &STUFFED))
            .timed("decode-stuffed", Timing::BY_HAND),
        batch_row("… by hand, without a byte to unstuff", |rounds| by_hand(rounds, &AXES))
            .timed("decode", Timing::BY_HAND),
        batch_row("the same from a stream, through the decoder", stream),
        Count::op(MOVE_WRITTEN, write_move),
        Count::op(ECHO_READ, stream_echo),
        Count::op(HOST, exchange).timed("host", Timing::OURS),
        Count::op("controller: receive the move, queue it, send its echo", queue)
            .timed("controller", Timing::OURS),
        batch_row("217-byte batch: write", encode).timed("encode", Timing::OURS),
    ],
    ratios: &[Ratio { what: HOST, times: 2.0, of: &[MOVE_WRITTEN, ECHO_READ] }],
    streams: &[streams::rows::<Batches>()],
    budgets,
    ..Link::EMPTY
};

const fn batch_row(what: &'static str, run: fn(u64)) -> Count {
    Count::byte(what, BATCH_LEN, run)
}

struct Batches;

impl Decoding for Batches {
    type Decoder = Decoder;
    const LEN: usize = BATCH_LEN;
    const FRAMES: usize = 1;

    fn decoder() -> Decoder {
        Decoder::new(&Profile::default())
    }

    fn valid() -> Vec<u8> {
        batch(&AXES)
    }

    /// Heads, each with a tag and a byte that is not doubled.
    fn worst() -> Vec<u8> {
        streams::repeated(&[0xEB, 0x90, 0x82, 0xF0, 0xF1, 0x90, 0x00])
    }
}

fn batch(axes: &[f32; 6]) -> Vec<u8> {
    let mut buffer = [0; MAX_PAYLOAD];
    let mut payload = Payload::new(&mut buffer, &Profile::default());
    for _ in 0..7 {
        payload.word(MOVE).and_then(|p| p.f32(axes)).expect("a batch has room");
    }
    let frame = payload.frame().expect("seven instructions");
    let mut out = vec![0; frame.encoded_len()];
    frame.encode(&mut out).expect("as long as it says");
    assert_eq!(out.len(), if *axes == AXES { BATCH_LEN } else { BATCH_LEN + 7 });
    out
}

/// Reads seven words and 42 floats as their types.
#[inline(always)]
fn read(frame: &Frame<'_>) {
    for item in frame.items() {
        match item {
            Ok(Item::I16(values)) => drop(values.array::<1>().map(black_box)),
            Ok(Item::F32(values)) => drop(values.array::<6>().map(black_box)),
            other => panic!("{other:?}"),
        }
    }
}

/// Reads each of the 14 items by its type and its number of values, but not the numbers.
#[inline(always)]
fn view(frame: &Frame<'_>) {
    let (mut words, mut floats) = (0, 0);
    for item in frame.items() {
        match item {
            Ok(Item::I16(values)) => words += values.len(),
            Ok(Item::F32(values)) => floats += values.len(),
            other => panic!("{other:?}"),
        }
    }
    assert!(words == 7 && floats == 42);
}

#[inline(always)]
fn decode(rounds: u64, axes: &[f32; 6], look: impl Fn(&Frame<'_>)) {
    let (bytes, profile) = (batch(axes), Profile::default());
    let mut payload = [0; MAX_PAYLOAD];
    for _ in 0..rounds {
        match Frame::decode(black_box(&bytes), &mut payload, black_box(&profile)) {
            Ok(Some((frame, _))) => look(&frame),
            other => panic!("{other:?}"),
        }
    }
}

fn stream(rounds: u64) {
    let bytes = batch(&AXES);
    let mut decoder = Decoder::new(&Profile::default());
    for _ in 0..rounds {
        let _ = decoder.push(black_box(&bytes));
        let Some(Ok(frame)) = decoder.next_frame() else { panic!("the batch is whole") };
        read(&frame);
    }
}

/// Makes the same checks for this one profile, and examines each byte once.
fn by_hand(rounds: u64, axes: &[f32; 6]) {
    let bytes = batch(axes);
    let mut payload = [0; MAX_PAYLOAD];
    for _ in 0..rounds {
        let rest = black_box(&bytes[..]).strip_prefix(&[0xEB, 0x90, 0x82, 0xF0]).expect("a head");
        let (mut length, mut sum, mut bytes) = (0, 0u8, rest.iter());
        loop {
            let byte = *bytes.next().expect("a tail");
            if byte == 0x90 {
                match bytes.next() {
                    Some(0x90) => {}
                    Some(0x82) => break,
                    _ => panic!("not doubled"),
                }
            }
            *payload.get_mut(length).expect("room") = byte;
            length += 1;
            sum = sum.wrapping_add(byte);
        }
        assert_eq!(bytes.next(), Some(&sum));
        let mut rest = &payload[..length];
        while let [tag, count, values @ ..] = rest {
            let size = match tag {
                0xF0 => 4,
                0xF1 => 2,
                _ => panic!("no such item"),
            };
            let (values, after) = values.split_at(size * usize::from(*count));
            if size == 4 {
                let (values, _) = values.as_chunks();
                black_box(<[[u8; 4]; 6]>::try_from(values).expect("six axes").map(f32::from_le_bytes));
            } else {
                black_box(i16::from_le_bytes(values.try_into().expect("a word")));
            }
            rest = after;
        }
    }
}

fn write_move(rounds: u64) {
    let mut buffer = [0; MAX_PAYLOAD];
    let mut out = [0; Frame::MAX_LEN];
    for _ in 0..rounds {
        let mut payload = Payload::new(&mut buffer, &Profile::default());
        payload.word(black_box(MOVE)).and_then(|p| p.f32(black_box(&AXES))).expect("room");
        black_box(payload.frame().expect("a move").encode(black_box(&mut out))).expect("long enough");
    }
}

fn echo() -> Vec<u8> {
    let mut buffer = [0; MAX_PAYLOAD];
    let mut payload = Payload::new(&mut buffer, &Profile::default());
    payload.word(MOVE).expect("room");
    let mut out = vec![0; ECHO_LEN];
    assert_eq!(payload.frame().expect("a word").encode(&mut out), Ok(ECHO_LEN));
    out
}

fn stream_echo(rounds: u64) {
    let bytes = echo();
    let mut decoder = Decoder::new(&Profile::default());
    for _ in 0..rounds {
        let _ = decoder.push(black_box(&bytes));
        let Some(Ok(frame)) = decoder.next_frame() else { panic!("the echo is whole") };
        let Some(Ok(Item::I16(word))) = frame.items().next() else { panic!("a word") };
        black_box(word.array::<1>());
    }
}

fn exchange(rounds: u64) {
    let echo = echo();
    let mut host = Host::new(HostConfig::default()).expect("the defaults work");
    host.handle_connected(Duration::ZERO);
    let mut now = Duration::from_secs(60);
    let mut out = [0; Frame::MAX_LEN];
    for _ in 0..rounds {
        now += Duration::from_millis(50);
        host.submit(black_box(MOVE), |payload| payload.f32(black_box(&AXES)).map(drop)).expect("room");
        assert!(host.poll_transmit(now, black_box(&mut out)).is_some());
        host.handle_input(now + Duration::from_millis(20), black_box(&echo));
        assert!(matches!(host.poll_event(), Some(HostEvent::Done { .. })));
    }
}

/// The six axes of a move, as a motion task gets them.
struct Axes([f32; 6]);

impl TryFrom<Instruction<'_>> for Axes {
    type Error = ();

    fn try_from(mut instruction: Instruction<'_>) -> Result<Self, ()> {
        match instruction.parameters.next() {
            Some(Ok(Item::F32(values))) => values.array().map(Self).ok_or(()),
            _ => Err(()),
        }
    }
}

fn queue(rounds: u64) {
    let (writer, mut jobs) = robot_work_queue::boxed::<Axes>(64, 9999).expect("a queue");
    let mut controller = Controller::new(ControllerConfig::default(), writer).expect("the defaults work");
    controller.handle_connected(Duration::ZERO);
    let mut buffer = [0; MAX_PAYLOAD];
    let mut payload = Payload::new(&mut buffer, &Profile::default());
    payload.word(MOVE).and_then(|payload| payload.f32(&AXES)).expect("room");
    let mut bytes = [0; Frame::MAX_LEN];
    let length = payload.frame().expect("a move").encode(&mut bytes).expect("long enough");
    let (mut out, mut now) = ([0; Frame::MAX_LEN], Duration::from_secs(60));
    for _ in 0..rounds {
        now += Duration::from_millis(50);
        controller.handle_input(now, black_box(&bytes[..length]));
        assert_eq!(controller.poll_event(), Some(ControllerEvent::Queued { count: 1 }));
        assert_eq!(controller.poll_transmit(now + timing::TICK, black_box(&mut out)), Some(ECHO_LEN));
        let job = jobs.take().expect("the move");
        black_box(job.0);
        job.complete();
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

/// Returns the budgets. The source gives only the controller's cycle: an answer has left before the next one may.
fn budgets() -> Vec<Budget> {
    let echo = |baud| Budget {
        what: format!("an answer without values on the line, at {baud} baud"),
        takes: timing::transmission_time(ECHO_LEN, baud),
        window: timing::TICK,
        source: "§4.1",
    };
    vec![echo(timing::BAUD), echo(115_200)]
}
