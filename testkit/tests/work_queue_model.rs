//! The model of the work queue is the queue: every state and every transition, replayed.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]
#![cfg(feature = "links")]

use testkit::links::work_queue::{Looks, Queue, refine};
use testkit::model::{Options, explore, explore_whole};

#[test]
fn the_queue_does_what_the_model_does() {
    for capacity in 1..=3 {
        for looks in [Looks::Take, Looks::Find] {
            let refined = refine(Queue { single: true, ..Queue::new(capacity, looks) });
            println!("capacity {capacity}, {looks:?}: {refined:?}");
        }
    }
}

#[test]
fn fingerprints_lose_no_state() {
    let queue = Queue::new(2, Looks::Find);
    let (graph, whole) = (explore(&queue, &Options::default()), explore_whole(&queue, &Options::default()));
    assert_eq!((graph.states, graph.steps), (whole.states, whole.steps));
}
