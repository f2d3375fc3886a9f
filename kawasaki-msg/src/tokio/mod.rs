//! Both ends in a task of their own that reconnects automatically: a [`Pc`] gives orders by `.await` and stores their
//! progress, a [`Robot`] has its jobs executed by a [`Motion`].
//!
//! ```no_run
//! use kawasaki_msg::robot_session::tokio::Listen;
//! use kawasaki_msg::tokio::{Journal, LastOrder, pc};
//! use kawasaki_msg::{JobKind, Line, PcConfig, Point};
//!
//! # async fn run() -> Result<(), Box<dyn core::error::Error>> {
//! let (journal, last) = Journal::open("order.journal")?;
//! let (robot, task) = pc(PcConfig::tcp(), journal, Listen::bind("0.0.0.0:9105").await?)?;
//! tokio::spawn(task.run());
//! let jobs = vec![Line { kind: JobKind::Draw, start: Point::new(0, 0), end: Point::new(1, 0) }];
//! let mut order = match last {
//!     LastOrder::None => robot.start(50, jobs).await?,
//!     // This program was killed in the middle of the order: nothing is executed twice.
//!     LastOrder::Active(kept) => robot.resume(kept, jobs).await?,
//!     // The order was interrupted: a new one has the rest of the jobs.
//!     LastOrder::Stopped(kept) => robot.go_on(51, kept, jobs).await?,
//!     LastOrder::Complete(_) => return Ok(()), // started again, the jobs would be executed again
//!     // After a look at the workpiece: `go_on` with the count of executed jobs in `kept.executed`.
//!     LastOrder::Unknown(kept) => return Err(format!("check the workpiece after job {}", kept.done()).into()),
//! };
//! while let Some(progress) = order.progress().await {
//!     println!("{} executed, {} queued", progress.executed, progress.queued);
//! }
//! println!("{:?}", order.await?);
//! # Ok(()) }
//! ```

mod journal;
mod robot;
mod service;

use core::future::Future;
use core::pin::Pin;
use core::task::{Context, Poll};
use std::boxed::Box;
use std::io;
use std::string::String;
use std::sync::Arc;
use std::vec::Vec;

use robot_session::tokio::{self as session, Closed, Connector, Handle, Outcome, Task, UdpListen, watch};

pub use journal::{Journal, JournalEntry, LastOrder, ProgressStore};
pub use robot::{Job, Motion, Robot, RobotError, RobotService, SpawnedRobot, robot};
use service::{Call, OrderStart};
pub use service::{Orders, TaskSource};

use crate::dialect::Dialect;
use crate::error::{ConfigError, FieldError, SessionError};
use crate::job::Work;
use crate::message::Message;
use crate::pc::{CommandOutcome, LargePc, PcConfig, Supply};

/// Gives a robot orders, one after the other. Cloning it is cheap.
///
/// All events of the session are those of the [`handle`](Self::handle).
#[derive(Debug)]
pub struct Pc<W: Job, K: ProgressStore> {
    handle: Handle<Orders<W, K>>,
}

/// Creates a PC, and its task. Nothing is sent before `keep` has stored it.
///
/// # Errors
/// As [`LargePc::new`].
pub fn pc<W, K, C>(config: PcConfig, keep: K, connector: C) -> Result<Spawned<W, K, C>, ConfigError>
where
    W: Job,
    K: ProgressStore,
    C: Connector,
{
    pc_with_ranges(config, Default::default(), keep, connector)
}

/// Creates a PC as [`pc`] does, for jobs whose fields are in `ranges`.
///
/// # Errors
/// As [`LargePc::with_ranges`].
pub fn pc_with_ranges<W, K, C>(
    config: PcConfig,
    ranges: W::Ranges,
    keep: K,
    connector: C,
) -> Result<Spawned<W, K, C>, ConfigError>
where
    W: Job,
    K: ProgressStore,
    C: Connector,
{
    let session = LargePc::with_ranges(config, ranges)?;
    let (handle, task) = session::spawn(session, Orders::new(keep), connector);
    Ok((Pc { handle }, task))
}

