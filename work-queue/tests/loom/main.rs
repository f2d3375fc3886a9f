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

/// State outside of the queue that only the queue's orderings protect: the robot's work.
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

/// Explores a model with at most this many preemptions: every interleaving of a longer model takes minutes to hours.
fn model_with(preemptions: Option<usize>, run: impl Fn() + Send + Sync + 'static) {
    let mutant = std::env::var("WEAKEN").ok().map(|index| order::MUTANTS[index.parse::<usize>().unwrap()]);
    order::weaken(mutant);
    let removed = std::env::var("REMOVE").ok();
    check::remove(removed.map(|name| *check::MUTANTS.iter().find(|known| **known == name).unwrap()));
    let mut builder = loom::model::Builder::new();
    builder.preemption_bound = preemptions;
    builder.check(run);
}

/// Explores a model of a queue of this capacity, and of its two ends: each job is dropped once when both are gone.
fn model_of(
    capacity: usize,
    run: impl Fn(&Arc<Counter>, Writer<'static, Job>, Reader<'static, Job>) + Send + Sync + 'static,
) {
    model_of_with(None, capacity, run);
}

fn model_of_with(
    preemptions: Option<usize>,
    capacity: usize,
    run: impl Fn(&Arc<Counter>, Writer<'static, Job>, Reader<'static, Job>) + Send + Sync + 'static,
) {
    model_with(preemptions, move || {
        let jobs = Arc::new(Counter::default());
        let (writer, reader) = boxed::<Job>(capacity, 9).unwrap();
        run(&jobs, writer, reader);
        jobs.assert_each_dropped_once();
    });
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

mod ends;
mod models;

/// For each ordering that can be weakened: a model that fails then, and its message.
const GUARDS: [(&str, &str, &str); 9] = [
    ("publish_tail", "models::publish_and_release_capacity_1", "Causality violation"),
    ("observe_tail", "models::publish_and_release_capacity_1", "Causality violation"),
    ("publish_head", "models::publish_and_release_capacity_1", "Causality violation"),
    ("observe_head", "models::publish_and_release_capacity_1", "Causality violation"),
    ("publish_leave", "ends::writer_leaves_then_drain_inline", "on a `None` value"),
    ("observe_leave", "ends::writer_leaves_then_drain_inline", "on a `None` value"),
    ("leave_second", "ends::both_leave", "every job is dropped once"),
    ("publish_free", "ends::a_static_queue_is_split_again", "Causality violation"),
    ("split", "ends::a_static_queue_is_split_again", "Causality violation"),
];

/// For each check that can be removed: a model that fails then, and its message.
const CHECK_GUARDS: [(&str, &str, &str); 3] = [
    ("mark_in_take", "models::take_after_a_reset", "what a reset has discarded is not executed"),
    ("mark_in_batch", "models::batch_after_a_reset", "what a reset has discarded is not executed"),
    ("mark_in_find", "models::find_after_a_reset", "what a reset has discarded is not executed"),
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
        .args(["--exact", model, "--nocapture"])
        .env(variable, value)
        .output()
        .unwrap();
    let output = format!("{run:?}");
    assert!(output.contains("running 1 test"), "{model} did not run");
    assert!(!run.status.success(), "{model} passes with {mutant}");
    assert!(output.contains(complaint), "{model} fails with {mutant} for another reason: {output}");
    println!("{mutant}: {model} fails");
}
