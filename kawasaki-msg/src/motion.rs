//! The queue between a robot's session and its motion task, and the reports of executed jobs in the other direction.

use core::ops::Deref;

use robot_work_queue::{
    Claim, ConfigError, Ends as Both, Full, Iter, NoWake, Reader, TakenJob, Wake, WorkQueue, Writer,
};

use crate::job::{Job, Work};

/// A queue of at most `N` jobs, inline: for a `static`, or for the stack of the owner of both tasks. With the feature
/// `alloc`, [`boxed`] returns ends that own it.
///
/// ```
/// use kawasaki_msg::motion::JobQueue;
/// use kawasaki_msg::{Line, Robot, RobotConfig};
/// use kawasaki_msg::robot_work_queue::NoWake;
///
/// static QUEUE: JobQueue<Line, 64> = JobQueue::numbered::<9999>();
///
/// let (jobs, mut motion) = QUEUE.split_static(NoWake, NoWake).expect("it has no ends yet");
/// let robot = Robot::new(RobotConfig::tcp(), jobs)?;
/// // In the motion task:
/// while let Some(job) = motion.take() {
///     // move along job.work …
///     job.complete();
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct JobQueue<W, const N: usize> {
    jobs: WorkQueue<Job<W>, N>,
    executed: WorkQueue<u16, N>,
}

impl<W, const N: usize> JobQueue<W, N> {
    /// Creates an empty queue whose jobs are numbered `1..=max_number`, then 1 again, as both ends of the link have agreed.
    ///
    /// # Errors
    /// As [`WorkQueue::new`].
    pub fn new(max_number: u16) -> Result<Self, ConfigError> {
        Ok(Self { jobs: WorkQueue::new(max_number)?, executed: WorkQueue::new(max_number)? })
    }

    /// Creates a queue as [`new`](Self::new) does, for a `static`: invalid parameters do not compile.
    #[must_use]
    pub const fn numbered<const MAX_NUMBER: u16>() -> Self {
        Self { jobs: WorkQueue::numbered::<MAX_NUMBER>(), executed: WorkQueue::numbered::<MAX_NUMBER>() }
    }

    /// Splits the queue into its two ends. Each split empties the queue.
    pub fn split(&mut self) -> Ends<'_, W> {
        self.split_with(NoWake, NoWake)
    }

    /// Splits the queue as [`split`](Self::split) does, for ends that sleep: `motion` wakes the motion task, `session` the
    /// driver of the session.
    pub fn split_with<M: Wake, S: Wake>(&mut self, motion: M, session: S) -> Ends<'_, W, M, S> {
        ends(self.jobs.split_with(motion, session), self.executed.split())
    }

    /// Returns the two ends of a queue in a `static`; `None` while it has ends.
    #[cfg(target_has_atomic = "8")]
    pub fn split_static<M: Wake, S: Wake>(
        &'static self,
        motion: M,
        session: S,
    ) -> Option<Ends<'static, W, M, S>> {
        let jobs = self.jobs.split_static(motion, session)?;
        Some(ends(jobs, self.executed.split_static(NoWake, NoWake)?))
    }
}

/// Returns the two ends of a queue of at most `capacity` jobs on the heap, numbered `1..=max_number`, then 1 again. The ends
/// own the queue together and can be moved to different threads. Nothing is allocated later.
///
/// # Errors
/// As [`robot_work_queue::boxed`].
#[cfg(feature = "alloc")]
pub fn boxed<W>(capacity: usize, max_number: u16) -> Result<Ends<'static, W>, ConfigError> {
    boxed_with(capacity, max_number, NoWake, NoWake)
}

/// Creates a queue as [`boxed`] does, for ends that sleep: `motion` wakes the motion task, `session` the driver of the
/// session.
///
/// # Errors
/// As [`boxed`].
#[cfg(feature = "alloc")]
pub fn boxed_with<W, M: Wake, S: Wake>(
    capacity: usize,
    max_number: u16,
    motion: M,
    session: S,
) -> Result<Ends<'static, W, M, S>, ConfigError> {
    let jobs = robot_work_queue::boxed_with(capacity, max_number, motion, session)?;
    Ok(ends(jobs, robot_work_queue::boxed(capacity, max_number)?))
}

fn ends<'q, W, M: Wake, S: Wake>(
    (writer, jobs): Both<'q, Job<W>, M, S>,
    (report, executed): Both<'q, u16>,
) -> Ends<'q, W, M, S> {
    (Jobs { writer, executed: Some(executed) }, Motion { jobs, report })
}

