//! Every string of eight operations, and of seven with batches among them, on queues of 1 to 4 jobs, against a plain
//! `VecDeque`. The highest number and the start lap are chosen so that numbers and laps wrap around within the strings.

use core::cell::Cell;
use std::collections::VecDeque;

use robot_work_queue::{Full, NumberError, Reader, TakenBatch, TakenJob, WorkQueue, Writer};

/// An operation of an end. Nothing else changes a queue.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Op {
    /// The writer queues the next job, after operations that must have no effect: a dropped claim, a repeat, wrong numbers.
    Queue,
    /// The reader begins to execute the oldest job.
    Begin,
    /// The reader begins to execute the newest job: it overtakes all others.
    BeginNewest,
    /// The reader completes the job that it executes.
    Complete,
    /// The reader gives up the job that it executes, uncompleted.
    GiveUp,
    Clear,
    Reset,
    /// The writer queues two jobs at once.
    Batch,
    /// The writer drops a batch of two jobs.
    DropBatch,
    /// The reader begins to execute the two oldest jobs.
    BeginBatch,
}

const OPS: [Op; 7] = [Op::Queue, Op::Begin, Op::BeginNewest, Op::Complete, Op::GiveUp, Op::Clear, Op::Reset];

/// With batches. A reset does what a clear does, and more.
const WITH_BATCHES: [Op; 9] = [
    Op::Queue,
    Op::Batch,
    Op::DropBatch,
    Op::Begin,
    Op::BeginNewest,
    Op::BeginBatch,
    Op::Complete,
    Op::GiveUp,
    Op::Reset,
];

/// A job that records that it was dropped, and panics if it is dropped a second time.
struct Job<'a> {
    serial: u32,
    drops: &'a Cell<u64>,
}

impl Drop for Job<'_> {
    fn drop(&mut self) {
        let bit = 1 << self.serial;
        assert_eq!(self.drops.get() & bit, 0, "job {} is dropped twice", self.serial);
        self.drops.set(self.drops.get() | bit);
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    Waiting,
    /// A reset discards it when the reader next takes a job.
    ToDiscard,
    /// The slot becomes free when all before it are.
    Completed,
}

#[derive(Debug)]
struct Entry {
    number: u16,
    serial: u32,
    state: State,
}

/// The plain queue: an entry for every slot from the oldest one that is not free.
#[derive(Debug)]
struct Model {
    capacity: usize,
    max: u16,
    entries: VecDeque<Entry>,
    last: Option<u16>,
    serial: u32,
    dropped: u64,
    /// The slots that a reset waits for.
    unsettled: usize,
    /// The number of slots that the reader knows of.
    known: usize,
    /// The number of freed slots, plus one: a multiple of the capacity if the oldest job is the last of its lap.
    freed: usize,
}

impl Model {
    fn new(capacity: usize, max: u16) -> Self {
        Model {
            capacity,
            max,
            entries: VecDeque::new(),
            last: None,
            serial: 0,
            dropped: 0,
            unsettled: 0,
            known: 0,
            freed: 1,
        }
    }

    fn next(&self) -> u16 {
        match self.last {
            Some(last) if last < self.max => last + 1,
            _ => 1,
        }
    }

    fn is_full(&self) -> bool {
        self.entries.len() == self.capacity
    }

    fn queue(&mut self) {
        let number = self.next();
        self.entries.push_back(Entry { number, serial: self.serial, state: State::Waiting });
        self.last = Some(number);
        self.serial += 1;
    }

    fn clear(&mut self) {
        for entry in self.entries.iter_mut().filter(|entry| entry.state == State::Waiting) {
            entry.state = State::ToDiscard;
        }
        self.unsettled = self.entries.len();
    }

    /// Models the reader taking a job: it looks for more jobs, at least if it knows of none, and resets take effect.
    fn apply_resets(&mut self, looks: bool) {
        self.look(looks);
        while self.unsettled > 0 {
            self.free_oldest();
        }
        self.look(false);
        self.free_completed();
    }

    fn look(&mut self, looks: bool) {
        if looks || self.known == 0 {
            self.known = self.entries.len();
        }
    }

    fn free_oldest(&mut self) {
        self.dropped |= 1 << self.entries.pop_front().unwrap().serial;
        self.known = self.known.saturating_sub(1);
        self.freed += 1;
        self.unsettled = self.unsettled.saturating_sub(1);
    }

    fn free_completed(&mut self) {
        while self.entries.front().is_some_and(|entry| entry.state == State::Completed) {
            self.free_oldest();
        }
    }

    fn waiting(&self) -> impl DoubleEndedIterator<Item = &Entry> {
        self.entries.iter().filter(|entry| entry.state == State::Waiting)
    }

    fn complete(&mut self, serial: u32) {
        let entry = self.entries.iter_mut().find(|entry| entry.serial == serial).unwrap();
        entry.state = State::Completed;
        self.dropped |= 1 << serial;
        self.free_completed();
    }
}

