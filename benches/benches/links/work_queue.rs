//! robot-work-queue: jobs in and out, in one thread, beside rtrb and a bare ring.

use std::hint::black_box;
use std::sync::atomic::{AtomicU32, Ordering};

use benches::{Count, Link, Timing};
use robot_work_queue::{NoWake, Reader, WorkQueue, Writer, boxed};

const CAPACITY: usize = 64;
const MAX_NUMBER: u16 = 9999;

/// The number of jobs in a batch.
const BATCH: usize = 16;

/// Seven words, computed as by a decoder.
type Job = [u64; 7];

/// Queueing jobs and completing them, in one thread, and the same with another ring.
pub(super) const LINK: Link = Link {
    name: "robot-work-queue",
    counts: &[
        // The goals are rtrb's counts; 1.1 of them where the number of each job is checked.
        Count::op("queue and complete, u64, its number checked", checked::<u64>)
            .goal(69.0)
            .timed("u64", "cellwire, its number checked"),
        Count::op("– numbered by the queue", |rounds| singly::<u64>(ours(), rounds))
            .goal(63.0)
            .timed("u64", Timing::OURS),
        Count::op("– the same in a static", in_static).goal(63.0),
        Count::op("– the same by rtrb", |rounds| singly::<u64>(rtrb(), rounds)).timed("u64", RTRB),
        Count::op("– the limit: a bare ring with the same checks", |rounds| singly::<u64>(bare(), rounds))
            .timed("u64", Timing::BY_HAND),
        Count::op("queue and complete, 56 bytes, its number checked", checked::<Job>)
            .goal(93.0)
            .timed("56-bytes", "cellwire, its number checked"),
        Count::op("– numbered by the queue", |rounds| singly::<Job>(ours(), rounds))
            .goal(85.0)
            .timed("56-bytes", Timing::OURS),
        Count::op("– the same by rtrb", |rounds| singly::<Job>(rtrb(), rounds)).timed("56-bytes", RTRB),
        Count::op("– the limit: a bare ring with the same checks", |rounds| singly::<Job>(bare(), rounds))
            .timed("56-bytes", Timing::BY_HAND),
        Count::job("batches of 16, u64", BATCH, |rounds| in_batches::<u64>(ours(), rounds))
            .goal(16.0)
            .timed("u64-batches", Timing::OURS),
        Count::job("– each job claimed by itself", BATCH, claimed::<u64>)
            .timed("u64-batches", "cellwire, each job claimed"),
        Count::job("– chunks of 16 by rtrb", BATCH, |rounds| in_batches::<u64>(rtrb(), rounds))
            .timed("u64-batches", RTRB),
        Count::job("– the limit: a bare ring", BATCH, |rounds| in_batches::<u64>(bare(), rounds))
            .timed("u64-batches", Timing::BY_HAND),
        Count::job("batches of 16, 56 bytes", BATCH, |rounds| in_batches::<Job>(ours(), rounds))
            .goal(37.0)
            .timed("56-bytes-batches", Timing::OURS),
        Count::job("– each job claimed by itself", BATCH, claimed::<Job>)
            .timed("56-bytes-batches", "cellwire, each job claimed"),
        Count::job("– chunks of 16 by rtrb", BATCH, |rounds| in_batches::<Job>(rtrb(), rounds))
            .timed("56-bytes-batches", RTRB),
        Count::job("– the limit: a bare ring", BATCH, |rounds| in_batches::<Job>(bare(), rounds))
            .timed("56-bytes-batches", Timing::BY_HAND),
    ],
    ..Link::EMPTY
};

const RTRB: &str = "rtrb 0.4";

/// The payload of a job.
trait Payload: Copy {
    fn make(seed: u64) -> Self;
    fn sum(&self) -> u64;
}

impl Payload for u64 {
    #[inline(always)]
    fn make(seed: u64) -> Self {
        seed
    }

    #[inline(always)]
    fn sum(&self) -> u64 {
        *self
    }
}

impl Payload for Job {
    #[inline(always)]
    fn make(seed: u64) -> Self {
        [seed, seed + 1, seed + 2, seed + 3, seed + 4, seed + 5, seed + 6]
    }

