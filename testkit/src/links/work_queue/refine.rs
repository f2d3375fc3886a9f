//! Every path of the model on the queue itself, in one thread: a job that is dropped and a question whether a job is wanted
//! call out, and the writer continues there. A claim and a batch are made when they are published or dropped: they borrow the
//! writer.

use std::cell::RefCell;
use std::rc::Rc;

use robot_work_queue::{Full, NumberError, Reader, TakenBatch, TakenJob, Writer, boxed};

use super::queue::{Act, Queue};
use super::state::{Looks, Reading, State, Writing, after};
use crate::model::{Refined, System};

/// Replays every walk of `queue`, which is [`single`](Queue::single).
///
/// # Panics
/// If the queue differs from the model, with the path to the difference.
pub(super) fn refine(queue: Queue) -> Refined {
    assert!(queue.single, "one thread cannot interrupt itself");
    Refined::by(&queue, |path| walk(queue, path))
}

fn walk(queue: Queue, path: Vec<Act>) {
    let (writer, reader) =
        boxed(queue.capacity.into(), queue.max.into()).expect("the model's queues can be made");
    let run = Run {
        at: 0,
        state: queue.init(),
        writer: Some(writer),
        writes: false,
        dropped: Vec::new(),
        queued: Vec::new(),
    };
    let replay = Rc::new(Replay { queue, path, run: RefCell::new(run) });
    replay.read(reader);
    let writer = replay.run.borrow_mut().writer.take();
    drop(writer);
    assert!(
        replay.run.borrow().dropped.iter().all(|dropped| *dropped),
        "a job is never dropped: {:?}",
        replay.path
    );
}

/// A path, and how far it has come in the model and on the queue.
struct Replay {
    queue: Queue,
    path: Vec<Act>,
    run: RefCell<Run>,
}

struct Run {
    at: usize,
    state: State,
    writer: Option<Writer<'static, Job>>,
    /// Whether the writer does something.
    writes: bool,
    /// Each job ever made, by its serial number.
    dropped: Vec<bool>,
    /// The serial number of each job that was published.
    queued: Vec<usize>,
}

struct Job {
    serial: usize,
    replay: Rc<Replay>,
}

impl Drop for Job {
    fn drop(&mut self) {
        if !std::thread::panicking() {
            self.replay.dropped(self.serial);
        }
    }
}

impl Replay {
    /// Returns the next act of the path.
    fn peek(&self) -> Option<Act> {
        self.path.get(self.run.borrow().at).copied()
    }

    /// Takes the next act in the model. Where the path ends within an operation, the operation continues.
    fn step(&self) -> Act {
        let act = self.peek().unwrap_or_else(|| {
            let mut acts = Vec::new();
            self.queue.acts(&self.run.borrow().state, &mut acts);
            acts[0]
        });
        let mut run = self.run.borrow_mut();
        run.state = self.queue.step(&run.state, act, None);
        run.at += 1;
        act
    }

    fn expect(&self, expected: Act) {
        let act = self.step();
        self.same("the next act", &expected, &act);
    }

    fn phase(&self) -> Reading {
        self.run.borrow().state.reader.phase
    }

    fn same<T: PartialEq + core::fmt::Debug>(&self, what: &str, queue: &T, model: &T) {
        let at = self.run.borrow().at.min(self.path.len());
        assert!(queue == model, "{what}: {queue:?}, the model: {model:?}\npath: {:?}", &self.path[..at]);
    }

    /// Returns the serial number of the job in a slot.
    fn serial(&self, slot: u8) -> usize {
        let run = self.run.borrow();
        run.queued[run.queued.len() - usize::from(run.state.tail) + usize::from(slot)]
    }

    /// Returns a job that the writer makes.
    fn make(self: &Rc<Self>) -> Job {
        let mut run = self.run.borrow_mut();
        run.dropped.push(false);
        Job { serial: run.dropped.len() - 1, replay: self.clone() }
    }

    /// Runs the writer until the reader continues.
    fn write(self: &Rc<Self>) {
        self.observe();
        while self.peek().is_some_and(Act::is_writers) {
            let before = self.run.borrow().state.clone();
            let act = self.step();
            let Some(writer) = self.run.borrow_mut().writer.take() else {
                panic!("{act:?} without a writer")
            };
            self.run.borrow_mut().writes = true;
            let writer = self.write_one(writer, act, &before);
            let mut run = self.run.borrow_mut();
            (run.writer, run.writes) = (writer, false);
            drop(run);
            self.observe();
        }
    }

