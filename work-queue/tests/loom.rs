//! Model checking of the code that ships: loom runs every interleaving and every reordering that the memory model allows, and
//! sees each access to a slot that the accesses of the other end do not happen before. Run with `.ci/loom`.
//!
//! The last tests weaken each ordering and remove each check of the mark in turn, and expect a model to fail.
#![cfg(all(feature = "alloc", loom))]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]
#![expect(clippy::arc_with_non_send_sync, reason = "loom's cells are checked at every access instead")]

use core::cell::Cell;
use core::sync::atomic::{AtomicUsize, Ordering::SeqCst};
use std::process::Command;
use std::sync::Arc;

use loom::cell::UnsafeCell;
use loom::sync::Notify;
use loom::thread;
use robot_work_queue::{NoWake, Reader, Wake, WorkQueue, Writer, boxed, boxed_with, check, order};

/// A job that counts its drops, and that is torn if its halves differ.
struct Job {
    value: u16,
    copy: u16,
    drops: Arc<Counter>,
    dropped: Cell<bool>,
}

#[derive(Default)]
struct Counter {
    made: AtomicUsize,
    dropped: AtomicUsize,
}

impl Counter {
    fn job(self: &Arc<Self>, value: u16) -> Job {
        self.made.fetch_add(1, SeqCst);
        Job { value, copy: value, drops: self.clone(), dropped: Cell::new(false) }
    }

    fn assert_each_dropped_once(&self) {
        assert_eq!(self.dropped.load(SeqCst), self.made.load(SeqCst), "every job is dropped once");
    }
}

impl Drop for Job {
    fn drop(&mut self) {
        assert!(!self.dropped.replace(true), "a job is dropped twice");
        self.drops.dropped.fetch_add(1, SeqCst);
    }
}

/// Something outside of the queue that only the queue's orderings protect: what the robot did.
#[derive(Clone)]
struct World(Arc<UnsafeCell<Vec<u16>>>);

// SAFETY: loom checks every access.
unsafe impl Send for World {}

impl World {
    fn new() -> Self {
        World(Arc::new(UnsafeCell::new(Vec::new())))
    }

    fn act(&self, value: u16) {
        // SAFETY: loom checks that nobody else is at it.
        self.0.with_mut(|done| unsafe { (*done).push(value) });
    }

    fn look(&self) -> Vec<u16> {
        // SAFETY: loom checks that nobody writes.
        self.0.with(|done| unsafe { (*done).clone() })
    }
}

fn model(run: impl Fn() + Send + Sync + 'static) {
    model_with(None, run);
}

/// With at most this many preemptions: every interleaving of a longer model takes minutes to hours.
fn model_with(preemptions: Option<usize>, run: impl Fn() + Send + Sync + 'static) {
    let mutant = std::env::var("WEAKEN").ok().map(|index| order::MUTANTS[index.parse::<usize>().unwrap()]);
    order::weaken(mutant);
    let removed = std::env::var("REMOVE").ok();
    check::remove(removed.map(|name| *check::MUTANTS.iter().find(|known| **known == name).unwrap()));
    let mut builder = loom::model::Builder::new();
    builder.preemption_bound = preemptions;
    builder.check(run);
}

fn queue_next<R: Wake>(writer: &mut Writer<'_, Job, R>, jobs: &Arc<Counter>) {
    loop {
        if let Ok(claim) = writer.claim() {
            let number = claim.number();
            claim.commit_with(number, || jobs.job(number)).unwrap();
            return;
        }
        thread::yield_now();
    }
}

/// Executes one job if there is one, and returns its number.
fn execute(reader: &mut Reader<'_, Job>) -> Option<u16> {
    let job = reader.take()?;
    let number = job.number();
    assert_eq!((job.value, job.copy), (number, number), "a job is torn");
    let job = job.complete();
    assert_eq!((job.value, job.copy), (number, number), "a job is torn");
    Some(number)
}

fn execute_next(reader: &mut Reader<'_, Job>) -> u16 {
    loop {
        match execute(reader) {
            Some(number) => return number,
            None => thread::yield_now(),
        }
    }
}

