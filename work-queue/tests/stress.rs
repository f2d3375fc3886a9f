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
    use core::sync::atomic::{AtomicU64, Ordering};
    use std::thread;

    use robot_work_queue::{Reader, WorkQueue, Writer, boxed};

    static DROPPED: AtomicU64 = AtomicU64::new(0);

    /// Seven words that are all the same: 56 bytes, as much as a slot of one cache line holds.
    struct Job([u64; 7]);

    impl Job {
        fn new(serial: u64) -> Self {
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
            self.serial();
            self.0 = [u64::MAX; 7];
            DROPPED.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// A small generator for each thread: they share no memory, which would order the threads.
    struct Rng(u64);

    impl Rng {
        fn one_in(&mut self, n: u64) -> bool {
            self.0 ^= self.0 << 13;
            self.0 ^= self.0 >> 7;
            self.0 ^= self.0 << 17;
            self.0.is_multiple_of(n)
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
        let before = DROPPED.load(Ordering::Relaxed);
        let writer = thread::spawn(move || write(writer, jobs));
        let reader = thread::spawn(move || read(reader));
        let resets = writer.join().unwrap();
        let (executed, overtaken) = reader.join().unwrap();
        let dropped = DROPPED.load(Ordering::Relaxed) - before;
        assert_eq!(dropped, jobs, "every job is dropped once");
        assert!(executed > 0 && resets > 0);
        println!(
            "{name}: {jobs} jobs, {executed} executed, {overtaken} out of order, {resets} resets, each dropped once"
        );
    }

    fn write(mut writer: Writer<'static, Job>, jobs: u64) -> u64 {
        let mut rng = Rng(0x9E37_79B9_7F4A_7C15);
        let mut resets = 0;
        for serial in 0..jobs {
            loop {
                if let Ok(claim) = writer.claim() {
                    if rng.one_in(10) {
                        continue; // dropped without a commit
                    }
                    let number = claim.number();
                    claim.commit_with(number, || Job::new(serial)).unwrap();
                    break;
                }
                hint::spin_loop();
                if rng.one_in(2) {
                    thread::yield_now();
                }
            }
            if rng.one_in(500) {
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

    fn read(mut reader: Reader<'static, Job>) -> (u64, u64) {
        let mut rng = Rng(0xD1B5_4A32_D192_ED03);
        let (mut executed, mut overtaken) = (0, 0);
        let mut seen = std::collections::HashSet::new();
        loop {
            let last_look = reader.is_abandoned();
            let overtakes = rng.one_in(3);
            let job = if overtakes {
                let mut skip = 2;
                reader.take_where(|_, job| {
                    job.serial();
                    skip -= 1;
                    skip == 0
                })
            } else {
                reader.take()
            };
            match job {
                Some(job) if rng.one_in(20) => drop(job), // not completed: it waits again
                Some(job) => {
                    assert!(seen.insert(job.serial()), "job {} is executed twice", job.serial());
                    executed += 1;
                    overtaken += u64::from(overtakes);
                    drop(job.complete());
                }
                None if last_look && !overtakes => return (executed, overtaken),
                None => thread::yield_now(),
            }
        }
    }
}
