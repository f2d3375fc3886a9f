//! Byte stuffing: frames of val2-alter and laser-eb90 against crates that stuff frames with DLE, SLIP and COBS.
//!
//! None of them reads the frames of these two links. Each gets the same data, followed by the same sum, in its own framing, and
//! checks the sum as our frames do.

use std::hint::black_box;

use dle_encoder::DleEncoder;
use laser_eb90::robot_session::Encode as _;
use laser_eb90::{MAX_PAYLOAD, Payload, Profile};
use val2_alter::Framing;

use crate::race::race;

/// The framed data. Each framing has a byte that it must escape.
trait Data {
    fn bytes(escaped: u8) -> Vec<u8>;
}

/// 30 data bytes of a standard message of val2-alter, with little to escape.
struct Plain;

impl Data for Plain {
    fn bytes(_: u8) -> Vec<u8> {
        let mut data = vec![0x80, 0x02, 0x01, 0x00, 0x00, 0x20];
        data.extend(
            [0x4000i16, 2, 3, 4, -0x4000, 6, 7, 8, -0x4000, 12_800, -4816, 32]
                .map(i16::to_le_bytes)
                .as_flattened(),
        );
        data
    }
}

/// The worst 30 bytes.
struct Escaped;

impl Data for Escaped {
    fn bytes(escaped: u8) -> Vec<u8> {
        vec![escaped; 30]
    }
}

/// A batch of seven moves of a laser robot: 211 bytes, 217 on its line.
struct Batch;

impl Data for Batch {
    fn bytes(_: u8) -> Vec<u8> {
        batch(|frame| frame.payload().to_vec())
    }
}