/// Executes until the writer is gone and nothing is left.
fn execute_all(reader: &mut Reader<'_, Job>) -> Vec<u16> {
    let mut numbers = Vec::new();
    loop {
        let last_look = reader.is_abandoned();
        match execute(reader) {
            Some(number) => numbers.push(number),
            None if last_look => return numbers,
            None => thread::yield_now(),
        }
    }
}

mod models {
    use super::*;

    fn publish_and_release(capacity: usize, count: u16) {
        model_with((capacity > 1).then_some(3), move || {
            let jobs = Arc::new(Counter::default());
            let (mut writer, mut reader) = boxed::<Job>(capacity, 9).unwrap();
            let reader = thread::spawn(move || {
                for number in 1..=count {
                    assert_eq!(execute_next(&mut reader), number);
                }
                assert_eq!(execute(&mut reader), None);
            });
            for _ in 0..count {
                queue_next(&mut writer, &jobs);
            }
            reader.join().unwrap();
            assert_eq!(writer.free(), capacity);
            drop(writer);
            jobs.assert_each_dropped_once();
        });
    }

    #[test]
    fn publish_and_release_capacity_1() {
        publish_and_release(1, 3);
    }

    #[test]
    fn publish_and_release_capacity_2() {
        publish_and_release(2, 4);
    }

    #[test]
    fn publish_and_release_capacity_3() {
        publish_and_release(3, 4);
    }

    /// The writer finds the queue full, and fills again at the low-water mark.
    #[test]
    fn full_then_low_water() {
        model(|| {
            let jobs = Arc::new(Counter::default());
            let (mut writer, mut reader) = boxed::<Job>(2, 9).unwrap();
            queue_next(&mut writer, &jobs);
            queue_next(&mut writer, &jobs);
            let world = World::new();
            let robot = world.clone();
            let reader = thread::spawn(move || {
                for _ in 0..2 {
                    let job = reader.take().unwrap();
                    robot.act(job.value);
                    job.complete();
                }
                reader
            });
            while !writer.drained(0) {
                thread::yield_now();
            }
            assert_eq!(world.look(), [1, 2], "a drained queue means executed jobs");
            queue_next(&mut writer, &jobs);
            assert_eq!(
                execute_all(&mut {
                    drop(writer);
                    reader.join().unwrap()
                }),
                [3]
            );
            jobs.assert_each_dropped_once();
        });
    }

    /// The second job overtakes the first; its slot is filled again only behind that of the first.
    fn out_of_order(capacity: usize, count: u16) {
        model_with((capacity > 2).then_some(3), move || {
            let jobs = Arc::new(Counter::default());
            let (mut writer, mut reader) = boxed::<Job>(capacity, 9).unwrap();
            let reader = thread::spawn(move || {
                let mut numbers = Vec::new();
                while numbers.len() < count.into() {
                    let job = match reader.take_where(|number, _| number % 2 == 0) {
                        Some(job) => Some(job),
                        None => reader.take(),
                    };
                    match job {
                        Some(job) => {
                            assert_eq!((job.value, job.copy), (job.number(), job.number()));
                            numbers.push(job.complete().value);
                        }
                        None => thread::yield_now(),
                    }
                }
                assert!(reader.is_empty());
                numbers.sort_unstable();
                assert!(numbers.into_iter().eq(1..=count), "each job once");
            });
            for _ in 0..count {
                queue_next(&mut writer, &jobs);
            }
            reader.join().unwrap();
            assert_eq!(writer.free(), capacity);
            drop(writer);
            jobs.assert_each_dropped_once();
        });
    }

    #[test]
    fn out_of_order_capacity_2() {
        out_of_order(2, 3);
    }

    #[test]
    fn out_of_order_capacity_3() {
        out_of_order(3, 4);
    }