struct Run<'q, 'j> {
    ops: &'q [Op],
    /// The number of the first operations that were checked already, as the beginning of an earlier string.
    known: usize,
    done: usize,
    writer: Writer<'q, Job<'j>>,
    model: Model,
    drops: &'j Cell<u64>,
}

impl<'j> Run<'_, 'j> {
    fn next(&mut self) -> Option<Op> {
        let op = *self.ops.get(self.done)?;
        self.done += 1;
        Some(op)
    }

    fn is_new(&self) -> bool {
        self.done > self.known
    }

    /// Runs the string while nothing is being executed.
    fn idle(&mut self, reader: &mut Reader<'_, Job<'j>>) {
        while let Some(op) = self.next() {
            match op {
                Op::BeginBatch => {
                    self.model.apply_resets(false);
                    match reader.take_batch(2) {
                        Some(batch) => self.executing_batch(batch),
                        None => assert!(self.model.entries.is_empty()),
                    }
                }
                Op::Begin | Op::BeginNewest => {
                    self.model.apply_resets(op == Op::BeginNewest);
                    let newest = self.model.waiting().next_back().map(|entry| entry.number);
                    let (job, entry) = if op == Op::Begin {
                        (reader.take(), self.model.waiting().next())
                    } else {
                        (
                            reader.take_where(|number, _| Some(number) == newest),
                            self.model.waiting().next_back(),
                        )
                    };
                    assert_eq!(job.as_ref().map(TakenJob::number), entry.map(|entry| entry.number));
                    if let Some(job) = job {
                        self.executing(job);
                    }
                }
                Op::Complete | Op::GiveUp => {}
                _ => self.write(op),
            }
            if self.is_new() {
                self.observe();
                observe_reader(&self.model, reader);
            }
        }
    }

    /// Runs the string from the begin of a job's execution to its end.
    fn executing(&mut self, job: TakenJob<'_, Job<'j>>) {
        let serial = job.serial;
        loop {
            if self.is_new() {
                self.observe();
                assert_eq!(job.serial, serial, "the job in execution is not discarded");
            }
            match self.next() {
                Some(Op::Begin | Op::BeginNewest | Op::BeginBatch) => {} // one at a time: the guard borrows the reader
                Some(Op::Complete) => {
                    assert_eq!(job.complete().serial, serial);
                    self.model.complete(serial);
                    return;
                }
                Some(Op::GiveUp) | None => return,
                Some(op) => self.write(op),
            }
        }
    }

    /// Models the same for the oldest jobs: one job only, if that one is known, or the lap, the numbers or a completed job
    /// end the row.
    fn executing_batch(&mut self, mut batch: TakenBatch<'_, Job<'j>>) {
        let jobs: Vec<_> = batch.iter_mut().map(|(number, job)| (number, job.serial)).collect();
        let entries = &self.model.entries;
        let overtaken = entries.iter().any(|entry| entry.state == State::Completed);
        let mut row: Vec<_> = entries.iter().take(2).map(|entry| (entry.number, entry.serial)).collect();
        if overtaken || row[0].0 == self.model.max || self.model.freed.is_multiple_of(self.model.capacity) {
            row.truncate(1);
        }
        row.truncate(self.model.known);
        assert_eq!(jobs, row);
        loop {
            if self.is_new() {
                self.observe();
                assert!(batch.iter_mut().map(|(number, job)| (number, job.serial)).eq(row.iter().copied()));
            }
            match self.next() {
                Some(Op::Begin | Op::BeginNewest | Op::BeginBatch) => {}
                Some(Op::Complete) => {
                    batch.complete();
                    return row.iter().for_each(|(_, serial)| self.model.complete(*serial));
                }
                Some(Op::GiveUp) | None => return,
                Some(op) => self.write(op),
            }
        }
    }

    fn write(&mut self, op: Op) {
        match op {
            Op::Queue if self.model.is_full() => assert_eq!(self.writer.claim().err(), Some(Full)),
            Op::Queue => {
                let number = self.model.next();
                if self.is_new() {
                    drop(self.writer.claim().unwrap());
                    self.refuse_wrong_numbers();
                }
                let claim = self.writer.claim().unwrap();
                assert_eq!(claim.number(), number);
                let (serial, drops) = (self.model.serial, self.drops);
                claim.commit_with(number, || Job { serial, drops }).unwrap();
                self.model.queue();
            }
            Op::Batch | Op::DropBatch => self.write_batch(op == Op::Batch),
            Op::Clear => {
                self.writer.clear();
                self.model.clear();
            }
            Op::Reset => {
                self.writer.reset();
                self.model.clear();
                self.model.last = None;
            }
            _ => unreachable!("{op:?} is the reader's"),
        }
    }

    fn write_batch(&mut self, publish: bool) {
        let is_new = self.is_new();
        let Ok(mut batch) = self.writer.claim_batch(2) else {
            return assert!(self.model.entries.len() + 2 > self.model.capacity);
        };
        let (number, serial, drops) = (self.model.next(), self.model.serial, self.drops);
        if is_new {
            drop(batch.claim().unwrap());
            let wrong = batch.claim().unwrap().commit_with(0, || panic!("job 0 is decoded"));
            assert_eq!(wrong, Err(NumberError::Unexpected { expected: number, found: 0 }));
        }
        batch.claim().unwrap().commit_with(number, || Job { serial, drops }).unwrap();
        batch.fill([Job { serial: serial + 1, drops }]);
        if publish {
            assert_eq!(batch.publish(), 2);
            self.model.queue();
            self.model.queue();
        } else {
            drop(batch);
            self.model.dropped |= 0b11 << serial;
            self.model.serial += 2;
        }
    }

    fn refuse_wrong_numbers(&mut self) {
        let expected = self.model.next();
        for found in (0..=self.model.max + 1).filter(|found| *found != expected) {
            let error = if Some(found) == self.model.last {
                NumberError::Repeated { number: found }
            } else {
                NumberError::Unexpected { expected, found }
            };
            let claim = self.writer.claim().unwrap();
            assert_eq!(claim.commit_with(found, || panic!("job {found} is decoded")), Err(error));
        }
    }

    /// Checks the writer's view.
    fn observe(&self) {
        let (model, writer) = (&self.model, &self.writer);
        let free = model.capacity - model.entries.len();
        assert_eq!(writer.free(), free, "{model:?}");
        assert_eq!(writer.is_full(), free == 0);
        for mark in 0..=model.capacity {
            assert_eq!(writer.drained(mark), model.entries.len() <= mark);
        }
        assert_eq!((writer.last_number(), writer.next_number()), (model.last, model.next()));
        assert_eq!(writer.is_settled(), model.unsettled == 0);
        assert!(!writer.is_abandoned());
        assert_eq!(self.drops.get(), model.dropped, "{model:?}");
    }
}

