//! The model of the work queue is the queue: every state and every transition, replayed.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]
#![cfg(feature = "links")]

use testkit::links::work_queue::{Looks, Queue, refine};
use testkit::model::{Options, explore, explore_whole};

fn replay(capacity: u8) {
    let refined = refine(Queue { single: true, ..Queue::new(capacity, Looks::Take) });
    println!("capacity {capacity}: {refined:?}");
}

#[test]
fn the_queue_does_what_the_model_does() {
    replay(1);
    replay(2);
}

#[test]
#[ignore = "36 million steps: .ci/queue-proof runs it optimised"]
fn a_queue_of_three_does_what_the_model_does() {
    replay(3);
}

#[test]
fn fingerprints_lose_no_state() {
    let queue = Queue::new(2, Looks::Find);
    let (graph, whole) = (explore(&queue, &Options::default()), explore_whole(&queue, &Options::default()));
    assert_eq!((graph.states, graph.steps), (whole.states, whole.steps));
}