    /// Two jobs, a reset, a third job: the reset comes before, during and after the execution of each of the first two.
    fn abort(capacity: usize) {
        model(move || {
            let jobs = Arc::new(Counter::default());
            let (mut writer, mut reader) = boxed::<Job>(capacity, 9).unwrap();
            let world = World::new();
            let robot = world.clone();
            let reader = thread::spawn(move || {
                let mut numbers = Vec::new();
                loop {
                    let last_look = reader.is_abandoned();
                    match reader.take() {
                        Some(job) => {
                            robot.act(job.value);
                            thread::yield_now(); // the reset during execution
                            assert_eq!((job.value, job.copy), (job.number(), job.number()), "pulled away");
                            numbers.push(job.complete().value);
                        }
                        None if last_look => return numbers,
                        None => thread::yield_now(),
                    }
                }
            });
            queue_next(&mut writer, &jobs);
            if capacity > 1 {
                queue_next(&mut writer, &jobs);
            }
            let after = writer.next_number();
            writer.clear();
            while !writer.is_settled() {
                thread::yield_now();
            }
            let executed = world.look(); // nothing from before runs any more: loom would see it
            assert_eq!(writer.free(), capacity);
            queue_next(&mut writer, &jobs);
            drop(writer);
            let mut numbers = reader.join().unwrap();
            assert_eq!(numbers.pop(), Some(after), "a job queued after the reset is kept");
            assert_eq!(numbers, executed, "nothing from before the reset starts after it has settled");
            assert!((1..).zip(&numbers).all(|(expected, number)| expected == *number), "in order");
            jobs.assert_each_dropped_once();
        });
    }

    #[test]
    fn abort_capacity_1() {
        abort(1);
    }

    #[test]
    fn abort_capacity_2() {
        abort(2);
    }

    /// A job queued after the reset, without waiting for it to settle: kept, and nothing older starts after it.
    #[test]
    fn queued_behind_a_reset() {
        model(|| {
            let jobs = Arc::new(Counter::default());
            let (mut writer, mut reader) = boxed::<Job>(3, 9).unwrap();
            let reader = thread::spawn(move || execute_all(&mut reader));
            queue_next(&mut writer, &jobs);
            queue_next(&mut writer, &jobs);
            writer.reset();
            writer.claim().unwrap().commit_with(1, || jobs.job(1)).unwrap();
            drop(writer);
            let numbers = reader.join().unwrap();
            assert!([&[1][..], &[1, 1], &[1, 2, 1]].contains(&&*numbers), "{numbers:?}");
            jobs.assert_each_dropped_once();
        });
    }

