use std::hint::black_box;

use criterion::Criterion;
use isra_ball::robot_session::Encode as _;
use isra_ball::{Frame, Packet};

const BYTES: [u8; Packet::LEN] = [0x08, 0xF8, 0x5D, 0x00, 0x01, 0xFE, 0x03, 0xFC, 0x05, 0xFA, 0x81, 0x7A];

pub(crate) fn bench(criterion: &mut Criterion) {
    let read = |bytes: &[u8]| {
        Frame::decode(bytes).expect("good").expect("whole").0.packet().expect("eight data bytes")
    };
    let packet = read(&BYTES);
    let mut out = [0; Packet::LEN];
    let mut group = super::group(criterion, "isra-ball", BYTES.len());
    group.bench_function("decode a packet", |b| b.iter(|| black_box(read(black_box(&BYTES)))));
    group.bench_function("encode a packet", |b| b.iter(|| black_box(&packet).encode(black_box(&mut out))));
}
