use std::hint::black_box;

use criterion::Criterion;

type Job = [u64; 7];

pub(crate) fn bench(criterion: &mut Criterion) {
    let (mut writer, mut reader) = robot_work_queue::boxed::<Job>(64, 9999).expect("a good capacity");
    let mut group = super::group(criterion, "robot-work-queue", size_of::<Job>());
    group.bench_function("queue and complete a job in one thread", |b| {
        b.iter(|| {
            let claim = writer.claim().expect("there is space");
            let number = claim.number();
            claim.commit_with(number, || black_box([1; 7])).expect("the next number");
            let job = reader.take().expect("a job waits");
            black_box(&*job);
            job.complete();
        });
    });
}
