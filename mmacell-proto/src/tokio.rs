//! The central controller's end of a device in a task of its own, which reconnects automatically: commands by `.await`.
//!
//! ```no_run
//! use mmacell_proto::robot_session::tokio::Tcp;
//! use mmacell_proto::{CentralConfig, Command, RobotPose, port};
//!
//! # async fn run(pose: RobotPose) -> Result<(), Box<dyn core::error::Error>> {
//! let (robot, task) = mmacell_proto::tokio::central(CentralConfig::DEFAULT, Tcp::new("192.168.0.1:2001"))?;
//! tokio::spawn(task.run());
//! robot.command(Command::Servo { on: true }).await?;
//! let status = robot.move_to(pose).await?;
//! println!("{:?}", status.pose);
//! # Ok(()) }
//! ```

use core::time::Duration;
use std::io;
use std::sync::Arc;

use robot_session::now;
use robot_session::tokio::{
    self as session, Closed, Connector, GIVE_UP_AFTER, Handle, Reply, Reports, Service, Task,
};

use crate::central::{Central, CentralConfig, CentralEvent, CloseReason, MissReason, Progress, Unfinished};
use crate::error::{ConfigError, SessionError};
use crate::message::{Command, ErrorCode, Mode, Status};
use crate::pose::Pose;

/// The interval at which a device is polled for its arrival.
const ASK: Duration = Duration::from_millis(50);

/// A device: its commands are executed one after the other. Cloning it is cheap.
///
/// All events of the session are those of the [`handle`](Self::handle). A motion that has begun continues when its future is
/// [dropped](Handle#dropped-futures).
#[derive(Debug)]
pub struct Device<P: Pose + Send + 'static> {
    handle: Handle<Commands<P>>,
}

/// A handle, and the task that it works through.
pub type Spawned<P, C> = (Device<P>, Task<Commands<P>, C>);

/// Creates a device, and the task that executes its calls.
///
/// # Errors
/// As [`Central::new`].
pub fn central<P, C>(config: CentralConfig, connector: C) -> Result<Spawned<P, C>, ConfigError>
where
    P: Pose + Send + 'static,
    C: Connector,
{
    let commands = Commands { asked: None, motion: None };
    let (handle, task) = session::spawn(Central::new(config)?, commands, connector);
    Ok((Device { handle }, task))
}

/// The reason that a command was not executed, or may not have been.
#[derive(Debug, Clone, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The caller's fault; nothing was sent.
    #[error(transparent)]
    Call(#[from] SessionError),
    /// There is no connection; nothing was sent.
    #[error("not connected: {0}")]
    NotConnected(Arc<io::Error>),
    /// The device has not executed it.
    #[error("the device refuses the command: {0}")]
    Refused(ErrorCode),
    /// The connection has ended before the command was sent.
    #[error("the connection ended before the command was sent: {0}")]
    NotSent(CloseReason),
    /// The connection has ended before the reply.
    #[error("outcome of the command unknown: the connection ended: {0}")]
    Unknown(CloseReason),
    /// The motion has ended elsewhere.
    #[error("the motion has not arrived: {0}")]
    Missed(MissReason),
    /// For [`GIVE_UP_AFTER`] the device has refused to report its status. Whether the motion has arrived is unknown.
    #[error("outcome of the motion unknown: the device does not report its status: {0}")]
    Unreported(ErrorCode),
    /// The motion was stopped by another client.
    #[error("the motion was stopped")]
    Stopped,
    /// The task has ended. Whether the command was executed is unknown.
    #[error(transparent)]
    Closed(#[from] Closed),
}

impl<P: Pose + Send + 'static> Device<P> {
    /// Has a command executed. The reply to a motion means that it has started.
    ///
    /// # Errors
    /// See [`Error`].
    pub async fn command(&self, command: Command<P>) -> Result<(), Error> {
        self.ask(command, WaitFor::Reply).await.map(drop)
    }

    /// Asks for the status.
    ///
    /// # Errors
    /// See [`Error`].
    pub async fn status(&self) -> Result<(Status<P>, Progress), Error> {
        self.ask(Command::Status, WaitFor::Reply).await?.ok_or(Error::Stopped)
    }

    /// Moves to a pose, and waits until the device is there; returns the status then. The status is requested 20 times a
    /// second.
    ///
    /// # Errors
    /// See [`Error`].
    pub async fn move_to(&self, pose: P) -> Result<Status<P>, Error> {
        let command = Command::Move { mode: Mode::Absolute, pose };
        let arrived = self.ask(command, WaitFor::Arrived).await?;
        arrived.map(|(status, _)| status).ok_or(Error::Stopped)
    }

    /// Returns the generic handle: events, the state of the connection, shutdown.
    pub const fn handle(&self) -> &Handle<Commands<P>> {
        &self.handle
    }

    async fn ask(&self, command: Command<P>, until: WaitFor) -> Outcome<P> {
        self.handle.call(|reply| PendingCommand { command, until, reply }).await?
    }
}

impl<P: Pose + Send + 'static> Clone for Device<P> {
    fn clone(&self) -> Self {
        Self { handle: self.handle.clone() }
    }
}

/// The outcome of a command; of a status, its contents.
type Outcome<P> = Result<Option<(Status<P>, Progress)>, Error>;

/// The time for which a call waits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum WaitFor {
    Reply,
    Arrived,
}