    #[inline(always)]
    fn sum(&self) -> u64 {
        self.iter().fold(0, |sum, word| sum ^ word)
    }
}

/// A ring under test. Its ends are used in other functions than the loop, as in a real program.
trait Ring<T> {
    fn queue(&mut self, job: impl FnOnce() -> T);
    fn complete(&mut self, execute: impl FnOnce(&T));
    fn queue_batch(&mut self, jobs: impl Iterator<Item = T>);
    fn complete_batch(&mut self, execute: impl FnMut(&T));
}

impl<T> Ring<T> for (Writer<'_, T>, Reader<'_, T>) {
    #[inline(never)]
    fn queue(&mut self, job: impl FnOnce() -> T) {
        self.0.claim().expect("there is space").push_with(job);
    }

    #[inline(never)]
    fn complete(&mut self, execute: impl FnOnce(&T)) {
        let job = self.1.take().expect("a job waits");
        execute(&job);
        job.complete();
    }

    #[inline(never)]
    fn queue_batch(&mut self, jobs: impl Iterator<Item = T>) {
        let mut batch = self.0.claim_batch(BATCH).expect("there is space");
        batch.fill(jobs);
        assert_eq!(batch.publish(), BATCH);
    }

    #[inline(never)]
    fn complete_batch(&mut self, mut execute: impl FnMut(&T)) {
        let mut left = BATCH;
        while left > 0 {
            let mut batch = self.1.take_batch(left).expect("jobs wait");
            let jobs = batch.iter_mut();
            left -= jobs.len();
            jobs.for_each(|(_, job)| execute(job));
            batch.complete();
        }
    }
}

impl<T> Ring<T> for (rtrb::Producer<T>, rtrb::Consumer<T>) {
    #[inline(never)]
    fn queue(&mut self, job: impl FnOnce() -> T) {
        assert!(self.0.push(job()).is_ok(), "there is space");
    }

    #[inline(never)]
    fn complete(&mut self, execute: impl FnOnce(&T)) {
        execute(&self.1.pop().expect("a job waits"));
    }

    #[inline(never)]
    fn queue_batch(&mut self, jobs: impl Iterator<Item = T>) {
        let chunk = self.0.write_chunk_uninit(BATCH).expect("there is space");
        assert_eq!(chunk.fill_from_iter(jobs), BATCH);
    }

    #[inline(never)]
    fn complete_batch(&mut self, mut execute: impl FnMut(&T)) {
        let chunk = self.1.read_chunk(BATCH).expect("jobs wait");
        let (first, second) = chunk.as_slices();
        first.iter().chain(second).for_each(&mut execute);
        chunk.commit_all();
    }
}

/// The parts that every ring with two indices needs: the position of each end, and the shared state. The capacity is a
/// constant and a power of two, so that an index is a remainder.
struct Bare<T> {
    slots: Box<[T; CAPACITY]>,
    tail: AtomicU32,
    head: AtomicU32,
    mark: AtomicU32,
    writer: EndPosition,
    reader: EndPosition,
}

#[derive(Default)]
struct EndPosition {
    at: u32,
    end: u32,
}

impl EndPosition {
    #[inline(always)]
    fn index(&self) -> usize {
        self.at as usize % CAPACITY
    }

    #[inline(always)]
    fn advance(&mut self, jobs: usize) -> u32 {
        self.at = self.at.wrapping_add(jobs as u32);
        self.at
    }
}

impl<T: Copy> Ring<T> for Bare<T> {
    #[inline(never)]
    fn queue(&mut self, job: impl FnOnce() -> T) {
        if self.writer.at == self.writer.end {
            self.writer.end = self.head.load(Ordering::Acquire).wrapping_add(CAPACITY as u32);
            assert!(self.writer.at != self.writer.end, "there is space");
        }
        self.slots[self.writer.index()] = job();
        self.tail.store(self.writer.advance(1), Ordering::Release);
    }

    #[inline(never)]
    fn complete(&mut self, execute: impl FnOnce(&T)) {
        if self.reader.at == self.reader.end {
            self.reader.end = self.tail.load(Ordering::Acquire);
            assert!(self.reader.at != self.reader.end, "a job waits");
        }
        assert!(self.mark.load(Ordering::Relaxed) == 0, "there was no reset");
        execute(&self.slots[self.reader.index()]);
        self.head.store(self.reader.advance(1), Ordering::Release);
    }

