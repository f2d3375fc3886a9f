use std::hint::spin_loop;
use std::sync::Arc;

use ringbuf::traits::{Consumer as _, Producer as _};
use robot_work_queue::{Reader, Writer};

pub(super) const MAX_NUMBER: u16 = 9999;

/// The number of jobs in a batch.
const BATCH: usize = 16;

/// Waits between two attempts.
#[inline(always)]
pub(super) fn wait(pause: bool) {
    if pause {
        spin_loop();
    }
}

/// The end that queues the value of `job`. `write` returns whether there was space.
pub(super) trait Write<T>: Send + 'static {
    fn write(&mut self, job: impl FnOnce() -> T) -> bool;

    /// Queues the job with this index, or the jobs from it on up to an end; returns how many.
    #[inline(always)]
    fn write_from(&mut self, first: u64, _end: u64, make: impl Fn(u64) -> T) -> u64 {
        u64::from(self.write(|| make(first)))
    }

    /// Called before the next attempt if there was no space.
    #[inline(always)]
    fn wait(&mut self, pause: bool) {
        wait(pause);
    }
}

/// The end that executes the oldest job. `read` returns how many there were.
pub(super) trait Read<T>: Send + 'static {
    fn read(&mut self, execute: impl FnMut(&T)) -> u64;
}

/// The queue numbers the jobs.
impl<T: Send + 'static> Write<T> for Writer<'static, T> {
    #[inline(always)]
    fn write(&mut self, job: impl FnOnce() -> T) -> bool {
        self.claim().map(|claim| claim.push_with(job)).is_ok()
    }
}

impl<T: Send + 'static> Read<T> for Reader<'static, T> {
    #[inline(always)]
    fn read(&mut self, mut execute: impl FnMut(&T)) -> u64 {
        let Some(job) = self.take() else { return 0 };
        execute(&job);
        job.complete();
        1
    }
}

/// The number of each job is checked, as that of a decoded one.
pub(super) struct Checked<T: 'static> {
    pub(super) writer: Writer<'static, T>,
    pub(super) next: u16,
}

impl<T: Send + 'static> Write<T> for Checked<T> {
    #[inline(always)]
    fn write(&mut self, job: impl FnOnce() -> T) -> bool {
        let Ok(claim) = self.writer.claim() else { return false };
        assert!(claim.commit_with(self.next, job).is_ok());
        self.next = if self.next == MAX_NUMBER { 1 } else { self.next + 1 };
        true
    }
}

/// After the queue was full, it waits until half of the queue has drained, as a task should.
pub(super) struct LowWater<T: 'static>(pub(super) Writer<'static, T>);

impl<T: Send + 'static> Write<T> for LowWater<T> {
    #[inline(always)]
    fn write(&mut self, job: impl FnOnce() -> T) -> bool {
        self.0.write(job)
    }

    fn wait(&mut self, _: bool) {
        while !self.0.drained(self.0.capacity() / 2) {
            for _ in 0..20 {
                spin_loop();
            }
        }
    }
}

/// Jobs are published and freed in batches.
pub(super) struct Batches<E>(pub(super) E);

impl<T: Send + 'static> Write<T> for Batches<Writer<'static, T>> {
    #[inline(always)]
    fn write(&mut self, job: impl FnOnce() -> T) -> bool {
        self.0.write(job)
    }

    #[inline(always)]
    fn write_from(&mut self, first: u64, end: u64, make: impl Fn(u64) -> T) -> u64 {
        let count = BATCH.min((end - first) as usize);
        let Ok(mut batch) = self.0.claim_batch(count) else { return 0 };
        batch.fill((first..).map(make));
        batch.publish() as u64
    }
}

impl<T: Send + 'static> Read<T> for Batches<Reader<'static, T>> {
    #[inline(always)]
    fn read(&mut self, mut execute: impl FnMut(&T)) -> u64 {
        let Some(mut batch) = self.0.take_batch(BATCH) else { return 0 };
        let jobs = batch.iter_mut();
        let count = jobs.len() as u64;
        jobs.for_each(|(_, job)| execute(job));
        batch.complete();
        count
    }
}