/// A command, and the channel of its outcome.
#[derive(Debug)]
pub struct PendingCommand<P> {
    command: Command<P>,
    until: WaitFor,
    reply: Reply<Outcome<P>>,
}

/// A motion that has started.
#[derive(Debug)]
struct Motion<P> {
    reply: Reply<Outcome<P>>,
    /// The time of the next poll; `None` while a poll is open.
    ask: Option<Duration>,
    /// The time at which the motion is given up if the device has reported no status until then.
    silent_at: Duration,
}

/// The service of the task: sends commands, and returns outcomes to their callers.
#[derive(Debug)]
pub struct Commands<P> {
    /// The outstanding command; `None` if there is no such command.
    asked: Option<PendingCommand<P>>,
    motion: Option<Motion<P>>,
}

impl<P: Pose> Commands<P> {
    /// Ends the outstanding command with its outcome; if the command is no longer awaited, reports the outcome as an event.
    fn end(&mut self, outcome: Outcome<P>) {
        if let Some(asked) = self.asked.take() {
            let _ = asked.reply.send(outcome);
        }
    }

    fn end_motion(&mut self, outcome: Outcome<P>) {
        if let Some(motion) = self.motion.take() {
            let _ = motion.reply.send(outcome);
        }
    }

    /// Called when the command is executed, or has started.
    fn done(&mut self) {
        match self.asked.take() {
            Some(PendingCommand { until: WaitFor::Arrived, reply, .. }) => {
                // Another motion takes the place of this one.
                self.end_motion(Err(Error::Stopped));
                let now = now();
                let (ask, silent_at) = (Some(now.saturating_add(ASK)), now.saturating_add(GIVE_UP_AFTER));
                self.motion = Some(Motion { reply, ask, silent_at });
            }
            Some(asked) => {
                if matches!(asked.command, Command::Move { .. } | Command::Stop | Command::Reset) {
                    self.end_motion(Err(Error::Stopped));
                }
                let _ = asked.reply.send(Ok(None));
            }
            None => {}
        }
    }

    /// Applies a status to the awaited motion.
    fn moved(&mut self, status: Status<P>, progress: Progress) {
        match progress {
            Progress::Arrived => self.end_motion(Ok(Some((status, progress)))),
            Progress::Missed(miss) => self.end_motion(Err(Error::Missed(miss))),
            Progress::Still => self.end_motion(Err(Error::Stopped)),
            Progress::Starting | Progress::Moving | Progress::Stopping => {
                if let Some(motion) = &mut self.motion {
                    let now = now();
                    motion.ask = Some(now.saturating_add(ASK));
                    motion.silent_at = now.saturating_add(GIVE_UP_AFTER);
                }
            }
        }
    }
}

impl<P: Pose + Send + 'static> Service for Commands<P> {
    type Session = Central<P>;
    type Call = PendingCommand<P>;
    type Event = CentralEvent<P>;

    fn has_room(&self, session: &Central<P>) -> bool {
        session.is_idle()
    }

    fn call(&mut self, session: &mut Central<P>, _now: Duration, call: PendingCommand<P>) {
        if call.reply.is_abandoned() {
            return;
        }
        match session.request(call.command) {
            Ok(()) => self.asked = Some(call),
            Err(error) => drop(call.reply.send(Err(error.into()))),
        }
    }

    fn event(
        &mut self,
        _session: &mut Central<P>,
        event: CentralEvent<P>,
        reports: &mut Reports<'_, CentralEvent<P>>,
    ) {
        match event {
            CentralEvent::Done { .. } => self.done(),
            CentralEvent::Refused { error, .. } => match (&self.asked, &mut self.motion) {
                (None, Some(motion)) if now() < motion.silent_at => {
                    motion.ask = Some(now().saturating_add(ASK));
                }
                (None, _) => self.end_motion(Err(Error::Unreported(error))),
                (Some(_), _) => self.end(Err(Error::Refused(error))),
            },
            CentralEvent::Status { status, motion } => {
                self.moved(status, motion);
                self.end(Ok(Some((status, motion))));
            }
            CentralEvent::Closed { reason, unfinished } => {
                self.end(match (reason, unfinished) {
                    (CloseReason::Agreed, _) => Ok(None),
                    (_, Unfinished::Unknown(_)) => Err(Error::Unknown(reason)),
                    (_, Unfinished::Nothing | Unfinished::NotSent(_)) => Err(Error::NotSent(reason)),
                });
                self.end_motion(Err(Error::Unknown(reason)));
                if reason != CloseReason::Disconnected {
                    reports.reconnect(io::Error::other(std::format!("the connection has ended: {reason}")));
                }
            }
            _ => {}
        }
        reports.event(event);
    }

    fn poll_timeout(&self) -> Option<Duration> {
        self.motion.as_ref()?.ask
    }

    fn handle_timeout(&mut self, session: &mut Central<P>, now: Duration) {
        let Some(motion) = &mut self.motion else { return };
        if motion.ask.is_some_and(|ask| ask <= now) {
            // While another command is outstanding, its reply is awaited first.
            motion.ask =
                if session.request(Command::Status).is_ok() { None } else { Some(now.saturating_add(ASK)) };
        }
    }

    fn refuse(&mut self, call: PendingCommand<P>, why: &Arc<io::Error>) {
        // A caller that is gone does not need to know that nothing was sent.
        let _ = call.reply.send(Err(Error::NotConnected(Arc::clone(why))));
    }
}