    #[inline(never)]
    fn queue_batch(&mut self, jobs: impl Iterator<Item = T>) {
        let head = self.head.load(Ordering::Acquire);
        assert!(self.writer.at.wrapping_sub(head) as usize + BATCH <= CAPACITY, "there is space");
        for (slot, job) in self.slots[self.writer.index()..][..BATCH].iter_mut().zip(jobs) {
            *slot = job;
        }
        self.tail.store(self.writer.advance(BATCH), Ordering::Release);
    }

    #[inline(never)]
    fn complete_batch(&mut self, execute: impl FnMut(&T)) {
        let tail = self.tail.load(Ordering::Acquire);
        assert!(tail.wrapping_sub(self.reader.at) as usize >= BATCH, "jobs wait");
        assert!(self.mark.load(Ordering::Relaxed) == 0, "there was no reset");
        self.slots[self.reader.index()..][..BATCH].iter().for_each(execute);
        self.head.store(self.reader.advance(BATCH), Ordering::Release);
    }
}

fn bare<T: Payload>() -> impl Ring<T> {
    let [tail, head, mark] = [const { AtomicU32::new(0) }; 3];
    let slots = Box::new([T::make(0); CAPACITY]);
    Bare {
        slots,
        tail,
        head,
        mark: black_box(mark),
        writer: EndPosition::default(),
        reader: EndPosition::default(),
    }
}

fn ours<T>() -> impl Ring<T> {
    boxed::<T>(black_box(CAPACITY), black_box(MAX_NUMBER)).expect("a good capacity")
}

fn rtrb<T>() -> impl Ring<T> {
    rtrb::RingBuffer::<T>::new(black_box(CAPACITY))
}

fn execute<T: Payload>(job: &T) {
    black_box(job.sum());
}

fn singly<T: Payload>(mut ring: impl Ring<T>, rounds: u64) {
    for seed in 0..rounds {
        ring.queue(|| T::make(seed));
        ring.complete(execute);
    }
}

fn in_batches<T: Payload>(mut ring: impl Ring<T>, rounds: u64) {
    for seed in 0..rounds {
        ring.queue_batch((seed..).map(T::make));
        ring.complete_batch(execute);
    }
}

fn in_static(rounds: u64) {
    static QUEUE: WorkQueue<u64, CAPACITY> = WorkQueue::numbered::<MAX_NUMBER>();
    singly(QUEUE.split_static(NoWake, NoWake).expect("it has no ends yet"), rounds);
}

/// Claims slots one by one, as for the jobs of a packet, each of which may be refused.
fn claimed<T: Payload>(rounds: u64) {
    #[inline(never)]
    fn queue<T>(writer: &mut Writer<'_, T>, jobs: impl Iterator<Item = T>) {
        let mut batch = writer.claim_batch(BATCH).expect("there is space");
        for job in jobs {
            batch.claim().expect("there is space").push(job);
        }
        assert_eq!(batch.publish(), BATCH);
    }
    let mut ring = boxed::<T>(black_box(CAPACITY), black_box(MAX_NUMBER)).expect("a good capacity");
    for seed in 0..rounds {
        queue(&mut ring.0, (seed..seed + BATCH as u64).map(T::make));
        ring.complete_batch(execute);
    }
}

fn checked<T: Payload>(rounds: u64) {
    #[inline(never)]
    fn queue<T>(writer: &mut Writer<'_, T>, number: u16, job: impl FnOnce() -> T) {
        let claim = writer.claim().expect("there is space");
        claim.commit_with(number, job).expect("the next number");
    }
    // Numbers do not wrap here, because counting them should cost nothing: a new queue begins with number 1 again.
    for first in (0..rounds).step_by(usize::from(MAX_NUMBER) - 1) {
        let mut ring = boxed::<T>(black_box(CAPACITY), black_box(MAX_NUMBER)).expect("a good capacity");
        for (number, seed) in (1..MAX_NUMBER).zip(first..rounds) {
            queue(&mut ring.0, number, || T::make(seed));
            ring.complete(execute);
        }
    }
}
