//! The jobs that a client has sent, beside those that its device has executed.

/// The outcome of a job as it is reported to its sender.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ReportedOutcome {
    /// The job is executed, or queued for execution.
    Done,
    /// The job is not executed, and will not be.
    NotDone,
    /// The job is executed once, or not at all.
    Unknown,
    /// The job is executed at least this often: its sender has requested repetitions.
    AnyTimes(u32),
}

/// The jobs of a sender, each with its reported outcome and the number of its executions. `T` is a note of the sender on a job.
#[derive(Debug, Clone)]
pub struct Ledger<T = ()> {
    jobs: Vec<Job<T>>,
}

/// A job of a [`Ledger`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Job<T = ()> {
    /// The note of the sender.
    pub note: T,
    /// The reported outcome; `None` before a report.
    pub reported: Option<ReportedOutcome>,
    /// Whether an outcome was reported more than once.
    pub is_reported_again: bool,
    /// The number of times that the job was executed.
    pub times: u32,
}

/// The truth about a reported outcome.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum JobFate {
    /// The job was reported as done, and executed once.
    Once,
    /// The job was reported as not done, and not executed.
    NotDone,
    /// The job was reported as unknown, and executed no more often than that permits.
    Unknown,
    /// The outcome was not reported, or the job was reported as done and not executed.
    Lost(&'static str),
    /// The job was executed too often, or reported twice.
    Repeated(&'static str),
}

impl<T> Default for Ledger<T> {
    fn default() -> Self {
        Self { jobs: Vec::new() }
    }
}

impl<T> Ledger<T> {
    /// Adds a job; returns its number, from 0.
    pub fn send(&mut self, note: T) -> usize {
        self.jobs.push(Job { note, reported: None, is_reported_again: false, times: 0 });
        self.jobs.len() - 1
    }

    /// Adds an execution; returns false if no such job was sent.
    pub fn execute(&mut self, job: usize) -> bool {
        self.jobs.get_mut(job).map(|job| job.times += 1).is_some()
    }

    /// Sets the outcome of a job; returns the job, or `None` if no such job was sent.
    pub fn report(&mut self, job: usize, reported: ReportedOutcome) -> Option<&mut Job<T>> {
        let job = self.jobs.get_mut(job)?;
        job.is_reported_again |= job.reported.is_some();
        job.reported = Some(reported);
        Some(job)
    }

    /// Returns the jobs in the sequence in which they were sent.
    pub fn jobs(&self) -> &[Job<T>] {
        &self.jobs
    }

    /// Returns the jobs as mutable references.
    pub fn jobs_mut(&mut self) -> &mut [Job<T>] {
        &mut self.jobs
    }

    /// Counts the jobs.
    pub fn count(&self) -> Counts {
        self.jobs.iter().fold(Counts::default(), |counts, job| counts + job.count())
    }
}

impl<T> Job<T> {
    /// Returns the truth about the reported outcome.
    pub fn fate(&self) -> JobFate {
        match (self.reported, self.times) {
            _ if self.is_reported_again => JobFate::Repeated("its outcome was reported twice"),
            (None, _) => JobFate::Lost("its outcome was never reported"),
            (Some(ReportedOutcome::Done | ReportedOutcome::AnyTimes(1..)), 0) => {
                JobFate::Lost("it was reported as done and not executed")
            }
            (Some(ReportedOutcome::NotDone), 1..) => {
                JobFate::Repeated("it was reported as not done and executed")
            }
            (Some(ReportedOutcome::AnyTimes(_)), _) | (Some(ReportedOutcome::Unknown), 0 | 1) => {
                JobFate::Unknown
            }
            (Some(_), 2..) => JobFate::Repeated("it was executed more than once"),
            (Some(ReportedOutcome::Done), 1) => JobFate::Once,
            (Some(ReportedOutcome::NotDone), 0) => JobFate::NotDone,
        }
    }

    fn count(&self) -> Counts {
        let is_unknown =
            matches!(self.reported, Some(ReportedOutcome::Unknown | ReportedOutcome::AnyTimes(_)));
        let is_denied = self.reported == Some(ReportedOutcome::NotDone);
        let is = |condition: bool| u64::from(condition);
        Counts {
            sent: 1,
            executed_once: is(self.times == 1 && !is_denied),
            repeated: is(self.times > 1),
            lost: is(self.times == 0 && !is_unknown && !is_denied),
            unknown: is(is_unknown),
            unknown_executed: is(is_unknown && self.times > 0),
            withdrawn: is(is_denied && self.times == 0),
            unreported: is(is_denied && self.times == 1),
        }
    }
}

/// The counts of jobs.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub struct Counts {
    /// The number of jobs of the ledger.
    pub sent: u64,
    /// The number of jobs that were executed exactly once, and not reported as not done.
    pub executed_once: u64,
    /// The number of jobs that were executed more than once.
    pub repeated: u64,
    /// The number of jobs that were not executed, and reported as done or not at all.
    pub lost: u64,
    /// The number of jobs that were reported as unknown, executed or not.
    pub unknown: u64,
    /// The number of jobs that were reported as unknown, and executed.
    pub unknown_executed: u64,
    /// The number of jobs that were reported as not done, and not executed.
    pub withdrawn: u64,
    /// The number of jobs that were reported as not done, and executed once.
    pub unreported: u64,
}

impl core::ops::Add for Counts {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            sent: self.sent + other.sent,
            executed_once: self.executed_once + other.executed_once,
            repeated: self.repeated + other.repeated,
            lost: self.lost + other.lost,
            unknown: self.unknown + other.unknown,
            unknown_executed: self.unknown_executed + other.unknown_executed,
            withdrawn: self.withdrawn + other.withdrawn,
            unreported: self.unreported + other.unreported,
        }
    }
}
