//! Every path of the model on the queue itself, in one thread: a job that is discarded and a question whether a job is wanted
//! call out, and the writer goes on there.

use std::cell::RefCell;
use std::rc::Rc;

use robot_work_queue::{Full, NumberError, Reader, Taken, Writer, boxed};

use super::queue::{Act, Queue};
use super::state::{Reading, State};
use crate::model::{Options, System, explore};

/// How much was replayed.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Refined {
    /// The states of the model, each of which was visited.
    pub states: usize,
    /// The transitions, each of which was taken.
    pub transitions: usize,
    /// The paths.
    pub walks: usize,
    /// The acts.
    pub steps: usize,
}

/// Replays every walk of `queue`, which is [`single`](Queue::single).
///
/// # Panics
/// Where the queue does something else than the model, with the path to it.
pub fn refine(queue: Queue) -> Refined {
    assert!(queue.single, "one thread cannot interrupt itself");
    let graph = explore(&queue, &Options { edges: true, ..Options::default() });
    assert!(graph.holds());
    let mut refined = Refined { states: graph.states, transitions: graph.edges.len(), ..Refined::default() };
    for path in graph.walks() {
        refined.walks += 1;
        refined.steps += path.len();
        walk(queue, path);
    }
    refined
}

fn walk(queue: Queue, path: Vec<Act>) {
    let (writer, reader) =
        boxed(queue.capacity.into(), queue.max.into()).expect("the model's queues can be made");
    let run = Run { at: 0, state: queue.init(), writer: Some(writer), dropped: Vec::new() };
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
    /// Each job ever queued, by its serial number.
    dropped: Vec<bool>,
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
    /// The next act of the path.
    fn peek(&self) -> Option<Act> {
        self.path.get(self.run.borrow().at).copied()
    }

    /// Takes the next act in the model. Where the path ends within an operation, the operation goes on.
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

    /// The serial number of the job in a slot.
    fn serial(&self, slot: u8) -> usize {
        let run = self.run.borrow();
        run.dropped.len() - usize::from(run.state.writer.tail) + usize::from(slot)
    }

    /// Does what the writer does next, until the reader goes on.
    fn write(self: &Rc<Self>) {
        self.observe();
        while self.peek().is_some_and(Act::is_writers) {
            let before = self.run.borrow().state.clone();
            let act = self.step();
            let Some(mut writer) = self.run.borrow_mut().writer.take() else {
                panic!("{act:?} without a writer")
            };
            let (next, last) =
                (u16::from(before.writer.next), before.last_number(self.queue.max).map(u16::from));
            let mut commit = |number| {
                let job = || {
                    let mut run = self.run.borrow_mut();
                    run.dropped.push(false);
                    Job { serial: run.dropped.len() - 1, replay: self.clone() }
                };
                writer.claim().expect("it was claimed").commit_with(number, job)
            };
            match act {
                Act::Claim => {
                    let is_full = self.run.borrow().state.writer.phase == before.writer.phase;
                    let claimed = writer.claim().map(|claim| claim.number());
                    self.same("claim", &claimed, &if is_full { Err(Full) } else { Ok(next) });
                }
                Act::DropClaim => drop(writer.claim().expect("it was claimed")),
                Act::Commit => self.same("commit", &commit(next), &Ok(())),
                Act::CommitRepeated | Act::CommitWrong => {
                    let found = last.filter(|_| act == Act::CommitRepeated).unwrap_or(next + 1);
                    let refused = match last {
                        Some(number) if number == found => NumberError::Repeated { number },
                        _ => NumberError::Unexpected { expected: next, found },
                    };
                    self.same("commit", &commit(found), &Err(refused));
                }
                Act::Clear => writer.clear(),
                Act::Reset => writer.reset(),
                _ => {
                    drop(writer);
                    continue;
                }
            }
            self.run.borrow_mut().writer = Some(writer);
            self.observe();
        }
    }

    /// What the writer can see, and which jobs are left.
    fn observe(&self) {
        let run = self.run.borrow();
        let state = &run.state;
        if let Some(writer) = &run.writer {
            self.same("settled", &writer.is_settled(), &state.is_settled(None));
            self.same("free", &writer.free(), &usize::from(self.queue.capacity - state.writer.tail));
            self.same("next", &writer.next_number(), &state.writer.next.into());
            self.same("last", &writer.last_number(), &state.last_number(self.queue.max).map(u16::from));
            self.same("abandoned", &writer.is_abandoned(), &(state.reader.phase == Reading::Gone));
        }
        let head = run.dropped.len() - usize::from(state.writer.tail);
        let is_left = |serial: usize| {
            serial
                .checked_sub(head)
                .is_some_and(|at| state.slots.get(at).is_some_and(|slot| slot.job.is_some()))
        };
        let dropped: Vec<bool> = (0..run.dropped.len()).map(|serial| !is_left(serial)).collect();
        self.same("dropped", &run.dropped, &dropped);
    }

    /// A job was dropped: completed, discarded, or left when both ends are gone.
    fn dropped(self: &Rc<Self>, serial: usize) {
        assert!(
            !core::mem::replace(&mut self.run.borrow_mut().dropped[serial], true),
            "{serial} is dropped twice"
        );
        if matches!(self.phase(), Reading::Obeying { .. }) {
            self.same("discarded", &serial, &self.serial(0));
            self.expect(Act::Discard);
            self.write();
        }
    }

    /// Replays the path: what the reader does, and what the writer does in between.
    fn read(self: &Rc<Self>, mut reader: Reader<'static, Job>) {
        loop {
            self.list_waiting(&reader);
            self.write();
            if self.peek().is_none() {
                return;
            }
            match self.step() {
                Act::Take => {
                    let taken = reader.take();
                    self.expect(Act::Look);
                    self.executing(taken);
                }
                Act::Find => {
                    let taken = reader.take_where(|number, job| self.is_wanted(number, job));
                    self.find_on();
                    self.executing(taken);
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

    /// Goes on in the model to the next job that the reader looks at.
    fn find_on(&self) {
        loop {
            match self.phase() {
                Reading::Obeying { .. } => self.expect(Act::Look),
                Reading::Searching { .. } => self.expect(Act::Search),
                _ => return,
            }
        }
    }

    fn is_wanted(self: &Rc<Self>, number: u16, job: &Job) -> bool {
        self.find_on();
        let Reading::Asking { at } = self.phase() else { panic!("{number} is asked for: {:?}", self.path) };
        self.same("asked for", &(number, job.serial), &self.job(at));
        self.write();
        self.step() == Act::Accept
    }

    /// The number and the serial number of the job in a slot.
    fn job(&self, at: u8) -> (u16, usize) {
        let number = self.run.borrow().state.waiting_at(at);
        (number.map_or(0, u16::from), self.serial(at))
    }

    fn list(self: &Rc<Self>, reader: &Reader<'static, Job>) {
        let mut jobs = reader.iter();
        loop {
            self.write();
            let Reading::Searching { .. } = self.phase() else { return };
            let found = jobs.next().map(|(number, job)| (number, job.serial));
            self.expect(Act::Search);
            let listed = match self.phase() {
                Reading::Searching { at, .. } => Some(self.job(at - 1)),
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
    }

    /// From when a job begins to be executed until it is not any more.
    fn executing(self: &Rc<Self>, taken: Option<Taken<'_, Job>>) {
        let Reading::Executing { at, .. } = self.phase() else {
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
}
