//! The soak: both ends of every session over the faults that its transport can commit, from a seed. Each end meets the
//! project's own, *any* end that follows the source's rules, and a *hostile* one that sends anything.
//!
//! A seed makes one short bad session of each [`Row`]: the seed determines the messages, the acts of the users, and the
//! faults of the line. Every job ends in one column of the session's [`Tally`]. The outcome reported to its sender is
//! compared with its execution; a wrong outcome is excused only if corruption is shown to have made a valid message out of
//! the bytes sent.

mod cell;
mod handles;
mod kawasaki_msg;
mod line;
mod log;
mod tally;
mod walks;
mod wire;

use std::panic::{AssertUnwindSafe, catch_unwind};

pub use handles::{ROWS as HANDLES, SABOTAGED};
pub use log::{Log, Mark};
pub use tally::{Ledger, ReportedOutcome, Span, Tally};
pub use wire::{Check, Unseen, Wire};

/// One link over one transport: a row of the table.
#[derive(Debug, Clone, Copy)]
pub struct Row {
    /// The crate.
    pub link: &'static str,
    /// The transport between its two ends.
    pub transport: &'static str,
    /// The kind of job.
    pub job: &'static str,
    /// Of this many random messages the protocol's own check passes one; `None` where no byte is ever corrupt.
    pub one_in: Option<u32>,
    session: fn(u64, Log) -> Tally,
}

/// The sessions of the workspace: both of the project's ends of the links that have a model of the pair, then each end
/// against one of another maker. Both ends of every link are also in [`HANDLES`].
pub const ROWS: [Row; 42] = [
    kawasaki_msg::TCP,
    kawasaki_msg::UDP,
    kawasaki_msg::AS,
    walks::ANY_PC,
    walks::ANY_INSISTENT_PC,
    walks::ANY_LATE_PC,
    walks::HOSTILE_PC,
    walks::HOSTILE_PC_OVER_UDP,
    walks::HOSTILE_ROBOT,
    walks::ANY_CONTROLLER,
    walks::HOSTILE_CONTROLLER,
    walks::ANY_HOST_OF_ALTER,
    walks::HOSTILE_HOST_OF_ALTER,
    walks::ANY_CLIENT,
    walks::HOSTILE_CLIENT,
    walks::ANY_CLIENT_RTU,
    walks::HOSTILE_CLIENT_RTU,
    walks::ANY_CLIENT_THROUGH,
    walks::HOSTILE_CLIENT_THROUGH,
    walks::ANY_SERVER,
    walks::HOSTILE_SERVER,
    walks::ANY_SERVER_RTU,
    walks::HOSTILE_SERVER_RTU,
    walks::ANY_SERVER_THROUGH,
    walks::HOSTILE_SERVER_THROUGH,
    walks::ANY_CONTROLLER_OF_LASER,
    walks::HOSTILE_CONTROLLER_OF_LASER,
    walks::ANY_HOST_OF_LASER,
    walks::HOSTILE_HOST_OF_LASER,
    walks::ANY_WORKSTATION,
    walks::HOSTILE_WORKSTATION,
    walks::ANY_HOST_OF_VIEWER,
    walks::HOSTILE_HOST_OF_VIEWER,
    walks::ANY_BALL,
    walks::HOSTILE_BALL,
    walks::ANY_HOST_OF_BALL,
    walks::HOSTILE_HOST_OF_BALL,
    walks::ANY_CENTRAL,
    walks::HOSTILE_CENTRAL,
    walks::ANY_DEVICE,
    walks::HOSTILE_DEVICE,
    cell::TASK,
];

impl Row {
    /// Returns `link/transport`
    pub fn name(&self) -> String {
        format!("{}/{}", self.link, self.transport)
    }

    /// Returns whether `name` names the row, or its link.
    pub fn is_named(&self, name: &str) -> bool {
        name == self.link || name == self.name()
    }

    /// Runs the session of a seed. A panic is counted.
    pub fn run(&self, seed: u64, log: Log) -> Tally {
        let session = catch_unwind(AssertUnwindSafe(|| (self.session)(seed, log)));
        let tally = session.unwrap_or(Tally { panics: 1, ..Tally::default() });
        Tally { sessions: 1, ..tally }
    }

    /// Returns the expected number of messages with corrupt bytes that would pass the check if their bytes were random. Most
    /// corruption is smaller, and no sum misses a single bit.
    pub fn expected_unseen(&self, tally: &Tally) -> f64 {
        let made = tally.refused + tally.unseen;
        self.one_in.map_or(0.0, |one_in| made as f64 / f64::from(one_in))
    }

    /// Returns whether so much corruption was undetected that the check cannot have been made: more than twice the number
    /// for random bytes plus six standard deviations.
    pub fn sees_too_little(&self, tally: &Tally) -> bool {
        let expected = self.expected_unseen(tally);
        tally.unseen as f64 > 2.0 * expected + 6.0 * expected.sqrt() + 6.0
    }
}