/// Returns the connector of a [`pc`] over UDP, whose robot sends first: its peer is the sender of the first datagram that is
/// a message of this dialect. Datagrams from other senders are not answered.
pub fn udp(address: impl Into<String>, dialect: Dialect) -> UdpListen<impl FnMut(&[u8]) -> bool + Send> {
    UdpListen::at(address, move |datagram| {
        let message = Message::decode(datagram, dialect.charset());
        matches!(message, Ok(Some((message, _))) if dialect.read(&message).is_ok())
    })
}

/// A handle, and its task.
pub type Spawned<W, K, C> = (Pc<W, K>, Task<Orders<W, K>, C>);

/// The progress of an order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Progress {
    /// The number of jobs of the order that are executed, all of them from the first on.
    pub executed: u32,
    /// The number of jobs that the robot has queued.
    pub queued: u32,
}

/// An order that has begun: a future of its outcome, which is always an event too. For a dropped future, see [dropped
/// futures](Handle#dropped-futures).
#[derive(Debug)]
#[must_use = "without its future, the outcome of the order is an event alone"]
pub struct Order {
    progress: watch::Receiver<Progress>,
    outcome: Outcome<Result<OrderResult, Error>>,
}

/// An order that is over.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct OrderResult {
    /// The number of jobs of the order that were executed, from the first on.
    pub executed: u32,
    /// Whether all jobs were executed.
    pub complete: bool,
    /// The job that could not be sent, counted from 0, and the reason; `None` without such a job.
    pub unfit: Option<(u32, FieldError)>,
}

