//! The host in a task of its own, which reopens its port automatically: a target that may be set from anywhere.
//!
//! ```no_run
//! use val2_alter::HostConfig;
//! use val2_alter::robot_session::tokio::Tcp;
//!
//! # async fn run() -> Result<(), Box<dyn core::error::Error>> {
//! let (arm, task) = val2_alter::tokio::host(HostConfig::default(), None, Tcp::new("192.168.0.9:4001"))?;
//! tokio::spawn(task.run());
//! arm.set_target([16, 0, 0, 0, 0, 0]); // 18 mm/s, for 200 ms
//! arm.stop().await?;
//! # Ok(()) }
//! ```
//!
//! A reply is due 15 ms after its message: if other tasks may compute for this long, [`Task::thread`] gives this one a
//! thread.

use core::time::Duration;
use std::io;
use std::sync::Arc;
use std::vec::Vec;

use robot_session::end::End as _;
use robot_session::now;
use robot_session::tokio::{
    self as session, Closed, Connector, Handle, Reply, Reports, Service, Task, watch,
};

use crate::error::{ConfigError, SessionError};
use crate::host::{ExceptionOutcome, Host, HostConfig, HostEvent, HostState, Policy};
use crate::limit::Reach;
use crate::message::{AXES, Accumulation, Exception};

/// Moves an arm. Cloning it is cheap.
#[derive(Debug, Clone)]
pub struct Arm {
    target: Arc<watch::Sender<Option<Target>>>,
    commanded: watch::Receiver<[i32; AXES]>,
    handle: Handle<ArmService>,
}

/// The target, and the time at which it was set.
type Target = ([i16; AXES], Duration);

/// A handle, and the task that it works through.
pub type Spawned<C> = (Arm, Task<ArmService, C>);

/// Creates an arm, and the task that answers its controller. With `reach`, values beyond it are not
/// [commanded](Arm::commanded).
///
/// # Errors
/// As [`Host::new`].
pub fn host<C: Connector>(
    config: HostConfig,
    reach: Option<Reach>,
    connector: C,
) -> Result<Spawned<C>, ConfigError> {
    let session = Host::new(config)?;
    let (target, to) = watch::channel(None);
    let (odometer, commanded) = watch::channel([0; AXES]);
    let moving =
        ArmService { reach, to, odometer, replies: 0, before: [0; AXES], stops: Vec::new(), exception: None };
    let (handle, task) = session::spawn(session, moving, connector);
    Ok((Arm { target: Arc::new(target), commanded, handle }, task))
}

