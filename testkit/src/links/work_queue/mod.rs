//! The work queue: its writer and its reader, with every interleaving of what they load and store, and the two resets.
//!
//! Positions count from the head, so that jobs without end have finitely many states. What that leaves out is shown elsewhere:
//! weak memory by loom, laps that wrap and a watermark of long ago by the queue's own tests. One thread replays what it can
//! interrupt: the queue between its operations, where a discarded job is dropped, and where a job is offered to a predicate.

mod queue;
mod refine;
mod state;

pub use queue::{Act, Looks, Queue};
pub use refine::{Refined, refine};
pub use state::{Rule, State};

use crate::model::{Depth, MustFail, Pair, STANDSTILL, Setting};
use state::{
    DROPPED, EXECUTED_ONCE, FOUND, GAPLESS, IN_ORDER, KEPT, NOT_BEGUN, NOT_LOST, NOT_PULLED_AWAY, SETTLED,
    UNIQUE,
};

/// The queue's ends.
pub const PAIR: Pair =
    Pair { name: "robot-work-queue writer × reader", settings, must_fail, diagrams: Vec::new };

fn settings(depth: Depth) -> Vec<Setting> {
    let capacities = match depth {
        Depth::Quick => 1..=3,
        Depth::Deep => 1..=6,
    };
    let each = |capacity| {
        [Looks::Take, Looks::Find].map(|looks| {
            let by = if looks == Looks::Take { "in order" } else { "by choice" };
            Setting::new(
                format!("capacity {capacity}, a reader that goes on {by}"),
                Queue::new(capacity, looks),
            )
        })
    };
    capacities.flat_map(each).collect()
}

fn must_fail() -> Vec<MustFail> {
    let numbers = Queue { max: 1, ..Queue::new(2, Looks::Take) };
    let rules = Rule::ALL.map(|rule| {
        let (name, property, looks) = match rule {
            Rule::TakeObeysWatermark => ("take obeys the watermark", NOT_BEGUN, Looks::Take),
            Rule::FindObeysWatermark => ("find obeys the watermark", STANDSTILL, Looks::Find),
            Rule::WaitingBeginsAtWatermark => ("what waits begins at the watermark", NOT_BEGUN, Looks::Take),
            Rule::DiscardEndsAtWatermark => ("discarding ends at the watermark", KEPT, Looks::Take),
            Rule::SettledIsTheHead => ("settled is where the head is", SETTLED, Looks::Take),
            Rule::CompletingFrees => {
                ("a job's slot is freed when it is completed", NOT_PULLED_AWAY, Looks::Take)
            }
            Rule::ClearedIsNotFree => ("a cleared slot is the reader's", NOT_PULLED_AWAY, Looks::Take),
            Rule::ClaimLooksForSpace => ("a claim looks for space", NOT_LOST, Looks::Take),
            Rule::CompletedIsMarked => ("what is completed is marked", EXECUTED_ONCE, Looks::Find),
            Rule::HeadWaitsForOldest => ("the head waits for the oldest job", NOT_LOST, Looks::Find),
            Rule::HeadPassesCompleted => ("the head passes what is completed", STANDSTILL, Looks::Find),
            Rule::TakeIsOldest => ("take begins at the head", IN_ORDER, Looks::Take),
            Rule::NumberIsChecked => ("the number is checked", GAPLESS, Looks::Take),
            Rule::LeavingIsOneStep => ("an end leaves in one step", DROPPED, Looks::Take),
            Rule::GoneBeforeNothing => ("whether the writer is gone is asked first", FOUND, Looks::Take),
        };
        let setting = if looks == Looks::Take { "capacity 2, in order" } else { "capacity 2, by choice" };
        MustFail::new(name, property, setting, Queue { without: Some(rule), ..Queue::new(2, looks) })
    });
    let few = MustFail::new("there are more numbers than slots", UNIQUE, "capacity 2, one number", numbers);
    rules.into_iter().chain([few]).collect()
}