/// Checks the reader's view.
fn observe_reader(model: &Model, reader: &Reader<'_, Job<'_>>) {
    let expected = model.waiting().map(|entry| (entry.number, entry.serial));
    assert!(reader.iter().map(|(number, job)| (number, job.serial)).eq(expected), "{model:?}");
    assert_eq!(reader.len(), model.waiting().count());
    assert_eq!(reader.is_empty(), model.waiting().next().is_none());
    assert!(!reader.is_abandoned());
}

/// Runs every string in order, and checks each beginning that was not checked before.
fn every_string<const N: usize, const DEPTH: usize>(ops: &[Op]) {
    let mut string = [0; DEPTH];
    let mut known = 0;
    let mut strings = 0;
    loop {
        one_string::<N>(&string.map(|op: usize| ops[op]), known);
        strings += 1;
        let Some(last) = string.iter().rposition(|op| op + 1 < ops.len()) else { break };
        string[last] += 1;
        string[last + 1..].fill(0);
        known = last;
    }
    assert_eq!(strings, ops.len().pow(u32::try_from(DEPTH).unwrap()));
}

fn one_string<const N: usize>(ops: &[Op], known: usize) {
    let drops = Cell::new(0);
    let max = u16::try_from(N).unwrap() + 1;
    let mut queue: WorkQueue<Job<'_>, N> = WorkQueue::new(max).unwrap();
    let (writer, mut reader) = queue.split_at_lap(LAST_LAP);
    let mut run = Run { ops, known, done: 0, writer, model: Model::new(N, max), drops: &drops };
    run.idle(&mut reader);
    let made = run.model.serial;
    drop((run, reader));
    drop(queue);
    assert_eq!(drops.get(), (1 << made) - 1, "every job is dropped");
}

const LAST_LAP: u16 = u16::MAX;

#[test]
fn every_string_of_operations_on_a_queue_of_1() {
    every_string::<1, 8>(&OPS);
}

#[test]
fn every_string_with_batches_on_a_queue_of_1() {
    every_string::<1, 7>(&WITH_BATCHES);
}

#[test]
fn every_string_of_operations_on_a_queue_of_2() {
    every_string::<2, 8>(&OPS);
}

#[test]
fn every_string_with_batches_on_a_queue_of_2() {
    every_string::<2, 7>(&WITH_BATCHES);
}

#[test]
fn every_string_of_operations_on_a_queue_of_3() {
    every_string::<3, 8>(&OPS);
}

#[test]
fn every_string_with_batches_on_a_queue_of_3() {
    every_string::<3, 7>(&WITH_BATCHES);
}

#[test]
fn every_string_of_operations_on_a_queue_of_4() {
    every_string::<4, 8>(&OPS);
}

#[test]
fn every_string_with_batches_on_a_queue_of_4() {
    every_string::<4, 7>(&WITH_BATCHES);
}
