//! The robot in a task of its own.

use core::fmt;
use core::ops::{Deref, DerefMut};
use core::time::Duration;
use std::io;
use std::sync::Arc;

use robot_session::tokio::{
    self as session, Closed, Connector, Handle, Reply, Reports, Service, Task, Waker,
};
use robot_work_queue::Wake;

use crate::error::{ConfigError, SessionError};
use crate::job::Work;
use crate::motion;
use crate::robot::{LargeRobot, RobotConfig, RobotEvent};

/// A robot whose jobs a [`Motion`] executes. Cloning it is cheap.
///
/// All events of the session are those of the [`handle`](Self::handle).
#[derive(Debug)]
pub struct Robot<W: Job> {
    handle: Handle<RobotService<W>>,
}

/// The requirements on a job of a task.
pub trait Job: Work<Ranges: Send> + core::fmt::Debug + Send + 'static {}

impl<W: Work<Ranges: Send> + core::fmt::Debug + Send + 'static> Job for W {}

/// Returns a robot, the end of its motion task, and the task of the robot. It queues at most `capacity` jobs, whose fields
/// are in `ranges`: those that it can reach.
///
/// # Errors
/// As [`LargeRobot::with_ranges`]; when no queue has this capacity and the configuration's numbers.
pub fn robot<W: Job, C: Connector>(
    config: RobotConfig,
    ranges: W::Ranges,
    capacity: usize,
    connector: C,
) -> Result<SpawnedRobot<W, C>, ConfigError> {
    let (queued, completed, max) = (Waker::default(), Waker::default(), config.max_number);
    let (jobs, motion) = motion::boxed_with(capacity, max, Hook(queued.clone()), Hook(completed.clone()))
        .map_err(|_| ConfigError::Queue { capacity, max })?;
    let session = LargeRobot::with_ranges(config, jobs, ranges)?;
    let service = RobotService(core::marker::PhantomData);
    let (handle, task) = session::spawn_woken_by(completed, session, service, connector);
    Ok((Robot { handle }, Motion { motion, queued }, task))
}

/// A handle, its motion task's end, and its task.
pub type SpawnedRobot<W, C> = (Robot<W>, Motion<W>, Task<RobotService<W>, C>);

impl<W: Job> Robot<W> {
    /// Clears the queue of all jobs but the one that is being executed; those not executed come again. Ends an alarm.
    ///
    /// # Errors
    /// If no order is active, or it is ending or being cleared; when the task has ended.
    pub async fn clear_queue(&self) -> Result<(), RobotError> {
        self.handle.call(Call::ClearQueue).await?
    }

    /// Clears the queue and discards the order, as an interruption by the PC does.
    ///
    /// # Errors
    /// If no order is active, or it is interrupted already; when the task has ended.
    pub async fn reset_order(&self) -> Result<(), RobotError> {
        self.handle.call(Call::ResetOrder).await?
    }

    /// Returns the generic handle: events, the state of the connection, shutdown.
    pub const fn handle(&self) -> &Handle<RobotService<W>> {
        &self.handle
    }
}

impl<W: Job> Clone for Robot<W> {
    fn clone(&self) -> Self {
        Self { handle: self.handle.clone() }
    }
}

/// The end of the motion task: a [`motion::Motion`] with a wait for jobs.
///
/// ```no_run
/// # use kawasaki_msg::{Line, tokio::Motion};
/// # async fn draw(_: &Line) {}
/// # async fn run(mut motion: Motion<Line>) {
/// while motion.wait().await {
///     while let Some(job) = motion.take() {
///         draw(&job.work).await;
///         job.complete();
///     }
/// }
/// # }
/// ```
#[derive(Debug)]
pub struct Motion<W> {
    motion: motion::Motion<'static, W, Hook>,
    queued: Waker,
}

impl<W> Motion<W> {
    /// Waits for a job; returns `false` when the robot's task has ended, the session that it returned is dropped, and no job
    /// is unread. A dropped future loses nothing.
    pub async fn wait(&mut self) -> bool {
        loop {
            let is_abandoned = self.motion.is_abandoned();
            // Dropped at once, the job waits again; and a queue that was cleared is swept.
            if self.motion.take().is_some() {
                return true;
            }
            if is_abandoned {
                return false;
            }
            self.queued.woken().await;
        }
    }
}

impl<W> Deref for Motion<W> {
    type Target = motion::Motion<'static, W, Hook>;

    fn deref(&self) -> &Self::Target {
        &self.motion
    }
}

impl<W> DerefMut for Motion<W> {
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut self.motion
    }
}

/// The hook with which each end of the queue wakes the other.
#[derive(Debug)]
pub struct Hook(Waker);

impl Wake for Hook {
    fn wake(&self) {
        self.0.wake();
    }
}

/// The service of a [`Robot`].
pub struct RobotService<W>(core::marker::PhantomData<fn() -> W>);

/// A call of a [`Robot`].
#[derive(Debug)]
pub enum Call {
    /// The first reset of the motion program: clears the list.
    ClearQueue(Reply<Result<(), RobotError>>),
    /// The second reset of the motion program: ends the order.
    ResetOrder(Reply<Result<(), RobotError>>),
}

/// The reason that a call of a [`Robot`] had no effect.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RobotError {
    /// A call that is invalid in this state.
    #[error(transparent)]
    Call(#[from] SessionError),
    /// The task has ended.
    #[error(transparent)]
    Closed(#[from] Closed),
}

impl<W: Job> Service for RobotService<W> {
    type Session = LargeRobot<'static, W, Hook>;
    type Call = Call;
    type Event = RobotEvent;

    const OFFLINE: bool = true;

    fn call(&mut self, session: &mut Self::Session, _now: Duration, call: Call) {
        let (reply, done) = match call {
            Call::ClearQueue(reply) => (reply, session.clear_queue()),
            Call::ResetOrder(reply) => (reply, session.reset_order()),
        };
        // A caller that is gone is informed by the events.
        let _ = reply.send(done.map_err(RobotError::from));
    }

    fn event(&mut self, _: &mut Self::Session, event: RobotEvent, reports: &mut Reports<'_, RobotEvent>) {
        if event == RobotEvent::Disconnect {
            reports.reconnect(io::Error::new(io::ErrorKind::TimedOut, "the PC is silent"));
        }
        reports.event(event);
    }

    /// Drops the call, because the task has ended: its outcome is [`Closed`].
    fn refuse(&mut self, _call: Call, _why: &Arc<io::Error>) {}
}

impl<W> fmt::Debug for RobotService<W> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Queueing")
    }
}