    /// Two jobs, a reset, a third job: a reader that has seen the third looks for a job.
    fn look_after_a_reset(look: fn(&mut Reader<'_, Job>) -> Option<u16>) {
        model(move || {
            let jobs = Arc::new(Counter::default());
            let (mut writer, mut reader) = boxed::<Job>(3, 9).unwrap();
            let reader = thread::spawn(move || {
                while !reader.iter().any(|(number, _)| number == 3) {
                    thread::yield_now();
                }
                assert_eq!(look(&mut reader), Some(3), "what a reset has discarded is not executed");
            });
            queue_next(&mut writer, &jobs);
            queue_next(&mut writer, &jobs);
            writer.clear();
            queue_next(&mut writer, &jobs);
            reader.join().unwrap();
            assert!(writer.is_settled(), "a look lets a reset settle");
            assert_eq!(writer.free(), 3);
            drop(writer);
            jobs.assert_each_dropped_once();
        });
    }

    #[test]
    fn take_after_a_reset() {
        look_after_a_reset(|reader| execute(reader));
    }

    #[test]
    fn batch_after_a_reset() {
        look_after_a_reset(|reader| {
            let mut batch = reader.take_batch(1)?;
            let number = batch.iter_mut().next().map(|(number, _)| number);
            batch.complete();
            number
        });
    }

    #[test]
    fn find_after_a_reset() {
        look_after_a_reset(|reader| {
            let job = reader.take_where(|_, _| true)?;
            Some(job.complete().value)
        });
    }

    /// A job completed out of order and a reset: the discarded one before it is not discarded twice, nor the overtaker at all.
    #[test]
    fn out_of_order_across_a_reset() {
        model_with(Some(3), || {
            let jobs = Arc::new(Counter::default());
            let (mut writer, mut reader) = boxed::<Job>(3, 9).unwrap();
            queue_next(&mut writer, &jobs);
            queue_next(&mut writer, &jobs);
            let reader = thread::spawn(move || {
                let mut numbers = Vec::new();
                if let Some(job) = reader.take_where(|number, _| number == 2) {
                    numbers.push(job.complete().value);
                }
                if let Some(job) = reader.take_where(|number, _| number == 3) {
                    numbers.push(job.complete().value);
                }
                numbers.extend(execute_all(&mut reader));
                numbers
            });
            writer.clear();
            queue_next(&mut writer, &jobs);
            queue_next(&mut writer, &jobs);
            drop(writer);
            let numbers = reader.join().unwrap();
            assert_eq!(numbers.iter().filter(|&&number| number > 2).count(), 2, "{numbers:?}");
            assert!(numbers.iter().all(|number| numbers.iter().filter(|n| *n == number).count() == 1));
            jobs.assert_each_dropped_once();
        });
    }

    /// Two resets, one behind the other.
    #[test]
    fn two_resets() {
        model(|| {
            let jobs = Arc::new(Counter::default());
            let (mut writer, mut reader) = boxed::<Job>(2, 9).unwrap();
            let reader = thread::spawn(move || execute_all(&mut reader));
            queue_next(&mut writer, &jobs);
            writer.clear();
            queue_next(&mut writer, &jobs);
            writer.clear();
            drop(writer);
            let numbers = reader.join().unwrap();
            assert!([&[][..], &[1], &[2], &[1, 2]].contains(&&*numbers), "{numbers:?}");
            jobs.assert_each_dropped_once();
        });
    }

    /// The writer leaves: the reader finds everything that was queued before, and then knows that nothing will come.
    #[test]
    fn writer_leaves_then_drain() {
        model(|| {
            let jobs = Arc::new(Counter::default());
            let (mut writer, mut reader) = boxed::<Job>(2, 9).unwrap();
            let reader = thread::spawn(move || assert_eq!(execute_all(&mut reader), [1, 2]));
            queue_next(&mut writer, &jobs);
            queue_next(&mut writer, &jobs);
            drop(writer);
            reader.join().unwrap();
            jobs.assert_each_dropped_once();
        });
    }

    /// The same with inline storage, whose ends free nothing.
    #[test]
    fn writer_leaves_then_drain_inline() {
        model(|| {
            let queue = Box::leak(Box::new(WorkQueue::<u16, 2>::new(9).unwrap()));
            let (mut writer, mut reader) = queue.split();
            let reader = thread::spawn(move || {
                while !reader.is_abandoned() {
                    thread::yield_now();
                }
                assert_eq!(reader.take().unwrap().complete(), 1);
                assert_eq!(reader.take().unwrap().complete(), 2);
                assert!(reader.take().is_none());
            });
            writer.claim().unwrap().push(1);
            writer.claim().unwrap().push(2);
            drop(writer);
            reader.join().unwrap();
        });
    }

    /// The reader leaves: the writer sees it, and all that the reader did.
    #[test]
    fn reader_leaves() {
        model(|| {
            let jobs = Arc::new(Counter::default());
            let (mut writer, mut reader) = boxed::<Job>(2, 9).unwrap();
            queue_next(&mut writer, &jobs);
            queue_next(&mut writer, &jobs);
            let world = World::new();
            let robot = world.clone();
            let reader = thread::spawn(move || {
                execute(&mut reader);
                robot.act(1);
            });
            while !writer.is_abandoned() {
                thread::yield_now();
            }
            assert_eq!((world.look(), writer.free()), (vec![1], 1));
            drop(writer);
            reader.join().unwrap();
            jobs.assert_each_dropped_once();
        });
    }

    /// Both leave at once: whoever is second drops what is left, and sees all of it.
    #[test]
    fn both_leave() {
        model(|| {
            let jobs = Arc::new(Counter::default());
            let (mut writer, mut reader) = boxed::<Job>(3, 9).unwrap();
            let reader = thread::spawn(move || {
                if let Some(job) = reader.take_where(|number, _| number == 2) {
                    job.complete();
                }
                let _ = reader.take();
            });
            queue_next(&mut writer, &jobs);
            queue_next(&mut writer, &jobs);
            drop(writer);
            reader.join().unwrap();
            jobs.assert_each_dropped_once();
        });
    }

    /// Batches on both sides, a reset in the middle of one: what was published before is executed or discarded, in order; what is
    /// published afterwards is kept; each job has its number.
    fn batches_and_a_reset(reset: fn(&mut Writer<'_, Job>), next: u16) {
        model(move || {
            let jobs = Arc::new(Counter::default());
            let (mut writer, mut reader) = boxed::<Job>(3, 9).unwrap();
            let reader = thread::spawn(move || {
                let mut numbers = Vec::new();
                loop {
                    let last_look = reader.is_abandoned();
                    match reader.take_batch(2) {
                        Some(mut batch) => {
                            for (number, job) in batch.iter_mut() {
                                assert_eq!(
                                    (job.value, job.copy),
                                    (number, number),
                                    "torn, or of another number"
                                );
                                job.copy = 0; // nobody else has it
                                numbers.push(number);
                            }
                            batch.complete();
                        }
                        None if last_look => return numbers,
                        None => thread::yield_now(),
                    }
                }
            });
            let mut batch = writer.claim_batch(2).unwrap();
            batch.claim().unwrap().commit_with(1, || jobs.job(1)).unwrap();
            batch.fill([jobs.job(2)]);
            assert_eq!(batch.publish(), 2);
            reset(&mut writer);
            assert_eq!(writer.next_number(), next);
            for publish in [false, true] {
                let mut batch = writer.claim_batch(1).unwrap();
                batch.fill([jobs.job(next)]);
                if publish {
                    assert_eq!(batch.publish(), 1);
                }
            }
            drop(writer);
            let mut numbers = reader.join().unwrap();
            assert_eq!(numbers.pop(), Some(next), "a job queued after the reset is kept");
            assert!([&[][..], &[1], &[1, 2]].contains(&&*numbers), "{numbers:?}");
            jobs.assert_each_dropped_once();
        });
    }

    #[test]
    fn batches_and_a_clear() {
        batches_and_a_reset(|writer| writer.clear(), 3);
    }

    #[test]
    fn batches_and_a_restart_of_the_numbers() {
        batches_and_a_reset(|writer| writer.reset(), 1);
    }

    /// A reset that the reader may never see is followed by another one: the numbers still are those of the jobs.
    #[test]
    fn numbers_after_two_resets() {
        model(|| {
            let jobs = Arc::new(Counter::default());
            let (mut writer, mut reader) = boxed::<Job>(3, 9).unwrap();
            let reader = thread::spawn(move || execute_all(&mut reader));
            queue_next(&mut writer, &jobs);
            writer.reset();
            queue_next(&mut writer, &jobs);
            writer.clear();
            queue_next(&mut writer, &jobs);
            drop(writer);
            let numbers = reader.join().unwrap();
            assert!([&[2][..], &[1, 2], &[1, 1, 2]].contains(&&*numbers), "{numbers:?}");
            jobs.assert_each_dropped_once();
        });
    }

    /// A queue in a static: one pair of ends at a time, and the second pair starts empty.
    #[test]
    fn a_static_queue_is_split_again() {
        model(|| {
            let queue: &'static _ = Box::leak(Box::new(WorkQueue::<u16, 2>::numbered::<9>()));
            let (mut writer, mut reader) = queue.split_static(NoWake, NoWake).unwrap();
            let reader = thread::spawn(move || {
                assert!(reader.take().is_none_or(|job| job.complete() == 1));
            });
            assert_eq!(writer.claim().unwrap().push(1), 1);
            drop(writer);
            let (mut writer, mut again) = loop {
                match queue.split_static(NoWake, NoWake) {
                    Some(ends) => break ends,
                    None => thread::yield_now(),
                }
            };
            assert_eq!([7, 8].map(|job| writer.claim().unwrap().push(job)), [1, 2]);
            assert_eq!([(); 2].map(|()| again.take().unwrap().complete()), [7, 8]);
            reader.join().unwrap();
        });
    }

    /// A reader that sleeps until it is woken executes everything.
    #[test]
    fn a_sleeping_reader_misses_nothing() {
        model(|| {
            let jobs = Arc::new(Counter::default());
            let event = Arc::new(Notify::new());
            let wake = event.clone();
            let (mut writer, mut reader) =
                boxed_with::<Job, _, _>(2, 9, move || wake.notify(), NoWake).unwrap();
            let reader = thread::spawn(move || {
                let mut numbers = Vec::new();
                loop {
                    let last_look = reader.is_abandoned();
                    match execute(&mut reader) {
                        Some(number) => numbers.push(number),
                        None if last_look => return numbers,
                        None => event.wait(),
                    }
                }
            });
            queue_next(&mut writer, &jobs);
            queue_next(&mut writer, &jobs);
            drop(writer);
            assert_eq!(reader.join().unwrap(), [1, 2]);
            jobs.assert_each_dropped_once();
        });
    }

    /// A job stays in its slot as long as its guard lives, whatever the writer does.
    #[test]
    fn held_while_the_writer_goes_on() {
        model(|| {
            let jobs = Arc::new(Counter::default());
            let (mut writer, mut reader) = boxed::<Job>(2, 9).unwrap();
            queue_next(&mut writer, &jobs);
            let reader = thread::spawn(move || {
                if let Some(job) = reader.take() {
                    thread::yield_now();
                    assert_eq!((job.value, job.copy), (1, 1));
                } // not completed: it waits again, unless a reset discards it
                execute_all(&mut reader)
            });
            queue_next(&mut writer, &jobs);
            assert!(writer.claim().is_err() || writer.free() > 0);
            writer.clear();
            drop(writer);
            let numbers = reader.join().unwrap();
            assert!([&[][..], &[1], &[1, 2]].contains(&&*numbers), "{numbers:?}");
            jobs.assert_each_dropped_once();
        });
    }
}

/// For each ordering that can be weakened: a model that fails then, and what it says.
const GUARDS: [(&str, &str, &str); 9] = [
    ("publish_tail", "publish_and_release_capacity_1", "Causality violation"),
    ("observe_tail", "publish_and_release_capacity_1", "Causality violation"),
    ("publish_head", "publish_and_release_capacity_1", "Causality violation"),
    ("observe_head", "publish_and_release_capacity_1", "Causality violation"),
    ("publish_leave", "writer_leaves_then_drain_inline", "on a `None` value"),
    ("observe_leave", "writer_leaves_then_drain_inline", "on a `None` value"),
    ("leave_second", "both_leave", "every job is dropped once"),
    ("publish_free", "a_static_queue_is_split_again", "Causality violation"),
    ("split", "a_static_queue_is_split_again", "Causality violation"),
];

/// For each check that can be removed: a model that fails then, and its message.
const CHECK_GUARDS: [(&str, &str, &str); 3] = [
    ("mark_in_take", "take_after_a_reset", "what a reset has discarded is not executed"),
    ("mark_in_batch", "batch_after_a_reset", "what a reset has discarded is not executed"),
    ("mark_in_find", "find_after_a_reset", "what a reset has discarded is not executed"),
];

/// Every ordering is needed: weaken any one of them, and a model fails.
#[test]
fn every_weakened_ordering_fails() {
    for (index, mutant) in order::MUTANTS.iter().enumerate() {
        let (_, model, complaint) = GUARDS.into_iter().find(|guard| guard.0 == mutant.0).unwrap();
        assert_fails(model, complaint, "WEAKEN", &index.to_string(), &format!("{mutant:?}"));
    }
}

/// Every check of the mark is needed: remove any one of them, and a model fails.
#[test]
fn every_removed_check_fails() {
    for mutant in check::MUTANTS {
        let (_, model, complaint) = CHECK_GUARDS.into_iter().find(|guard| guard.0 == *mutant).unwrap();
        assert_fails(model, complaint, "REMOVE", mutant, mutant);
    }
}

/// Runs a model with a mutant in a process of its own: loom does not always survive the failure of a model.
fn assert_fails(model: &str, complaint: &str, variable: &str, value: &str, mutant: &str) {
    let run = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", &format!("models::{model}"), "--nocapture"])
        .env(variable, value)
        .output()
        .unwrap();
    let output = format!("{run:?}");
    assert!(output.contains("running 1 test"), "{model} did not run");
    assert!(!run.status.success(), "{model} passes with {mutant}");
    assert!(output.contains(complaint), "{model} fails with {mutant} for another reason: {output}");
    println!("{mutant}: {model} fails");
}
