use std::hint::black_box;

use criterion::Criterion;
use val2_alter::{
    ErrorCode, Frame, Framing, HostMessage, Message, Motion, MotionPhase, Reply, RobotMessage, SegmentStatus,
    Transform,
};

pub(crate) fn bench(criterion: &mut Criterion) {
    let request = RobotMessage::Motion(Motion {
        phase: MotionPhase::Running,
        error: ErrorCode::None,
        segment_status: SegmentStatus::Normal,
        segment: 1,
        percent: 0x2000,
        transform: Some(Transform([0x4000, 0, 0, 0, -0x4000, 0, 0, 0, -0x4000, 12_800, -4816, 32])),
    });
    let mut out = [0; Frame::MAX_LEN];
    let len = request.encode(Framing::DEFAULT, &mut out).expect("it fits");
    let bytes = out[..len].to_vec();
    let mut group = super::group(criterion, "val2-alter", len);
    group.bench_function("decode a request with its transformation", |b| {
        b.iter(|| {
            RobotMessage::decode_frame(black_box(&bytes), Framing::DEFAULT).expect("good").expect("whole")
        });
    });
    group.finish();

    let reply = HostMessage::Reply(Reply::all([80, -80, 0, 182, -182, 5]));
    let len = reply.encode(Framing::DEFAULT, &mut out).expect("it fits");
    let mut group = super::group(criterion, "val2-alter", len);
    group.bench_function("encode a reply with six values", |b| {
        b.iter(|| black_box(&reply).encode(Framing::DEFAULT, black_box(&mut out)));
    });
}
