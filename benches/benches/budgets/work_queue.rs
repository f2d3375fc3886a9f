use std::hint::black_box;

use benches::{Count, Link};
use robot_work_queue::{Reader, Writer, boxed};

const CAPACITY: usize = 64;
const MAX_NUMBER: u16 = 9999;

/// The largest job that is in one cache line with its stamp: seven words, computed as by a decoder.
type Job = [u64; 7];

/// Queueing a job with its number checked and completing it, in one thread, and the same with another ring.
pub const LINK: Link = Link {
    name: "robot-work-queue",
    counts: &[
        // The goals are rtrb's counts.
        Count {
            what: "queue and complete, u64",
            goal: Some(78.0),
            units: 1.0,
            unit: "op",
            run: |rounds| words(ours(), rounds),
        },
        Count {
            what: "– the same by rtrb",
            goal: None,
            units: 1.0,
            unit: "op",
            run: |rounds| words(rtrb(), rounds),
        },
        Count {
            what: "queue and complete, 56 bytes",
            goal: Some(100.0),
            units: 1.0,
            unit: "op",
            run: |rounds| jobs(ours(), rounds),
        },
        Count {
            what: "– the same by rtrb",
            goal: None,
            units: 1.0,
            unit: "op",
            run: |rounds| jobs(rtrb(), rounds),
        },
    ],
    budgets: Vec::new,
};

/// A ring under test. Its ends are used in other functions than the loop, as in a real program.
trait Ring<T> {
    fn queue(&mut self, number: u16, job: impl FnOnce() -> T);
    fn complete(&mut self, execute: impl FnOnce(&T));
}

impl<T> Ring<T> for (Writer<'_, T>, Reader<'_, T>) {
    #[inline(never)]
    fn queue(&mut self, number: u16, job: impl FnOnce() -> T) {
        let claim = self.0.claim().expect("there is space");
        claim.commit_with(number, job).expect("the next number");
    }

    #[inline(never)]
    fn complete(&mut self, execute: impl FnOnce(&T)) {
        let job = self.1.take().expect("a job waits");
        execute(&job);
        job.complete();
    }
}

impl<T> Ring<T> for (rtrb::Producer<T>, rtrb::Consumer<T>) {
    #[inline(never)]
    fn queue(&mut self, _: u16, job: impl FnOnce() -> T) {
        assert!(self.0.push(job()).is_ok(), "there is space");
    }

    #[inline(never)]
    fn complete(&mut self, execute: impl FnOnce(&T)) {
        execute(&self.1.pop().expect("a job waits"));
    }
}

fn ours<T>() -> impl Ring<T> {
    boxed::<T>(black_box(CAPACITY), black_box(MAX_NUMBER)).expect("a good capacity")
}

fn rtrb<T>() -> impl Ring<T> {
    rtrb::RingBuffer::<T>::new(black_box(CAPACITY))
}

fn numbers(rounds: u64) -> impl Iterator<Item = u16> {
    (1..=MAX_NUMBER).cycle().zip(0..rounds).map(|(number, _)| number)
}

fn words(mut ring: impl Ring<u64>, rounds: u64) {
    for number in numbers(rounds) {
        ring.queue(number, || u64::from(number));
        ring.complete(|job| {
            black_box(*job);
        });
    }
}

fn jobs(mut ring: impl Ring<Job>, rounds: u64) {
    for number in numbers(rounds) {
        let seed = u64::from(number);
        ring.queue(number, || [seed, seed + 1, seed + 2, seed + 3, seed + 4, seed + 5, seed + 6]);
        ring.complete(|job| {
            black_box(job.iter().fold(0, |sum, word| sum ^ word));
        });
    }
}