fn batch<T>(take: impl FnOnce(laser_eb90::Frame<'_>) -> T) -> T {
    let mut buffer = [0; MAX_PAYLOAD];
    let mut payload = Payload::new(&mut buffer, &Profile::default());
    for _ in 0..7 {
        let axes = [100.0, -50.5, 250.0, 0.0, 90.0, -45.25];
        payload.word(0x0160).and_then(|payload| payload.f32(&axes)).expect("a batch has room");
    }
    take(payload.frame().expect("seven instructions"))
}

/// The common conditions of these races, and the differences.
const NOTES: &str = "\
Each has the same data and its sum in its own framing, and checks the sum. Not the same: DLE STX and DLE ETX
around the data for dle-encoder, one byte between frames for SLIP and COBS; COBS escapes nothing, it says where
the next zero stands. slipspeed returns a new Vec, laser-eb90 leaves a batch without a 90h where it stands, the
others copy.
";

pub(crate) fn races() {
    read_and_write::<Plain>("30 bytes", "val2-alter", read_alter::<Plain>, write_alter::<Plain>);
    read_and_write::<Escaped>(
        "30 bytes, each escaped",
        "val2-alter",
        read_alter::<Escaped>,
        write_alter::<Escaped>,
    );
    read_and_write::<Batch>("a batch of seven moves", "laser-eb90", read_laser, write_laser);
    println!("{NOTES}");
}

fn read_and_write<D: Data>(what: &str, ours: &'static str, read_ours: fn(u64), write_ours: fn(u64)) {
    race(
        &format!("read {what}"),
        [
            (ours, read_ours),
            ("dle-encoder 0.1", read_dle::<D>),
            ("serial-line-ip 0.5 (SLIP)", read_slip::<D>),
            ("slipspeed 2.0 (SLIP)", read_slipspeed::<D>),
            ("cobs 0.5", read_cobs::<D>),
        ],
    );
    race(
        &format!("write {what}"),
        [
            (ours, write_ours),
            ("dle-encoder 0.1", write_dle::<D>),
            ("serial-line-ip 0.5 (SLIP)", write_slip::<D>),
            ("slipspeed 2.0 (SLIP)", write_slipspeed::<D>),
            ("cobs 0.5", write_cobs::<D>),
        ],
    );
}

fn read_alter<D: Data>(rounds: u64) {
    let frame = val2_alter::Frame::new(&D::bytes(0x10)).expect("30 bytes");
    let mut bytes = [0; val2_alter::Frame::MAX_LEN];
    let len = frame.encode(Framing::DEFAULT, &mut bytes).expect("it fits");
    for _ in 0..rounds {
        let read = val2_alter::Frame::decode(black_box(&bytes[..len]), Framing::DEFAULT);
        black_box(read.expect("good").expect("whole").0.data());
    }
}

fn write_alter<D: Data>(rounds: u64) {
    let (data, mut out) = (D::bytes(0x10), [0; val2_alter::Frame::MAX_LEN]);
    for _ in 0..rounds {
        let frame = val2_alter::Frame::new(black_box(&data)).expect("30 bytes");
        frame.encode(Framing::DEFAULT, black_box(&mut out)).expect("it fits");
    }
}

fn read_laser(rounds: u64) {
    let (mut bytes, mut payload) = ([0; laser_eb90::Frame::MAX_LEN], [0; MAX_PAYLOAD]);
    let len = batch(|frame| frame.encode(&mut bytes).expect("it fits"));
    assert_eq!(len, 217);
    for _ in 0..rounds {
        let read = laser_eb90::Frame::decode(black_box(&bytes[..len]), &mut payload, &Profile::default());
        black_box(read.expect("good").expect("whole").0.payload());
    }
}

fn write_laser(rounds: u64) {
    let mut out = [0; laser_eb90::Frame::MAX_LEN];
    batch(|frame| {
        for _ in 0..rounds {
            black_box(&frame).encode(black_box(&mut out)).expect("it fits");
        }
    });
}

fn sum(data: &[u8]) -> u8 {
    data.iter().fold(0, |sum: u8, byte| sum.wrapping_add(*byte))
}

/// Returns the data followed by its sum, which the other crates frame together.
fn summed<D: Data>(escaped: u8) -> Vec<u8> {
    let mut data = D::bytes(escaped);
    data.push(sum(&data));
    data
}

fn check(data: &[u8]) {
    let (last, data) = data.split_last().expect("data");
    assert_eq!(*last, sum(data));
    black_box(data);
}

/// Writes the sum after the data, as our frames do.
fn sum_up(data: &mut [u8]) {
    let (last, data) = data.split_last_mut().expect("data");
    *last = sum(data);
}

const DLE: DleEncoder = DleEncoder { escape_stx_etx: false, escape_cr: false, add_stx_etx: true };

fn read_dle<D: Data>(rounds: u64) {
    let (mut bytes, mut out) = ([0; 500], [0; 250]);
    let len = DLE.encode(&summed::<D>(0x10), &mut bytes).expect("it fits");
    for _ in 0..rounds {
        let mut used = 0;
        let read = DLE.decode(black_box(&bytes[..len]), &mut out, &mut used).expect("good");
        check(&out[..read]);
    }
}

fn write_dle<D: Data>(rounds: u64) {
    let (mut data, mut out) = (summed::<D>(0x10), [0; 500]);
    for _ in 0..rounds {
        sum_up(black_box(&mut data));
        DLE.encode(&data, black_box(&mut out)).expect("it fits");
    }
}

fn slip(data: &[u8], out: &mut [u8]) -> usize {
    let mut encoder = serial_line_ip::Encoder::new();
    let written = encoder.encode(data, out).expect("it fits").written;
    written + encoder.finish(&mut out[written..]).expect("it fits").written
}

fn read_slip<D: Data>(rounds: u64) {
    let (mut bytes, mut out) = ([0; 500], [0; 250]);
    let len = slip(&summed::<D>(0xC0), &mut bytes);
    for _ in 0..rounds {
        let mut decoder = serial_line_ip::Decoder::new();
        let (_, read, end) = decoder.decode(black_box(&bytes[..len]), &mut out).expect("good");
        assert!(end);
        check(read);
    }
}

fn write_slip<D: Data>(rounds: u64) {
    let (mut data, mut out) = (summed::<D>(0xC0), [0; 500]);
    for _ in 0..rounds {
        sum_up(black_box(&mut data));
        slip(&data, black_box(&mut out));
    }
}

fn read_slipspeed<D: Data>(rounds: u64) {
    let bytes = slipspeed::encode_frame(&summed::<D>(0xC0));
    for _ in 0..rounds {
        check(&slipspeed::decode_frame(black_box(&bytes)).expect("good"));
    }
}

fn write_slipspeed<D: Data>(rounds: u64) {
    let mut data = summed::<D>(0xC0);
    for _ in 0..rounds {
        sum_up(black_box(&mut data));
        black_box(slipspeed::encode_frame(&data));
    }
}

fn read_cobs<D: Data>(rounds: u64) {
    let (mut bytes, mut out) = ([0; 500], [0; 250]);
    let len = cobs::encode_including_sentinels(&summed::<D>(0), &mut bytes);
    for _ in 0..rounds {
        // The sentinel before the frame is that of the previous frame.
        let read = cobs::decode(black_box(&bytes[1..len]), &mut out).expect("good").frame_size();
        check(&out[..read]);
    }
}

fn write_cobs<D: Data>(rounds: u64) {
    let (mut data, mut out) = (summed::<D>(0), [0; 500]);
    for _ in 0..rounds {
        sum_up(black_box(&mut data));
        cobs::encode_including_sentinels(&data, black_box(&mut out));
    }
}
