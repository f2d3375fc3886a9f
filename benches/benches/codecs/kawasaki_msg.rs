use std::hint::black_box;

use criterion::Criterion;
use kawasaki_msg::{Bounds, Charset, Dialect, Line, Message};

const JOB: &[u8] = b"<Tyo$26#50$1$1$-3000$550$-2993$537#>";

pub(crate) fn bench(criterion: &mut Criterion) {
    let (dialect, bounds) = (Dialect::DEFAULT, Bounds::WIDEST);
    let read = |bytes: &[u8]| {
        let (message, _) = Message::decode(bytes, Charset::Ascii).expect("good").expect("whole");
        dialect.read_job::<Line>(&message, &bounds).expect("a job")
    };
    let job = read(JOB);
    let mut out = [0; 64];
    let mut group = super::group(criterion, "kawasaki-msg", JOB.len());
    group.bench_function("decode a job", |b| b.iter(|| black_box(read(black_box(JOB)))));
    group.bench_function("encode a job", |b| {
        b.iter(|| dialect.write_job(black_box(&job), &bounds, black_box(&mut out)));
    });
}
