use std::hint::black_box;

use criterion::Criterion;
use mmacell_proto::robot_session::Encode as _;
use mmacell_proto::{Dialect, Line, Reply, RobotPose};

const STATUS: &[u8] = b"OKF+010.000-002.000+005.999-01.2322T+00080+00000\r\n";

pub(crate) fn bench(criterion: &mut Criterion) {
    let read = |bytes: &[u8]| {
        let (line, _) = Line::decode(bytes, &Dialect::STRICT).expect("short").expect("whole");
        Reply::<RobotPose>::decode(line, &Dialect::STRICT).expect("a status")
    };
    let status = read(STATUS);
    let mut out = [0; 64];
    let mut group = super::group(criterion, "mmacell-proto", STATUS.len());
    group.bench_function("decode a status", |b| b.iter(|| black_box(read(black_box(STATUS)))));
    group.bench_function("encode a status", |b| b.iter(|| black_box(&status).encode(black_box(&mut out))));
}
