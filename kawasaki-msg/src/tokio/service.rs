//! The service of the PC's task: it passes on orders, and gives outcomes to their callers.

use core::fmt;
use core::time::Duration;
use std::boxed::Box;
use std::collections::VecDeque;
use std::io;
use std::sync::Arc;
use std::vec::Vec;

use robot_session::tokio::{Reply, Reports, Service, watch};

use super::journal::{JournalEntry, LastOrder, ProgressStore};
use super::{Error, Job, OrderResult, Progress};
use crate::error::FieldError;
use crate::job::Work;
use crate::pc::{CommandOutcome, JobSource, LargePc, PcEvent, Supply};

/// The task's source of the jobs of an order.
pub struct TaskSource<W>(pub(super) Box<dyn FnMut(u32) -> Supply<W> + Send>);

impl<W: Work> JobSource for TaskSource<W> {
    type Work = W;

    fn job(&mut self, index: u32) -> Supply<W> {
        (self.0)(index)
    }
}

impl<W> fmt::Debug for TaskSource<W> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Source").finish_non_exhaustive()
    }
}

/// The order that the session has, its commands, and the store of the progress.
#[derive(Debug)]
pub struct Orders<W, K> {
    keep: K,
    /// The order that was stored, and the numbers of its jobs that were sent and executed then.
    kept: (u16, u32, u32),
    /// The index of the order's first job in the caller's list.
    first: u32,
    active: Option<ActiveOrder>,
    /// The end of an order, until it is stored. `None` if no part of the order was sent: the journal stays as it is.
    ended: Option<LastOrder>,
    /// The outcome of an order that is not stored yet.
    outcome: Option<OrderOutcome>,
    commands: VecDeque<Reply<Result<CommandOutcome, Error>>>,
    jobs: core::marker::PhantomData<fn() -> W>,
}

/// The caller that waits for the order.
#[derive(Debug)]
struct ActiveOrder {
    known: watch::Sender<Progress>,
    reply: Reply<Result<OrderResult, Error>>,
    unfit: Option<(u32, FieldError)>,
}

/// The outcome of an order. Its caller receives it when this is dropped: once it is stored, or cannot be.
#[derive(Debug)]
struct OrderOutcome(Option<(Reply<Outcome>, Outcome)>);

type Outcome = Result<OrderResult, Error>;

impl Drop for OrderOutcome {
    fn drop(&mut self) {
        if let Some((reply, outcome)) = self.0.take() {
            let _ = reply.send(outcome);
        }
    }
}

/// The number of executed jobs after which the progress is stored again although no job is sent.
const STORE_EVERY: u32 = 64;

/// A call of a [`Pc`](super::Pc).
#[derive(Debug)]
pub enum Call<W> {
    /// Begins an order, or continues one.
    Start(OrderStart<W>),
    /// Ends the order when the queue is empty.
    End(Reply<Result<(), Error>>),
    /// Ends the order after the job that is being executed.
    Interrupt(Reply<Result<(), Error>>),
    /// Sends a command that bypasses the queue.
    Command { id: u8, value: i32, reply: Reply<Result<CommandOutcome, Error>> },
}

/// An order that is to begin.
#[derive(Debug)]
pub struct OrderStart<W> {
    pub(super) kept: JournalEntry,
    /// The jobs that were executed ahead of others, if the order has begun before.
    pub(super) resumed: Option<Vec<u32>>,
    pub(super) source: TaskSource<W>,
    pub(super) known: watch::Sender<Progress>,
    pub(super) reply: Reply<Result<OrderResult, Error>>,
}

type Session<W> = LargePc<TaskSource<W>>;

impl<W, K> Orders<W, K> {
    pub(super) fn new(keep: K) -> Self {
        let (active, ended, outcome, commands) = (None, None, None, VecDeque::new());
        Self {
            keep,
            kept: (0, 0, 0),
            first: 0,
            active,
            ended,
            outcome,
            commands,
            jobs: core::marker::PhantomData,
        }
    }

    /// Returns the progress of the order of a session, or its last progress once it has ended.
    fn progress(&self, session: &Session<W>) -> JournalEntry
    where
        W: Work,
    {
        let (executed, sent) = (session.executed(), session.sent());
        JournalEntry {
            order: session.order().unwrap_or(0),
            first: self.first,
            executed,
            sent,
            ahead: (executed..sent).filter(|index| session.is_executed(*index)).collect(),
        }
    }

    /// Ends the order with an outcome, which its caller receives when the return value is dropped. If the outcome is not
    /// awaited, it is an event.
    fn end(
        &mut self,
        outcome: impl FnOnce(Option<(u32, FieldError)>) -> Result<OrderResult, Error>,
    ) -> OrderOutcome {
        OrderOutcome(self.active.take().map(|ActiveOrder { reply, unfit, .. }| (reply, outcome(unfit))))
    }
}

impl<W: Job, K: ProgressStore> Service for Orders<W, K> {
    type Session = Session<W>;
    type Call = Call<W>;
    type Event = PcEvent;

