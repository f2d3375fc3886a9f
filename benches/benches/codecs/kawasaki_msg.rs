use std::hint::black_box;

use criterion::Criterion;
use kawasaki_msg::{Charset, Dialect, Message};

const JOB: &[u8] = b"<Tyo$26#50$1$1$-3000$550$-2993$537#>";

pub(crate) fn bench(criterion: &mut Criterion) {
    let dialect = Dialect::DEFAULT;
    let read = |bytes: &[u8]| {
        let (message, _) = Message::decode(bytes, Charset::Ascii).expect("good").expect("whole");
        dialect.read(&message).expect("a job")
    };
    let (role, params) = read(JOB);
    let mut out = [0; 64];
    let mut group = super::group(criterion, "kawasaki-msg", JOB.len());
    group.bench_function("decode a job", |b| b.iter(|| black_box(read(black_box(JOB)))));
    group.bench_function("encode a job", |b| {
        b.iter(|| {
            dialect.write(role, black_box(&params), |message| {
                message.encode(Charset::Ascii, black_box(&mut out))
            })
        });
    });
}
