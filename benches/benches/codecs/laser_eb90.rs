use std::hint::black_box;

use criterion::Criterion;
use laser_eb90::robot_session::Encode as _;
use laser_eb90::{Frame, MAX_PAYLOAD, Payload, Profile};

const AXES: [f32; 6] = [100.0, -50.5, 250.0, 0.0, 90.0, -45.25];

pub(crate) fn bench(criterion: &mut Criterion) {
    let profile = Profile::default();
    let write = |axes: &[f32; 6], out: &mut [u8]| {
        let mut buffer = [0; MAX_PAYLOAD];
        let mut payload = Payload::new(&mut buffer, &profile);
        for _ in 0..7 {
            payload.word(0x0160).and_then(|payload| payload.f32(axes)).expect("a batch has room");
        }
        payload.frame().expect("seven instructions").encode(out).expect("it fits")
    };
    let mut out = [0; Frame::MAX_LEN];
    let len = write(&AXES, &mut out);
    let bytes = out[..len].to_vec();
    let mut payload = [0; MAX_PAYLOAD];
    let mut group = super::group(criterion, "laser-eb90", len);
    group.bench_function("decode a batch of seven moves", |b| {
        b.iter(|| {
            let read = Frame::decode(black_box(&bytes), &mut payload, &profile);
            for item in read.expect("good").expect("whole").0.items() {
                black_box(&item.expect("good"));
            }
        });
    });
    group.bench_function("encode it", |b| b.iter(|| write(black_box(&AXES), black_box(&mut out))));
}