    fn call(&mut self, session: &mut Session<W>, _now: Duration, call: Call<W>) {
        match call {
            Call::Start(OrderStart { reply, .. }) if reply.is_abandoned() => {}
            Call::Start(OrderStart { kept, resumed, source, known, reply }) => {
                let begun = match resumed {
                    None => session.start(kept.order, source),
                    Some(ahead) => session.resume(kept.order, source, kept.executed, kept.sent, ahead),
                };
                match begun {
                    Ok(()) => {
                        (self.active, self.ended) = (Some(ActiveOrder { known, reply, unfit: None }), None);
                        self.first = kept.first;
                    }
                    Err(error) => drop(reply.send(Err(error.into()))),
                }
            }
            Call::End(reply) => drop(reply.send(session.end().map_err(Error::from))),
            Call::Interrupt(reply) => drop(reply.send(session.interrupt().map_err(Error::from))),
            Call::Command { reply, .. } if reply.is_abandoned() => {}
            Call::Command { id, value, reply } => match session.command(id, value) {
                Ok(()) => self.commands.push_back(reply),
                Err(error) => drop(reply.send(Err(error.into()))),
            },
        }
    }

    fn event(&mut self, session: &mut Session<W>, event: PcEvent, reports: &mut Reports<'_, PcEvent>) {
        match event {
            PcEvent::Disconnect => {
                reports.reconnect(io::Error::new(io::ErrorKind::TimedOut, "the robot is silent"));
            }
            PcEvent::Progress { executed, queued } => {
                if let Some(active) = &self.active {
                    active.known.send_replace(Progress { executed, queued });
                }
            }
            PcEvent::JobUnfit { index, error, .. } => {
                if let Some(active) = &mut self.active {
                    active.unfit = Some((index, error));
                }
            }
            PcEvent::OrderOver { order, executed, complete } => {
                let ended = if complete { LastOrder::Complete } else { LastOrder::Stopped };
                self.ended = Some(ended(JournalEntry { order, ..self.progress(session) }));
                self.outcome = Some(self.end(|unfit| Ok(OrderResult { executed, complete, unfit })));
            }
            PcEvent::OutcomeUnknown { order, executed, sent } => {
                self.ended = Some(LastOrder::Unknown(JournalEntry { order, ..self.progress(session) }));
                self.outcome = Some(self.end(|_| Err(Error::OutcomeUnknown { executed, sent })));
            }
            PcEvent::OrderRefused { active, given_up: true, .. } => {
                drop(self.end(|_| Err(Error::Refused { active })));
            }
            PcEvent::Command { outcome, .. } => {
                if let Some(reply) = self.commands.pop_front() {
                    let _ = reply.send(Ok(outcome));
                }
            }
            _ => {}
        }
        reports.event(event);
    }

    /// Stores the progress before jobs are sent, after each 64 executed jobs, and before the caller receives the
    /// outcome.
    async fn keep(&mut self, session: &mut Session<W>) -> io::Result<()> {
        let _stored = self.outcome.take();
        let (order, sent, executed) = (session.order().unwrap_or(0), session.sent(), session.executed());
        let (kept_order, kept_sent, kept_executed) = self.kept;
        let is_kept = (order, sent) == (kept_order, kept_sent) && executed < kept_executed + STORE_EVERY;
        let last = match session.order() {
            Some(_) if is_kept => return Ok(()),
            Some(_) => Some(LastOrder::Active(self.progress(session))),
            // The event that ends the order is still in the session.
            None if self.active.is_some() => return Ok(()),
            None => self.ended.clone(),
        };
        if let Some(last) = last {
            self.keep.keep(&last).await?;
            self.ended = None;
        }
        self.kept = (order, sent, executed);
        Ok(())
    }

    fn give_up(
        &mut self,
        session: &mut Session<W>,
        why: &Arc<io::Error>,
        reports: &mut Reports<'_, PcEvent>,
    ) {
        self.outcome = None;
        if self.active.is_none() && self.commands.is_empty() {
            return;
        }
        for reply in core::mem::take(&mut self.commands) {
            let _ = reply.send(Err(Error::NotConnected(Arc::clone(why))));
        }
        let kept = self.progress(session);
        let JournalEntry { order, executed, sent, .. } = kept;
        let why = Arc::clone(why);
        if session.forget() {
            // The order can be resumed: it stays stored.
            self.kept = (0, session.sent(), session.executed());
            reports.event(PcEvent::OutcomeUnknown { order, executed, sent });
            drop(self.end(|_| Err(Error::GivenUp { kept, why })));
        } else {
            drop(self.end(|_| Err(Error::NotConnected(why))));
        }
    }

    fn refuse(&mut self, call: Call<W>, why: &Arc<io::Error>) {
        let error = Error::NotConnected(Arc::clone(why));
        match call {
            Call::Start(OrderStart { reply, .. }) => drop(reply.send(Err(error))),
            Call::End(reply) | Call::Interrupt(reply) => drop(reply.send(Err(error))),
            Call::Command { reply, .. } => drop(reply.send(Err(error))),
        }
    }
}