/// The reason that an order has failed.
#[derive(Debug, Clone, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The caller's fault; nothing was sent.
    #[error(transparent)]
    Call(#[from] SessionError),
    /// There is no usable connection; nothing was sent.
    #[error("not connected: {0}")]
    NotConnected(Arc<io::Error>),
    /// There was no connection on which the order could continue for [`Task::give_up_after`]. The robot may still execute
    /// jobs.
    #[error("no connection for order {}: {why}; it can be resumed", kept.order)]
    GivenUp {
        /// The progress of the order, for [`Pc::resume`].
        kept: JournalEntry,
        /// The last failure of a connection.
        why: Arc<io::Error>,
    },
    /// The robot has refused the order because of its active one (0: none), after all configured retries.
    #[error("the robot refuses the order; its active one is {active}")]
    Refused {
        /// The robot's active order; 0 if the robot cannot begin any order.
        active: u16,
    },
    /// The robot no longer knows the order, as in [`PcEvent::OutcomeUnknown`](crate::PcEvent::OutcomeUnknown).
    #[error("of {sent} jobs sent, {executed} are executed, the others are unknown")]
    OutcomeUnknown {
        /// The number of jobs known to be executed, from the first on.
        executed: u32,
        /// The number of jobs sent; later ones are not executed.
        sent: u32,
    },
    /// The PC was shut down: the order may be resumed.
    #[error(transparent)]
    Closed(#[from] Closed),
}

impl<W: Job, K: ProgressStore> Pc<W, K> {
    /// Begins an order. If it cannot begin, that is its outcome.
    ///
    /// # Errors
    /// The task has ended.
    pub async fn start(&self, order: u16, jobs: impl Into<Vec<W>>) -> Result<Order, Closed> {
        self.start_from(order, all_of(jobs.into(), 0)).await
    }

    /// Begins an order whose jobs come from a function: see [`JobSource`](crate::JobSource).
    ///
    /// # Errors
    /// The task has ended.
    pub async fn start_from(
        &self,
        order: u16,
        source: impl FnMut(u32) -> Supply<W> + Send + 'static,
    ) -> Result<Order, Closed> {
        self.begin(JournalEntry { order, ..JournalEntry::default() }, None, Box::new(source)).await
    }

    /// Continues an order that an earlier PC has begun, with the same list of jobs: as [`Pc::resume`](crate::Pc::resume).
    ///
    /// # Errors
    /// The task has ended.
    pub async fn resume(&self, begun: JournalEntry, jobs: impl Into<Vec<W>>) -> Result<Order, Closed> {
        let (ahead, jobs) = (begun.ahead.clone(), all_of(jobs.into(), begun.first));
        self.begin(begun, Some(ahead), Box::new(jobs)).await
    }

    /// Begins an order with the remaining jobs of an earlier order that was stopped, from the same list: those after the
    /// first [`done`](JournalEntry::done).
    ///
    /// # Errors
    /// The task has ended.
    pub async fn go_on(
        &self,
        order: u16,
        stopped: JournalEntry,
        jobs: impl Into<Vec<W>>,
    ) -> Result<Order, Closed> {
        let first = stopped.done();
        let kept = JournalEntry { order, first, ..JournalEntry::default() };
        self.begin(kept, None, Box::new(all_of(jobs.into(), first))).await
    }

    /// Begins an order, and waits for its outcome.
    ///
    /// # Errors
    /// See [`Error`].
    pub async fn run(&self, order: u16, jobs: impl Into<Vec<W>>) -> Result<OrderResult, Error> {
        self.start(order, jobs).await?.await
    }

    /// Ends the order when the jobs that the robot has queued are executed.
    ///
    /// # Errors
    /// See [`Error`].
    pub async fn end(&self) -> Result<(), Error> {
        self.handle.call(Call::End).await?
    }

    /// Ends the order when the job that is being executed is done.
    ///
    /// # Errors
    /// See [`Error`].
    pub async fn interrupt(&self) -> Result<(), Error> {
        self.handle.call(Call::Interrupt).await?
    }

    /// Sends a command that bypasses the queue, once.
    ///
    /// # Errors
    /// See [`Error`].
    pub async fn command(&self, id: u8, value: i32) -> Result<CommandOutcome, Error> {
        self.handle.call(|reply| Call::Command { id, value, reply }).await?
    }

    /// Returns the generic handle: events, the state of the connection, shutdown.
    pub const fn handle(&self) -> &Handle<Orders<W, K>> {
        &self.handle
    }

    async fn begin(
        &self,
        kept: JournalEntry,
        resumed: Option<Vec<u32>>,
        source: Box<dyn FnMut(u32) -> Supply<W> + Send>,
    ) -> Result<Order, Closed> {
        let (known, progress) = watch::channel(Progress { executed: kept.executed, queued: 0 });
        let source = TaskSource(source);
        let call = |reply| Call::Start(OrderStart { kept, resumed, source, known, reply });
        let outcome = self.handle.begin(call).await?;
        Ok(Order { progress, outcome })
    }
}

impl<W: Job, K: ProgressStore> Clone for Pc<W, K> {
    fn clone(&self) -> Self {
        Self { handle: self.handle.clone() }
    }
}

/// Returns the jobs of a list from this index on.
fn all_of<W: Work>(jobs: Vec<W>, first: u32) -> impl FnMut(u32) -> Supply<W> {
    move |index| {
        let place = first.checked_add(index).and_then(|place| usize::try_from(place).ok());
        let job = place.and_then(|place| jobs.get(place));
        job.map_or(Supply::End, |job| Supply::Job(*job))
    }
}

impl Order {
    /// Waits for the next progress; of several, returns the last. `None` when the order has an outcome.
    pub async fn progress(&mut self) -> Option<Progress> {
        self.progress.changed().await.ok()?;
        Some(*self.progress.borrow_and_update())
    }
}

impl Future for Order {
    type Output = Result<OrderResult, Error>;

    fn poll(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Self::Output> {
        Pin::new(&mut self.outcome).poll(context).map(|outcome| outcome?)
    }
}
