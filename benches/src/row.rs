//! One row of work, which `budgets` counts and `codecs` times.

use std::any::Any;
use std::time::{Duration, Instant};

/// One row of instruction counts. A row with a [`Timing`] is timed too.
pub struct Count {
    /// The work, as the table prints it.
    pub what: &'static str,
    /// The goal, in instructions for each unit; `None` for a peer or a row without a goal.
    pub goal: Option<f64>,
    /// `"op"`, `"job"` or `"byte"`.
    pub each: &'static str,
    /// The units that one round handles: 1 for "each operation", the bytes of the input for "each byte".
    pub units: f64,
    /// The rounds that are counted: once these, and once twice as many.
    pub rounds: u64,
    /// The work.
    pub run: Run,
    /// The group and the name under which the row is timed; `None` if it is only counted.
    pub timing: Option<Timing>,
}

/// The work of a row. All input and output passes `black_box`.
#[derive(Clone, Copy)]
pub enum Run {
    /// Prepares, which takes little time, then does the work `rounds` times.
    Whole(fn(rounds: u64)),
    /// Prepares for `most` rounds, then does at most this many. Returns the time of the work alone, and the prepared values:
    /// dropping them is not part of the work.
    Prepared {
        /// The maximum number of rounds of one call.
        most: u64,
        /// The work.
        run: fn(rounds: u64) -> (Duration, Box<dyn Any>),
    },
}

/// The id of a row in a report of times: `link/work/by`.
#[derive(Clone, Copy)]
pub struct Timing {
    /// The work: rows of the same work are compared.
    pub work: &'static str,
    /// The code that does the work: [`OURS`](Timing::OURS), a loop by hand, another crate.
    pub by: &'static str,
    /// The bytes that one round reads or writes; `None` if the throughput is in the units of the row.
    pub bytes: Option<usize>,
}

impl Timing {
    /// The code of this workspace.
    pub const OURS: &'static str = "cellwire";
    /// A loop by hand with the checks that the work needs, and nothing else.
    pub const BY_HAND: &'static str = "by hand";
}

impl Count {
    /// Instructions for each round.
    pub const fn op(what: &'static str, run: fn(u64)) -> Self {
        Self::new(what, "op", 1.0, Run::Whole(run))
    }

    /// Instructions for each of the jobs of a round.
    pub const fn job(what: &'static str, jobs: usize, run: fn(u64)) -> Self {
        Self::new(what, "job", jobs as f64, Run::Whole(run))
    }

    /// Instructions for each of the bytes of a round.
    pub const fn byte(what: &'static str, bytes: usize, run: fn(u64)) -> Self {
        Self::new(what, "byte", bytes as f64, Run::Whole(run))
    }

    /// Instructions for each of the bytes of a round; `run` needs much preparation, for twice the rounds that are counted.
    pub const fn byte_prepared(
        what: &'static str,
        bytes: usize,
        rounds: u64,
        run: fn(u64) -> (Duration, Box<dyn Any>),
    ) -> Self {
        Self::new(what, "byte", bytes as f64, Run::Prepared { most: 2 * rounds, run }).rounds(rounds)
    }

    const fn new(what: &'static str, each: &'static str, units: f64, run: Run) -> Self {
        Self { what, goal: None, each, units, rounds: 500, run, timing: None }
    }

    /// Returns the row with a goal, in instructions for each unit.
    pub const fn goal(self, goal: f64) -> Self {
        Self { goal: Some(goal), ..self }
    }

    /// Returns the row with another number of counted rounds.
    pub const fn rounds(self, rounds: u64) -> Self {
        Self { rounds, ..self }
    }

    /// Returns the row timed as this work by this code, with its throughput in the row's units.
    pub const fn timed(self, work: &'static str, by: &'static str) -> Self {
        Self { timing: Some(Timing { work, by, bytes: None }), ..self }
    }

    /// Returns the row timed as this work by this code, with its throughput in bytes.
    pub const fn timed_bytes(self, work: &'static str, by: &'static str, bytes: usize) -> Self {
        Self { timing: Some(Timing { work, by, bytes: Some(bytes) }), ..self }
    }
}

impl Run {
    /// Does the work that is counted: the process ends after it.
    pub fn once(self, rounds: u64) {
        match self {
            Self::Whole(run) => run(rounds),
            Self::Prepared { run, .. } => core::mem::forget(run(rounds)),
        }
    }

    /// Returns the time of this many rounds.
    pub fn time(self, rounds: u64) -> Duration {
        match self {
            Self::Whole(run) => {
                let start = Instant::now();
                run(rounds);
                start.elapsed()
            }
            Self::Prepared { most, run } => {
                let calls = (0..rounds).step_by(most as usize);
                calls.map(|before| run(most.min(rounds - before)).0).sum()
            }
        }
    }
}
