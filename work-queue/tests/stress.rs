//! Two real threads, jobs whose words show a torn read, and a count of drops. Without a test harness, for ThreadSanitizer:
//!
//! ```text
//! RUSTFLAGS="-Zsanitizer=thread -Cunsafe-allow-abi-mismatch=sanitizer" CARGO_TARGET_DIR=target/tsan \
//!     cargo +nightly test -p robot-work-queue --test stress --target x86_64-unknown-linux-gnu -- 200000
//! ```
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

#[cfg(loom)]
fn main() {}

#[cfg(not(loom))]
fn main() {
    stress::main();
}

#[cfg(not(loom))]
mod stress {
    use core::hint;
    use core::ops::Range;
    use core::sync::atomic::{AtomicU64, Ordering};
    use std::thread;

    use robot_work_queue::{Reader, WorkQueue, Writer, boxed};

    static MADE: AtomicU64 = AtomicU64::new(0);
    static DROPPED: AtomicU64 = AtomicU64::new(0);

    /// The serial number of a job in a batch that is dropped.
    const UNPUBLISHED: u64 = u64::MAX / 2;

    #[derive(Debug, Default)]
    struct Executed {
        one_by_one: u64,
        overtaking: u64,
        in_batches: u64,
    }

    /// Seven words that are all the same.
    struct Job([u64; 7]);

    impl Job {
        fn new(serial: u64) -> Self {
            MADE.fetch_add(1, Ordering::Relaxed);
            Job([serial; 7])
        }

        fn serial(&self) -> u64 {
            let [serial, rest @ ..] = self.0;
            assert!(rest.iter().all(|word| *word == serial), "a torn job: {:?}", self.0);
            serial
        }
    }

    impl Drop for Job {
        fn drop(&mut self) {
            assert_ne!(self.serial(), u64::MAX, "a job is dropped twice");
            self.0 = [u64::MAX; 7];
            DROPPED.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// A small generator for each thread: they share no memory, which would order the threads.
    struct Rng(u64);

    impl Rng {
        fn next(&mut self) -> u64 {
            self.0 ^= self.0 << 13;
            self.0 ^= self.0 >> 7;
            self.0 ^= self.0 << 17;
            self.0
        }

        fn one_in(&mut self, n: u64) -> bool {
            self.next().is_multiple_of(n)
        }
    }

    pub(super) fn main() {
        let jobs: u64 = std::env::args().find_map(|argument| argument.parse().ok()).unwrap_or(20_000);
        for capacity in [1, 2, 3, 64, 1000] {
            let (writer, reader) = boxed(capacity, 1001).unwrap();
            run(&format!("boxed, capacity {capacity}"), jobs, writer, reader);
        }
        let queue: &'static mut WorkQueue<Job, 5> = Box::leak(Box::new(WorkQueue::new(6).unwrap()));
        let (writer, reader) = queue.split();
        run("inline, capacity 5", jobs, writer, reader);
    }

    fn run(name: &str, jobs: u64, writer: Writer<'static, Job>, reader: Reader<'static, Job>) {
        let writer = thread::spawn(move || write(writer, jobs));
        let reader = thread::spawn(move || read(reader));
        let resets = writer.join().unwrap();
        let executed = reader.join().unwrap();
        let [made, dropped] = [&MADE, &DROPPED].map(|count| count.swap(0, Ordering::Relaxed));
        assert_eq!(made, dropped, "every job is dropped once");
        assert!(executed.one_by_one > 0 && executed.in_batches > 0 && resets > 0);
        println!("{name}: {made} jobs made, each dropped once; {resets} resets; {executed:?}");
    }

    fn write(mut writer: Writer<'static, Job>, jobs: u64) -> u64 {
        let mut rng = Rng(0x9E37_79B9_7F4A_7C15);
        let (mut serial, mut resets) = (0, 0);
        while serial < jobs {
            let queued = if rng.one_in(3) {
                write_batch(&mut writer, &mut rng, serial..jobs)
            } else {
                write_one(&mut writer, &mut rng, serial)
            };
            serial += queued;
            if queued == 0 {
                hint::spin_loop();
                if rng.one_in(2) {
                    thread::yield_now();
                }
            }
            if rng.one_in(100) {
                resets += 1;
                if rng.one_in(2) {
                    writer.clear()
                } else {
                    writer.reset()
                }
                if rng.one_in(2) {
                    while !writer.is_settled() {
                        thread::yield_now();
                    }
                    assert_eq!(writer.free(), writer.capacity());
                }
            }
        }
        resets
    }

    /// Returns how many jobs were queued.
    fn write_one(writer: &mut Writer<'static, Job>, rng: &mut Rng, serial: u64) -> u64 {
        let Ok(claim) = writer.claim() else { return 0 };
        if rng.one_in(10) {
            return 0; // dropped without a commit
        }
        let number = claim.number();
        claim.commit_with(number, || Job::new(serial)).unwrap();
        1
    }

    fn write_batch(writer: &mut Writer<'static, Job>, rng: &mut Rng, mut serials: Range<u64>) -> u64 {
        let most = 1 + (rng.next() % 20) as usize;
        let Ok(mut batch) = writer.claim_batch(most) else { return 0 };
        let publish = !rng.one_in(10);
        if publish {
            batch.fill(serials.by_ref().take(most).map(Job::new));
            return batch.publish() as u64;
        }
        // Each of these is dropped with the batch.
        for _ in 0..most {
            if let Ok(claim) = batch.claim() {
                claim.push_with(|| Job::new(UNPUBLISHED));
            }
        }
        0
    }

    fn read(mut reader: Reader<'static, Job>) -> Executed {
        let mut rng = Rng(0xD1B5_4A32_D192_ED03);
        let mut executed = Executed::default();
        let mut seen = std::collections::HashSet::new();
        let mut execute = |job: &Job| {
            let serial = job.serial();
            assert!(serial != UNPUBLISHED && seen.insert(serial), "job {serial} is executed twice");
        };
        loop {
            let last_look = reader.is_abandoned();
            let job = match rng.next() % 4 {
                0 => {
                    let mut skip = 2;
                    let job = reader.take_where(|_, job| {
                        job.serial();
                        skip -= 1;
                        skip == 0
                    });
                    if let Some(job) = job {
                        execute(&job);
                        executed.overtaking += 1;
                        drop(job.complete());
                    }
                    continue;
                }
                1 => {
                    let Some(mut batch) = reader.take_batch(1 + (rng.next() % 20) as usize) else { continue };
                    if rng.one_in(20) {
                        continue; // not completed: they wait again
                    }
                    let jobs = batch.iter_mut().map(|(_, job)| {
                        execute(job);
                        *job = Job::new(job.serial()); // nobody else is at it
                    });
                    let count = jobs.count() as u64;
                    batch.complete();
                    executed.in_batches += count;
                    continue;
                }
                _ => reader.take(),
            };
            match job {
                Some(job) if rng.one_in(20) => drop(job), // not completed: it waits again
                Some(job) => {
                    execute(&job);
                    executed.one_by_one += 1;
                    drop(job.complete());
                }
                None if last_look => return executed,
                None => thread::yield_now(),
            }
        }
    }
}