impl<T: Send + 'static> Write<T> for Batches<rtrb::Producer<T>> {
    #[inline(always)]
    fn write(&mut self, job: impl FnOnce() -> T) -> bool {
        self.0.write(job)
    }

    #[inline(always)]
    fn write_from(&mut self, first: u64, end: u64, make: impl Fn(u64) -> T) -> u64 {
        let count = BATCH.min((end - first) as usize);
        let Ok(chunk) = self.0.write_chunk_uninit(count) else { return 0 };
        chunk.fill_from_iter((first..).map(make)) as u64
    }
}

impl<T: Send + 'static> Read<T> for Batches<rtrb::Consumer<T>> {
    #[inline(always)]
    fn read(&mut self, mut execute: impl FnMut(&T)) -> u64 {
        // As many as there are, because the last ones may be fewer.
        let count = self.0.slots().min(BATCH);
        let Ok(chunk) = self.0.read_chunk(count) else { return 0 };
        let (first, second) = chunk.as_slices();
        first.iter().chain(second).for_each(&mut execute);
        chunk.commit_all();
        count as u64
    }
}

impl<T: Send + 'static> Write<T> for rtrb::Producer<T> {
    #[inline(always)]
    fn write(&mut self, job: impl FnOnce() -> T) -> bool {
        !self.is_full() && self.push(job()).is_ok()
    }
}

impl<T: Send + 'static> Read<T> for rtrb::Consumer<T> {
    #[inline(always)]
    fn read(&mut self, mut execute: impl FnMut(&T)) -> u64 {
        u64::from(self.pop().map(|job| execute(&job)).is_ok())
    }
}

impl<T: Send + 'static> Write<T> for ringbuf::HeapProd<T> {
    #[inline(always)]
    fn write(&mut self, job: impl FnOnce() -> T) -> bool {
        self.try_push(job()).is_ok()
    }
}

impl<T: Send + 'static> Read<T> for ringbuf::HeapCons<T> {
    #[inline(always)]
    fn read(&mut self, mut execute: impl FnMut(&T)) -> u64 {
        u64::from(self.try_pop().map(|job| execute(&job)).is_some())
    }
}

impl<T: Send + 'static> Write<T> for heapless::spsc::Producer<'static, T> {
    #[inline(always)]
    fn write(&mut self, job: impl FnOnce() -> T) -> bool {
        self.enqueue(job()).is_ok()
    }
}

impl<T: Send + 'static> Read<T> for heapless::spsc::Consumer<'static, T> {
    #[inline(always)]
    fn read(&mut self, mut execute: impl FnMut(&T)) -> u64 {
        u64::from(self.dequeue().map(|job| execute(&job)).is_some())
    }
}

impl<T: Send + 'static> Write<T> for Arc<crossbeam_queue::ArrayQueue<T>> {
    #[inline(always)]
    fn write(&mut self, job: impl FnOnce() -> T) -> bool {
        self.push(job()).is_ok()
    }
}

impl<T: Send + 'static> Read<T> for Arc<crossbeam_queue::ArrayQueue<T>> {
    #[inline(always)]
    fn read(&mut self, mut execute: impl FnMut(&T)) -> u64 {
        u64::from(self.pop().map(|job| execute(&job)).is_some())
    }
}

impl<T: Send + 'static> Write<T> for gil::spsc::Sender<T> {
    #[inline(always)]
    fn write(&mut self, job: impl FnOnce() -> T) -> bool {
        self.try_send(job()).is_ok()
    }
}

impl<T: Send + 'static> Read<T> for gil::spsc::Receiver<T> {
    #[inline(always)]
    fn read(&mut self, mut execute: impl FnMut(&T)) -> u64 {
        u64::from(self.try_recv().map(|job| execute(&job)).is_some())
    }
}

impl<T: Send + 'static> Write<T> for nexus_queue::spsc::Producer<T> {
    #[inline(always)]
    fn write(&mut self, job: impl FnOnce() -> T) -> bool {
        self.push(job()).is_ok()
    }
}

impl<T: Send + 'static> Read<T> for nexus_queue::spsc::Consumer<T> {
    #[inline(always)]
    fn read(&mut self, mut execute: impl FnMut(&T)) -> u64 {
        u64::from(self.pop().map(|job| execute(&job)).is_some())
    }
}