/// The two ends of a queue.
pub type Ends<'q, W, M = NoWake, S = NoWake> = (Jobs<'q, W, M>, Motion<'q, W, S>);

/// The end of the [`Robot`](crate::Robot): it queues the jobs that the PC sends, and receives the reports of executed jobs.
///
/// A [`Writer`] alone is such an end too, for a motion task that reports executed jobs in another way, for example from
/// another processor: each report is passed to [`Robot::job_done`](crate::Robot::job_done).
#[derive(Debug)]
pub struct Jobs<'q, W, M: Wake = NoWake> {
    pub(crate) writer: Writer<'q, Job<W>, M>,
    pub(crate) executed: Option<Reader<'q, u16>>,
}

impl<'q, W, M: Wake> From<Writer<'q, Job<W>, M>> for Jobs<'q, W, M> {
    fn from(writer: Writer<'q, Job<W>, M>) -> Self {
        Self { writer, executed: None }
    }
}

impl<W, M: Wake> Jobs<'_, W, M> {
    /// Removes and returns the number of the next executed job that the session has not recorded yet.
    pub(crate) fn next_executed(&mut self) -> Option<u16> {
        self.executed.as_mut()?.take().map(TakenJob::complete)
    }
}

/// The end of the motion task: takes jobs, executes them, completes them. No call here waits for the session.
///
/// Call [`take`](Self::take) whenever the motion task is woken: that also sweeps a cleared queue.
#[derive(Debug)]
pub struct Motion<'q, W, S: Wake = NoWake> {
    jobs: Reader<'q, Job<W>, S>,
    /// The reports. The session empties this queue before it queues another job: there is a free entry for each queued job.
    report: Writer<'q, u16>,
}

impl<W, S: Wake> Motion<'_, W, S> {
    /// Takes the oldest job, by reference; `None` if there is none yet.
    #[inline]
    pub fn take(&mut self) -> Option<ExecutingJob<'_, W, S>> {
        executing(self.report.claim(), self.jobs.take())
    }

    /// Takes the oldest job for which `predicate` returns true: it overtakes those before it. For a robot whose configuration has
    /// [`Acks::Individual`](crate::Acks).
    pub fn take_where(
        &mut self,
        mut predicate: impl FnMut(&Job<W>) -> bool,
    ) -> Option<ExecutingJob<'_, W, S>> {
        executing(self.report.claim(), self.jobs.take_where(|_, job| predicate(job)))
    }

    /// Returns the waiting jobs, oldest first.
    pub fn iter(&self) -> impl Iterator<Item = &Job<W>> {
        Iter::map(self.jobs.iter(), |(_, job)| job)
    }

    /// Returns the number of waiting jobs.
    pub fn len(&self) -> usize {
        self.jobs.len()
    }

    /// Returns whether no job waits.
    pub fn is_empty(&self) -> bool {
        self.jobs.is_empty()
    }

    /// Returns the capacity of the queue in jobs.
    pub fn capacity(&self) -> usize {
        self.jobs.capacity()
    }

    /// Returns whether the session is gone. If [`take`](Self::take) returns `None` *after* this was true, it always will.
    pub fn is_abandoned(&self) -> bool {
        self.jobs.is_abandoned()
    }
}

fn executing<'m, W, S: Wake>(
    report: Result<Claim<'m, u16>, Full>,
    job: Option<TakenJob<'m, Job<W>, S>>,
) -> Option<ExecutingJob<'m, W, S>> {
    let (Ok(report), Some(job)) = (report, job) else { return None };
    Some(ExecutingJob { job, report })
}

/// A job that is being executed, in its slot: a reset does not remove it. Dropped without [`complete`](Self::complete), it
/// waits again.
#[derive(Debug)]
#[must_use = "a job that is not completed waits again"]
pub struct ExecutingJob<'m, W, S: Wake = NoWake> {
    job: TakenJob<'m, Job<W>, S>,
    report: Claim<'m, u16>,
}

impl<W: Work, S: Wake> ExecutingJob<'_, W, S> {
    /// Reports the job as executed to the session, which never requests it again, and frees its slot.
    pub fn complete(self) -> Job<W> {
        // In this sequence: a session that finds the slot free has the report of the job.
        self.report.push(self.job.number);
        self.job.complete()
    }
}

impl<W, S: Wake> Deref for ExecutingJob<'_, W, S> {
    type Target = Job<W>;

    fn deref(&self) -> &Job<W> {
        &self.job
    }
}
