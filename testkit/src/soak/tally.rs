//! The results of a session's jobs, by the outcome reported to their sender and by their execution.

use core::ops::AddAssign;
use core::time::Duration;

use cellwire_sim::ledger::JobFate;
pub use cellwire_sim::ledger::ReportedOutcome;

use super::log::{Log, Mark};
use crate::link::FaultCounts;

/// The sums of a row of the table.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Tally {
    /// Sessions run.
    pub sessions: u64,
    /// The faults of the transport.
    pub faults: FaultCounts,
    /// Jobs of all sessions: each is in exactly one of the next six.
    pub jobs: u64,
    /// Reported as done, executed once.
    pub once: u64,
    /// Reported as not done, not executed.
    pub not_done: u64,
    /// Reported as unknown, executed once or not at all; or more often, where the sender has asked for that.
    pub unknown: u64,
    /// Never reported, or reported as done and not executed.
    pub lost: u64,
    /// Executed more than once, or reported as not done and executed, or reported twice.
    pub repeated: u64,
    /// One of the last two, because a message was corrupt in a way that the protocol's own check cannot see.
    pub forged: u64,
    /// Executed although it was never sent, and without such corruption.
    pub invented: u64,
    /// Transmissions that arrived with bytes changed by the line.
    pub corrupt: u64,
    /// Whole messages among their bytes that the protocol's own check refuses.
    pub refused: u64,
    /// Messages among their bytes that were not sent and that the check passes.
    pub unseen: u64,
    /// Sessions that did not do all the work that they were asked for without faults at the end.
    pub stuck: u64,
    /// Sessions that panicked.
    pub panics: u64,
}

impl Tally {
    /// Returns whether a check has failed.
    pub fn is_bad(&self) -> bool {
        self.lost + self.repeated + self.invented + self.stuck + self.panics > 0
    }
}

impl AddAssign for Tally {
    fn add_assign(&mut self, other: Self) {
        self.sessions += other.sessions;
        self.faults += other.faults;
        self.jobs += other.jobs;
        self.once += other.once;
        self.not_done += other.not_done;
        self.unknown += other.unknown;
        self.lost += other.lost;
        self.repeated += other.repeated;
        self.forged += other.forged;
        self.invented += other.invented;
        self.corrupt += other.corrupt;
        self.refused += other.refused;
        self.unseen += other.unseen;
        self.stuck += other.stuck;
        self.panics += other.panics;
    }
}

/// The jobs of one session.
#[derive(Debug, Default)]
pub struct Ledger(cellwire_sim::Ledger<Span>);

/// The transmissions of a job, from its first to the one that reported its outcome.
#[derive(Debug, Clone, Copy)]
pub struct Span {
    /// The first.
    pub from: Mark,
    /// The last.
    pub to: Mark,
}

impl Ledger {
    /// Adds a job that is sent after the transmissions of `from`; returns its number, from 0.
    pub fn send(&mut self, from: Mark) -> usize {
        self.0.send(Span { from, to: Mark::END })
    }

    /// Adds an execution; returns false if no such job was sent.
    pub fn execute(&mut self, job: usize) -> bool {
        self.0.execute(job)
    }

    /// Sets the outcome of a job; returns false if no such job was sent.
    pub fn report(&mut self, job: usize, reported: ReportedOutcome, to: Mark) -> bool {
        self.0.report(job, reported).map(|job| job.note.to = to).is_some()
    }

    /// Executes the jobs that were reported as done, and no others.
    pub fn execute_what_is_done(&mut self) {
        for job in self.0.jobs_mut() {
            job.times = u32::from(job.reported == Some(ReportedOutcome::Done));
        }
    }

    /// Returns whether the outcome of a job has been reported.
    pub fn is_reported(&self, job: usize) -> bool {
        self.0.jobs().get(job).is_some_and(|job| job.reported.is_some())
    }

    /// Returns whether a job has been executed.
    pub fn is_executed(&self, job: usize) -> bool {
        self.0.jobs().get(job).is_some_and(|job| job.times > 0)
    }

    /// Returns the number of jobs.
    pub fn len(&self) -> usize {
        self.0.jobs().len()
    }

    /// Returns whether no jobs were sent.
    pub fn is_empty(&self) -> bool {
        self.0.jobs().is_empty()
    }

    /// Counts the jobs. `forged` returns whether corruption that no check can see explains the wrong outcome of a job with this
    /// number.
    pub fn settle(self, now: Duration, log: Log, tally: &mut Tally, forged: impl Fn(usize, &Span) -> bool) {
        for (number, job) in self.0.jobs().iter().enumerate() {
            tally.jobs += 1;
            let (column, wrong) = match job.fate() {
                JobFate::Once => (&mut tally.once, ""),
                JobFate::NotDone => (&mut tally.not_done, ""),
                JobFate::Unknown => (&mut tally.unknown, ""),
                JobFate::Lost(wrong) => (&mut tally.lost, wrong),
                JobFate::Repeated(wrong) => (&mut tally.repeated, wrong),
            };
            if wrong.is_empty() {
                *column += 1;
            } else if forged(number, &job.note) {
                tally.forged += 1;
                log.line(now, format_args!("job {number}: {wrong}, by corruption that no check can see"));
            } else {
                *column += 1;
                log.line(now, format_args!("!!! job {number}: {wrong} (executed {} times)", job.times));
            }
        }
    }
}