    fn write_one(
        self: &Rc<Self>,
        mut writer: Writer<'static, Job>,
        act: Act,
        before: &State,
    ) -> Option<Writer<'static, Job>> {
        let next = u16::from(before.writer.next);
        let last = before.last_number(self.queue.max).map(u16::from);
        let is_full = self.run.borrow().state.writer.phase == before.writer.phase;
        match act {
            Act::Claim => {
                let claimed = writer.claim().map(|claim| claim.number());
                self.same("claim", &claimed, &if is_full { Err(Full) } else { Ok(next) });
            }
            Act::DropClaim => drop(writer.claim().expect("it was claimed")),
            Act::Commit | Act::CommitRepeated | Act::CommitWrong => {
                let (number, expected) = match (act, last) {
                    (Act::Commit, _) => (next, Ok(())),
                    (Act::CommitRepeated, Some(number)) => (number, Err(NumberError::Repeated { number })),
                    _ if last == Some(next + 1) => {
                        (next + 1, Err(NumberError::Repeated { number: next + 1 }))
                    }
                    _ => (next + 1, Err(NumberError::Unexpected { expected: next, found: next + 1 })),
                };
                let claim = writer.claim().expect("it was claimed");
                self.same("commit", &claim.commit_with(number, || self.make()), &expected);
                self.queued(u8::from(expected.is_ok()));
            }
            Act::Batch(slots) => {
                self.same("batch", &writer.claim_batch(slots.into()).is_err(), &is_full);
            }
            Act::Publish | Act::DropBatch => self.write_batch(&mut writer, act == Act::Publish, before),
            Act::Clear => writer.clear(),
            Act::Reset => writer.reset(),
            Act::WriterLeaves => return None,
            _ => {} // a job of a batch
        }
        Some(writer)
    }

    /// Fills a batch as the model did.
    fn write_batch(self: &Rc<Self>, writer: &mut Writer<'static, Job>, publishes: bool, before: &State) {
        let Writing::Batch { slots, filled } = before.writer.phase else {
            panic!("no batch: {:?}", self.path)
        };
        let mut batch = writer.claim_batch(slots.into()).expect("it was claimed");
        for job in 0..filled {
            let number = after(before.writer.next, job, self.queue.max).into();
            if job % 2 == 0 {
                let claim = batch.claim().expect("it was claimed");
                self.same("in a batch", &claim.commit_with(number, || self.make()), &Ok(()));
            } else {
                batch.fill([self.make()]);
            }
        }
        self.same("the end of a batch", &batch.claim().is_err(), &(filled == slots));
        if publishes {
            self.same("published", &batch.publish(), &filled.into());
            self.queued(filled);
        }
    }

    /// Records that this many of the jobs that were made last are published.
    fn queued(&self, jobs: u8) {
        let mut run = self.run.borrow_mut();
        let made = run.dropped.len();
        run.queued.extend(made - usize::from(jobs)..made);
    }

    /// Compares the writer's view and the remaining jobs with the model.
    fn observe(&self) {
        let run = self.run.borrow();
        let state = &run.state;
        if let Some(writer) = &run.writer {
            self.same("settled", &writer.is_settled(), &state.is_settled(None));
            self.same("free", &writer.free(), &usize::from(self.queue.capacity - state.tail));
            self.same("next", &writer.next_number(), &state.writer.next.into());
            self.same("last", &writer.last_number(), &state.last_number(self.queue.max).map(u16::from));
            self.same("abandoned", &writer.is_abandoned(), &(state.reader.phase == Reading::Gone));
        }
        let queued = &run.queued[run.queued.len() - usize::from(state.tail)..];
        let is_left = |serial| {
            let at = queued.iter().position(|queued| *queued == serial);
            at.is_some_and(|at| state.number_at(at as u8).is_some())
        };
        let dropped: Vec<bool> = (0..run.dropped.len()).map(|serial| !is_left(serial)).collect();
        self.same("dropped", &run.dropped, &dropped);
    }

    /// Called when a job was dropped: completed, discarded, in a batch that was not published, or remaining when both ends
    /// are gone.
    fn dropped(self: &Rc<Self>, serial: usize) {
        assert!(
            !core::mem::replace(&mut self.run.borrow_mut().dropped[serial], true),
            "{serial} is dropped twice"
        );
        if self.run.borrow().writes {
            return;
        }
        match self.phase() {
            Reading::Finding { .. } | Reading::Obeying { .. } => {
                self.go_on();
                self.same("discarded", &serial, &self.serial(0));
                self.expect(Act::Discard);
            }
            Reading::Dropping { dropped, .. } => {
                self.same("dropped in a batch", &serial, &self.serial(dropped));
                self.expect(Act::Drop);
            }
            _ => return,
        }
        self.write();
    }

    /// Replays the path: the acts of the reader, and the acts of the writer in between.
    fn read(self: &Rc<Self>, mut reader: Reader<'static, Job>) {
        loop {
            self.list_waiting(&reader);
            self.write();
            if self.peek().is_none() {
                return;
            }
            match self.step() {
                Act::Look(Looks::Take) => {
                    let taken = reader.take();
                    self.go_on();
                    self.executing(taken);
                }
                Act::Look(Looks::Find) => {
                    let taken = reader.take_where(|number, job| self.is_wanted(number, job));
                    self.go_on();
                    self.executing(taken);
                }
                Act::Look(Looks::Batch) => {
                    let taken = reader.take_batch(2);
                    self.go_on();
                    self.executing_batch(taken);
                }
                Act::List => self.list(&reader),
                Act::AskGone => {
                    let knows = self.run.borrow().state.reader.knows_gone;
                    self.same("gone", &reader.is_abandoned(), &knows);
                }
                Act::ReaderLeaves => break,
                act => panic!("{act:?} while idle"),
            }
        }
        drop(reader);
        self.write();
        assert!(self.peek().is_none());
    }

    /// Goes on in the model until the queue calls out or returns.
    fn go_on(&self) {
        loop {
            let mut acts = Vec::new();
            self.queue.reader_acts(&self.run.borrow().state, &mut acts);
            match acts[..] {
                [act @ (Act::Load | Act::Pass | Act::Number | Act::Search | Act::Free)] => self.expect(act),
                _ => return,
            }
        }
    }

    fn is_wanted(self: &Rc<Self>, number: u16, job: &Job) -> bool {
        self.go_on();
        let Reading::Asking { at } = self.phase() else { panic!("{number} is asked for: {:?}", self.path) };
        self.same("asked for", &(number, job.serial), &self.job(at));
        self.write();
        self.step() == Act::Accept
    }

    /// Returns the number and the serial number of the job in a slot.
    fn job(&self, at: u8) -> (u16, usize) {
        let number = self.run.borrow().state.number_at(at);
        (number.map_or(0, u16::from), self.serial(at))
    }

    fn list(self: &Rc<Self>, reader: &Reader<'static, Job>) {
        let mut jobs = reader.iter();
        self.expect(Act::Load);
        loop {
            self.write();
            let Reading::Listed { .. } = self.phase() else { return };
            let found = jobs.next().map(|(number, job)| (number, job.serial));
            self.expect(Act::Search);
            let listed = match self.phase() {
                Reading::Listed { at, .. } => Some(self.job(at - 1)),
                _ => None,
            };
            self.same("listed", &found, &listed);
        }
    }

    fn list_waiting(&self, reader: &Reader<'static, Job>) {
        let waiting: Vec<_> = self.run.borrow().state.waiting().map(|(at, _)| at).collect();
        let waiting: Vec<_> = waiting.into_iter().map(|at| self.job(at)).collect();
        let jobs: Vec<_> = reader.iter().map(|(number, job)| (number, job.serial)).collect();
        self.same("waiting", &jobs, &waiting);
        self.same("how many wait", &reader.len(), &waiting.len());
    }

    /// Executes a job until it is completed or dropped.
    fn executing(self: &Rc<Self>, taken: Option<TakenJob<'_, Job>>) {
        let Reading::Executing { at } = self.phase() else {
            return self.same("taken", &taken.map(|job| job.number()), &None);
        };
        let Some(job) = taken else { panic!("no job is taken: {:?}", self.path) };
        self.same("taken", &(job.number(), job.serial), &self.job(at));
        let serial = job.serial;
        self.write();
        self.same("in execution", &job.serial, &serial);
        match self.peek().map(|_| self.step()) {
            Some(Act::Complete) => {
                let job = job.complete();
                self.same("completed", &job.serial, &serial);
            }
            Some(Act::GiveUp) | None => drop(job),
            Some(act) => panic!("{act:?} while a job is executed"),
        }
    }

    /// Executes a batch until it is completed or dropped.
    fn executing_batch(self: &Rc<Self>, taken: Option<TakenBatch<'_, Job>>) {
        let Reading::ExecutingBatch { row } = self.phase() else {
            return self.same("a batch is taken", &taken.is_some(), &false);
        };
        let Some(mut batch) = taken else { panic!("no batch is taken: {:?}", self.path) };
        let jobs: Vec<_> = (0..row).map(|at| self.job(at)).collect();
        let mut look = || batch.iter_mut().map(|(number, job)| (number, job.serial)).collect::<Vec<_>>();
        self.same("taken in a batch", &look(), &jobs);
        self.write();
        self.same("in execution", &look(), &jobs);
        match self.peek().map(|_| self.step()) {
            Some(Act::Complete) => {
                batch.complete();
                self.go_on();
            }
            Some(Act::GiveUp) | None => drop(batch),
            Some(act) => panic!("{act:?} while a batch is executed"),
        }
    }
}
