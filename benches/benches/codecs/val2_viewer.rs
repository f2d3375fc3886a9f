use std::hint::black_box;

use criterion::Criterion;
use val2_viewer::PosePacket;
use val2_viewer::robot_session::Encode as _;

const LINE: &[u8] = b"$POSE,7,16384,0,0,0,-16384,0,0,0,-16384,12800,-4816,16*30\r\n";

pub(crate) fn bench(criterion: &mut Criterion) {
    let read = |bytes: &[u8]| PosePacket::decode(bytes).expect("good").expect("whole").0;
    let packet = read(LINE);
    let mut out = [0; PosePacket::MAX_LEN];
    let mut group = super::group(criterion, "val2-viewer", LINE.len());
    group.bench_function("decode a pose", |b| b.iter(|| black_box(read(black_box(LINE)))));
    group.bench_function("encode a pose", |b| b.iter(|| black_box(&packet).encode(black_box(&mut out))));
}
