//! What became of the jobs of a session, by what their sender was told and what was executed.

use core::ops::AddAssign;
use core::time::Duration;

use super::wire::{Log, Mark};
use crate::link::FaultCounts;

/// What the sender of a job is told of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Told {
    /// Executed, or queued for it.
    Done,
    /// Not executed, and it will not be.
    NotDone,
    /// Nobody can tell; not more than once.
    Unknown,
    /// Nobody can tell how often, but so often at least: the sender has asked for resends that may do this.
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
    /// Told as done, executed once.
    pub once: u64,
    /// Told as not done, not executed.
    pub not_done: u64,
    /// Told as unknown, executed once or not at all; or more often, where the sender has asked for that.
    pub unknown: u64,
    /// Never told, or told as done and not executed.
    pub lost: u64,
    /// Executed more than once, or told as not done and executed, or told twice.
    pub repeated: u64,
    /// One of the last two, because a message was damaged in a way that the protocol's own check cannot see.
    pub spoilt: u64,
    /// Executed without anybody having sent it, and without such damage.
    pub invented: u64,
    /// Transmissions whose bytes the line has changed, and that arrived.
    pub damaged: u64,
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
        self.spoilt += other.spoilt;
        self.invented += other.invented;
        self.damaged += other.damaged;
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

/// One job: what was told of it, and how often it was executed.
#[derive(Debug, Clone, Copy)]
pub struct Job {
    told: Option<Told>,
    told_again: bool,
    times: u32,
    /// The transmissions from its first to the one that told its outcome.
    pub from: Mark,
    /// As `from`.
    pub to: Mark,
}

impl Ledger {
    /// A job is sent, behind the transmissions of `from`; its number, from 0.
    pub fn send(&mut self, from: Mark) -> usize {
        let to = Mark::END;
        self.jobs.push(Job { told: None, told_again: false, times: 0, from, to });
        self.jobs.len() - 1
    }

    /// A job is executed. False: there is no such job.
    pub fn execute(&mut self, job: usize) -> bool {
        self.jobs.get_mut(job).map(|job| job.times += 1).is_some()
    }

    /// Its sender is told. False: there is no such job.
    pub fn tell(&mut self, job: usize, told: Told, to: Mark) -> bool {
        let Some(job) = self.jobs.get_mut(job) else { return false };
        job.told_again |= job.told.is_some();
        (job.told, job.to) = (Some(told), to);
        true
    }

    /// Whether the sender has been told.
    pub fn is_told(&self, job: usize) -> bool {
        self.jobs.get(job).is_some_and(|job| job.told.is_some())
    }

    /// How many jobs were sent.
    pub fn len(&self) -> usize {
        self.jobs.len()
    }

    /// Whether none was sent.
    pub fn is_empty(&self) -> bool {
        self.jobs.is_empty()
    }

    /// Counts the jobs. `spoilt` says whether damage that no check can see explains an outcome that must not be.
    pub fn settle(self, now: Duration, log: Log, tally: &mut Tally, spoilt: impl Fn(&Job) -> bool) {
        for (number, job) in self.jobs.iter().enumerate() {
            tally.jobs += 1;
            let (column, wrong) = match (job.told, job.times) {
                _ if job.told_again => (&mut tally.repeated, "its outcome was told twice"),
                (None, _) => (&mut tally.lost, "its outcome was never told"),
                (Some(Told::Done), 0) => (&mut tally.lost, "it was told as done and not executed"),
                (Some(Told::NotDone), 1..) => (&mut tally.repeated, "it was told as not done and executed"),
                (Some(Told::AnyTimes(1..)), 0) => (&mut tally.lost, "it was told as done and not executed"),
                (Some(Told::AnyTimes(_)), _) => (&mut tally.unknown, ""),
                (Some(_), 2..) => (&mut tally.repeated, "it was executed more than once"),
                (Some(Told::Done), 1) => (&mut tally.once, ""),
                (Some(Told::NotDone), 0) => (&mut tally.not_done, ""),
                (Some(Told::Unknown), 0 | 1) => (&mut tally.unknown, ""),
            };
            if wrong.is_empty() {
                *column += 1;
            } else if spoilt(job) {
                tally.spoilt += 1;
                log.say(now, format_args!("job {number}: {wrong}, by damage that no check can see"));
            } else {
                *column += 1;
                log.say(now, format_args!("!!! job {number}: {wrong} (executed {} times)", job.times));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settled(told: &[Told], times: usize, spoilt: bool) -> Tally {
        let (mut ledger, mut tally) = (Ledger::default(), Tally::default());
        let job = ledger.send(Mark::default());
        for told in told {
            assert!(ledger.tell(job, *told, Mark::default()));
        }
        for _ in 0..times {
            assert!(ledger.execute(job));
        }
        assert!(!ledger.execute(1) && !ledger.tell(1, Told::Done, Mark::default()));
        ledger.settle(Duration::ZERO, Log::OFF, &mut tally, |_| spoilt);
        tally
    }

    #[test]
    fn each_job_is_in_one_column() {
        let one = Tally { jobs: 1, ..Tally::default() };
        let once = Tally { once: 1, ..one };
        let unknown = Tally { unknown: 1, ..one };
        let not_done = Tally { not_done: 1, ..one };
        let lost = Tally { lost: 1, ..one };
        let repeated = Tally { repeated: 1, ..one };
        let spoilt = Tally { spoilt: 1, ..one };
        assert_eq!(settled(&[Told::Done], 1, false), once);
        assert_eq!(settled(&[Told::Done], 1, true), once);
        assert_eq!(settled(&[Told::NotDone], 0, false), not_done);
        assert_eq!([0, 1].map(|times| settled(&[Told::Unknown], times, false)), [unknown; 2]);
        assert_eq!([0, 1, 3].map(|times| settled(&[Told::AnyTimes(0)], times, false)), [unknown; 3]);
        assert_eq!(
            [0, 1, 3].map(|times| settled(&[Told::AnyTimes(1)], times, false)),
            [lost, unknown, unknown]
        );
        assert_eq!(settled(&[Told::Done], 0, false), lost);
        assert_eq!(settled(&[], 1, false), lost);
        assert_eq!(settled(&[], 0, false), lost);
        assert_eq!(settled(&[Told::NotDone], 1, false), repeated);
        assert_eq!([Told::Done, Told::Unknown].map(|told| settled(&[told], 2, false)), [repeated; 2]);
        assert_eq!(settled(&[Told::Done, Told::Done], 1, false), repeated);
        assert_eq!(settled(&[Told::Done], 0, true), spoilt);
        assert_eq!(settled(&[Told::NotDone], 1, true), spoilt);
        assert_eq!(
            [once, unknown, not_done, lost, repeated, spoilt].map(|t| t.is_bad()),
            [false, false, false, true, true, false]
        );
    }
}
