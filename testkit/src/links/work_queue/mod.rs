//! The work queue: its writer and its reader, with every interleaving of their loads and stores, and the two resets.
//!
//! Positions count from the head, so that jobs without end have finitely many states. Two omissions are tested
//! elsewhere: weak memory by loom, positions that wrap by the queue's own tests. One thread replays each possible
//! interruption: the queue between its operations, where a job is dropped, and where a job is offered to a predicate.

mod queue;
mod read;
mod refine;
mod rule;
mod state;
mod write;

pub use queue::{Act, Queue};
pub use rule::Rule;
pub use state::{Looks, State};

use crate::model::{Depth, MustFail, Pair, PeerAssumptions, Refined, Setting};
use rule::UNIQUE;

/// The queue's ends.
pub const PAIR: Pair = Pair {
    name: "robot-work-queue writer × reader",
    settings,
    must_fail,
    diagrams: Vec::new,
    // A queue of three takes 36 million steps.
    refined: || [1, 2].map(refined).to_vec(),
};

/// Replays a queue of this capacity on the queue itself.
pub fn refined(capacity: u8) -> Refined {
    refine::refine(Queue { single: true, ..Queue::new(capacity, Looks::Take) })
}

fn settings(depth: Depth) -> Vec<Setting> {
    let readers = [(Looks::Take, "in order"), (Looks::Batch, "in batches"), (Looks::Find, "by choice")];
    let terms = PeerAssumptions {
        keeps: "the types of the interface",
        free: "every interleaving of loads and stores; when each end acts, resets, is dropped",
        shows: &[],
        properties: &[
            rule::EXECUTED_ONCE,
            rule::NOT_LOST,
            rule::NOT_PULLED_AWAY,
            rule::PUBLISHED,
            rule::NUMBERED,
            rule::RESET_KEEPS,
            rule::NOT_BEGUN,
            rule::SETTLED,
            rule::IN_ORDER,
            UNIQUE,
            rule::GAPLESS,
            rule::DROPPED,
            rule::FOUND,
        ],
    };
    let setting = |capacity, (looks, by)| {
        let name = format!("capacity {capacity}, a reader that goes on {by}");
        Setting::new(name, Queue::new(capacity, looks)).on(terms)
    };
    let small = (1..=2).flat_map(|capacity| readers.map(|reader| setting(capacity, reader)));
    // The ways to continue differ in the search for a standstill alone.
    let large = readers.iter().take(if depth == Depth::Deep { 3 } else { 1 });
    small.chain(large.map(|reader| setting(3, *reader))).collect()
}

fn must_fail() -> Vec<MustFail> {
    let queue = Queue::new(3, Looks::Take);
    let rules = Rule::ALL.iter().map(|(rule, words, property)| {
        MustFail::new(words, property, "capacity 3", Queue { without: Some(*rule), ..queue })
    });
    let few = MustFail::new(
        "there are more numbers than slots",
        UNIQUE,
        "capacity 2, one number",
        Queue { max: 1, ..Queue::new(2, Looks::Take) },
    );
    rules.chain([few]).collect()
}
