//! What became of the jobs of a session, by what was reported to their sender and what was executed.

use core::ops::AddAssign;
use core::time::Duration;

use super::log::{Log, Mark};
use crate::link::FaultCounts;

/// What is reported to the sender of a job.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reported {
    /// Executed, or queued for it.
    Done,
    /// Not executed, and it will not be.
    NotDone,
    /// Unknown, but not more than once.
    Unknown,
    /// Unknown how often, but this often at least: the sender has asked for resends that may do this.
    AnyTimes(u32),
}

/// The sums of a row of the table.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Tally {
    /// Sessions run.
    pub sessions: u64,
    /// What the transport did.
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
    /// Executed without anybody having sent it, and without such corruption.
    pub invented: u64,
    /// Transmissions whose bytes the line has changed, and that arrived.
    pub corrupt: u64,
    /// Whole messages among their bytes that the protocol's own check refuses.
    pub refused: u64,
    /// Messages among their bytes that nobody sent and that the check passes.
    pub unseen: u64,
    /// Sessions that did not do all the work that they were asked for in a minute without faults.
    pub stuck: u64,
    /// Sessions that panicked.
    pub panics: u64,
}

impl Tally {
    /// Whether a promise is broken.
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
pub struct Ledger {
    jobs: Vec<Job>,
}

/// One job: what was reported of it, and how often it was executed.
#[derive(Debug, Clone, Copy)]
pub struct Job {
    reported: Option<Reported>,
    repeated: bool,
    times: u32,
    /// The transmissions from its first to the one that reported its outcome.
    pub from: Mark,
    /// As `from`.
    pub to: Mark,
}

impl Ledger {
    /// A job is sent, after the transmissions of `from`; its number, from 0.
    pub fn send(&mut self, from: Mark) -> usize {
        let to = Mark::END;
        self.jobs.push(Job { reported: None, repeated: false, times: 0, from, to });
        self.jobs.len() - 1
    }

    /// A job is executed. False: there is no such job.
    pub fn execute(&mut self, job: usize) -> bool {
        self.jobs.get_mut(job).map(|job| job.times += 1).is_some()
    }

    /// Its outcome is reported. False: there is no such job.
    pub fn report(&mut self, job: usize, reported: Reported, to: Mark) -> bool {
        let Some(job) = self.jobs.get_mut(job) else { return false };
        job.repeated |= job.reported.is_some();
        (job.reported, job.to) = (Some(reported), to);
        true
    }

    /// What was reported as done was executed.
    pub fn execute_what_is_done(&mut self) {
        for job in &mut self.jobs {
            job.times = u32::from(job.reported == Some(Reported::Done));
        }
    }

    /// Whether its outcome has been reported.
    pub fn is_reported(&self, job: usize) -> bool {
        self.jobs.get(job).is_some_and(|job| job.reported.is_some())
    }

    /// Whether it has been executed.
    pub fn is_executed(&self, job: usize) -> bool {
        self.jobs.get(job).is_some_and(|job| job.times > 0)
    }

    /// How many jobs were sent.
    pub fn len(&self) -> usize {
        self.jobs.len()
    }

    /// Whether none was sent.
    pub fn is_empty(&self) -> bool {
        self.jobs.is_empty()
    }

    /// Counts the jobs. `forged` says whether corruption that no check can see explains an outcome that must not be.
    pub fn settle(self, now: Duration, log: Log, tally: &mut Tally, forged: impl Fn(&Job) -> bool) {
        for (number, job) in self.jobs.iter().enumerate() {
            tally.jobs += 1;
            let (column, wrong) = match (job.reported, job.times) {
                _ if job.repeated => (&mut tally.repeated, "its outcome was reported twice"),
                (None, _) => (&mut tally.lost, "its outcome was never reported"),
                (Some(Reported::Done), 0) => (&mut tally.lost, "it was reported as done and not executed"),
                (Some(Reported::NotDone), 1..) => {
                    (&mut tally.repeated, "it was reported as not done and executed")
                }
                (Some(Reported::AnyTimes(1..)), 0) => {
                    (&mut tally.lost, "it was reported as done and not executed")
                }
                (Some(Reported::AnyTimes(_)), _) => (&mut tally.unknown, ""),
                (Some(_), 2..) => (&mut tally.repeated, "it was executed more than once"),
                (Some(Reported::Done), 1) => (&mut tally.once, ""),
                (Some(Reported::NotDone), 0) => (&mut tally.not_done, ""),
                (Some(Reported::Unknown), 0 | 1) => (&mut tally.unknown, ""),
            };
            if wrong.is_empty() {
                *column += 1;
            } else if forged(job) {
                tally.forged += 1;
                log.line(now, format_args!("job {number}: {wrong}, by corruption that no check can see"));
            } else {
                *column += 1;
                log.line(now, format_args!("!!! job {number}: {wrong} (executed {} times)", job.times));
            }
        }
    }
}