/// The reason that a call has no such outcome.
#[derive(Debug, Clone, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The state of the link does not allow it; nothing was sent.
    #[error(transparent)]
    Call(#[from] SessionError),
    /// There is no connection; nothing was sent.
    #[error("not connected: {0}")]
    NotConnected(Arc<io::Error>),
    /// The task has ended, so that the call has no outcome.
    #[error(transparent)]
    Closed(#[from] Closed),
}

impl Arm {
    /// Sets the target of the next replies as [`Host::set_target`] does, within the limits of the configuration and the
    /// reach. The target is valid for [`HostConfig::target_timeout`] from now on, and has no effect before the controller
    /// has started ALTER.
    pub fn set_target(&self, target: [i16; AXES]) {
        self.target.send_replace(Some((target, now())));
    }

    /// Removes the target: speeds go to zero, an offset stays.
    pub fn clear_target(&self) {
        self.target.send_replace(None);
    }

    /// Returns the commanded way of the arm since the task began, in units of its words; with offsets, the commanded
    /// position. Replies that the controller could not read do not count.
    pub fn commanded(&self) -> [i32; AXES] {
        *self.commanded.borrow()
    }

    /// Brings the arm to rest within the limits, then ends ALTER; waits for that. The next start of the controller is not
    /// answered before [`accept`](Self::accept).
    ///
    /// # Errors
    /// See [`Error`].
    pub async fn stop(&self) -> Result<(), Error> {
        self.handle.call(Call::Stop).await?
    }

    /// Answers start messages again, even if the future is dropped.
    ///
    /// # Errors
    /// See [`Error`].
    pub async fn accept(&self) -> Result<(), Error> {
        self.handle.call(|reply| Call::Policy(Policy::Accept, reply)).await?
    }

    /// Sends an exception; waits for its outcome.
    ///
    /// # Errors
    /// See [`Error`].
    pub async fn exception(&self, exception: Exception) -> Result<ExceptionOutcome, Error> {
        self.handle.call(|reply| Call::Exception(exception, reply)).await?
    }

    /// Returns the handle with the parts that all handles have: every event, the state of the connection, the end.
    pub const fn handle(&self) -> &Handle<ArmService> {
        &self.handle
    }
}

/// A call of an [`Arm`].
#[derive(Debug)]
pub enum Call {
    /// Brings the arm to rest, and ends ALTER.
    Stop(Reply<Result<(), Error>>),
    /// Sets the policy for starts.
    Policy(Policy, Reply<Result<(), Error>>),
    /// Sends an exception with the next reply.
    Exception(Exception, Reply<Result<ExceptionOutcome, Error>>),
}

/// The service of the task: puts the target into each reply, and returns outcomes to their callers.
#[derive(Debug)]
pub struct ArmService {
    reach: Option<Reach>,
    to: watch::Receiver<Option<Target>>,
    odometer: watch::Sender<[i32; AXES]>,
    /// The number of replies in the odometer, and its values before the last one.
    replies: u64,
    before: [i32; AXES],
    stops: Vec<Reply<Result<(), Error>>>,
    exception: Option<Reply<Result<ExceptionOutcome, Error>>>,
}

impl ArmService {
    /// Counts a message that has come: the previous reply was read.
    fn count(&mut self, session: &Host) {
        let replies = robot_session::Session::statistics(session).replies;
        if replies == self.replies {
            return;
        }
        self.replies = replies;
        self.before = *self.odometer.borrow();
        let is_speed = session.config().mode.accumulation() == Accumulation::Cumulative;
        self.odometer.send_modify(|odometer| {
            for (way, value) in odometer.iter_mut().zip(session.values()) {
                *way = if is_speed { way.saturating_add(value.into()) } else { value.into() };
            }
        });
    }

    /// Sets the current target for the reply that is due.
    fn aim(&self, session: &mut Host, now: Duration) {
        let Some((target, since)) = *self.to.borrow() else {
            session.clear_target(now);
            return;
        };
        let config = session.config();
        let target = match (&self.reach, config.mode.accumulation()) {
            (None, _) => target,
            (Some(reach), Accumulation::Cumulative) => {
                reach.speeds(*self.odometer.borrow(), target, &config.limits.acceleration)
            }
            (Some(reach), Accumulation::NonCumulative) => reach.offsets(target),
        };
        // A target is as old as its caller has let it become.
        session.set_target(since, target);
    }
}

impl Service for ArmService {
    type Session = Host;
    type Call = Call;
    type Event = HostEvent;

    fn call(&mut self, session: &mut Host, now: Duration, call: Call) {
        match call {
            Call::Stop(reply) => {
                session.stop(now);
                if session.state() == HostState::Stopping {
                    self.stops.push(reply);
                } else {
                    let _ = reply.send(Ok(()));
                }
            }
            Call::Policy(policy, reply) => {
                session.set_policy(now, policy);
                let _ = reply.send(Ok(()));
            }
            Call::Exception(_, reply) if reply.is_abandoned() => {}
            Call::Exception(exception, reply) => match session.exception(now, exception) {
                Ok(()) => self.exception = Some(reply),
                Err(error) => drop(reply.send(Err(error.into()))),
            },
        }
    }

    fn event(&mut self, session: &mut Host, event: HostEvent, reports: &mut Reports<'_, HostEvent>) {
        match event {
            HostEvent::Motion(_) => {
                self.count(session);
                self.aim(session, now());
            }
            // Whether this comes before or after its message, the reply is in the odometer then.
            HostEvent::Rejected(_) => {
                self.count(session);
                self.odometer.send_replace(self.before);
            }
            HostEvent::Exception { outcome, .. } => {
                if let Some(reply) = self.exception.take() {
                    let _ = reply.send(Ok(outcome));
                }
            }
            HostEvent::Stopped | HostEvent::End(_) | HostEvent::Lost(_) => {
                // The last reply may have moved the arm.
                self.count(session);
                self.stops.drain(..).for_each(|reply| drop(reply.send(Ok(()))));
            }
            _ => {}
        }
        reports.event(event);
    }

    fn refuse(&mut self, call: Call, why: &Arc<io::Error>) {
        let error = Error::NotConnected(Arc::clone(why));
        match call {
            // Without a connection nothing moves by our replies.
            Call::Stop(reply) | Call::Policy(_, reply) => drop(reply.send(Err(error))),
            Call::Exception(_, reply) => drop(reply.send(Err(error))),
        }
    }
}
