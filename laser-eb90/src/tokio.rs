//! The host in a task of its own, which reopens its port automatically: runs of instructions and queries by `.await`.
//!
//! ```no_run
//! use laser_eb90::HostConfig;
//! use laser_eb90::robot_session::tokio::Tcp;
//! use laser_eb90::tokio::{Command, host};
//!
//! # async fn run() -> Result<(), Box<dyn core::error::Error>> {
//! let (laser, task) = host(HostConfig::default(), Tcp::new("192.168.0.5:4001"))?;
//! tokio::spawn(task.run());
//! let corners = [[0.0, 0.0], [100.0, 0.0], [100.0, 100.0], [0.0, 100.0], [0.0, 0.0]];
//! let cuts = corners.map(|corner| Command::new(0x0101, move |parameters| parameters.f32(&corner).map(drop)));
//! laser.run(cuts).await?;
//! let state = laser.query(Command::bare(0x0301)).await?;
//! println!("{:?}", state.items());
//! # Ok(()) }
//! ```

use core::fmt;
use core::time::Duration;
use std::boxed::Box;
use std::collections::VecDeque;
use std::io;
use std::sync::Arc;
use std::vec::Vec;

use robot_session::end::End as _;
use robot_session::tokio::{self as session, Closed, Connector, Handle, Reply, Reports, Service, Task};

use crate::error::{ConfigError, EncodeError, SessionError};
use crate::host::machine::UnknownReason;
use crate::host::{Host, HostConfig, HostEvent};
use crate::items::Items;
use crate::payload::Payload;
use crate::profile::Profile;
use crate::words::Refusal;

/// Has a laser robot execute instructions. Cloning it is cheap.
///
/// Runs are sent one after the other, in frames of up to seven instructions; the frames of [`query`](Self::query) and
/// [`now`](Self::now) go between two frames of a run. All events of the session are those of the [`handle`](Self::handle).
#[derive(Debug, Clone)]
pub struct Laser {
    handle: Handle<Instructions>,
}

/// Creates a laser, and the task that executes its calls.
///
/// # Errors
/// As [`Host::new`].
pub fn host<C: Connector>(
    config: HostConfig,
    connector: C,
) -> Result<(Laser, Task<Instructions, C>), ConfigError> {
    let instructions = Instructions::default();
    let (handle, task) = session::spawn(Host::new(config)?, instructions, connector);
    Ok((Laser { handle }, task))
}

/// An instruction that is to be sent.
pub struct Command {
    word: u16,
    parameters: Box<Parameters>,
}

/// Writes the parameters of an instruction; called again when they do not fit a frame.
type Parameters = dyn Fn(&mut Payload<'_>) -> Result<(), EncodeError> + Send;

/// The values that a query was answered with.
#[derive(Debug, Clone)]
pub struct Answer {
    bytes: Vec<u8>,
    profile: Profile,
}

/// The reason that a run was not accepted completely, or that a query has no answer.
#[derive(Debug, Clone, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The caller's fault: this instruction, counted from 0, cannot be sent. Those before it were taken.
    #[error("instruction {index} cannot be sent: {error}")]
    Unfit {
        /// The index of the instruction, from 0.
        index: usize,
        /// The reason that the instruction cannot be sent.
        error: SessionError,
    },
    /// Error codes to the end. The first `taken` instructions were taken, and no others.
    #[error("the controller refuses: {refusal}; {taken} instructions of the run were taken before")]
    Refused {
        /// The number of accepted instructions of the run.
        taken: usize,
        /// The error code that came last.
        refusal: Refusal,
    },
    /// The first `taken` instructions were queued; the outcome of the next `count` is unknown; the others were not queued.
    #[error(
        "whether {count} instructions after the first {taken} of the run were taken is unknown: {reason}"
    )]
    Unknown {
        /// The number of accepted instructions of the run.
        taken: usize,
        /// The number of instructions with unknown outcome, which follow the accepted ones.
        count: usize,
        /// The reason that the outcome is unknown.
        reason: UnknownReason,
    },
    /// An earlier run failed, and nothing of this one was sent: check the machine first.
    #[error("an earlier run failed; nothing of this one was sent")]
    NotSent,
    /// There is no usable connection; nothing was sent.
    #[error("not connected: {0}")]
    NotConnected(Arc<io::Error>),
    /// The task has ended. The outcome of the run is unknown.
    #[error(transparent)]
    Closed(#[from] Closed),
}

impl Laser {
    /// Sends instructions, and waits until the controller has taken all of them: interpreted ones are queued then, and not
    /// executed yet.
    ///
    /// If the future is [dropped](Handle#dropped-futures), the instructions that are not submitted yet are withdrawn too.
    ///
    /// # Errors
    /// See [`Error`].
    pub async fn run(&self, commands: impl IntoIterator<Item = Command>) -> Result<(), Error> {
        let commands = commands.into_iter().collect();
        self.handle.call(|reply| Call::Run(Run { commands, next: 0, taken: 0, unfit: None, reply })).await?
    }

    /// Sends an immediate instruction, and waits until it is executed.
    ///
    /// # Errors
    /// See [`Error`].
    pub async fn now(&self, command: Command) -> Result<(), Error> {
        self.query(command).await.map(drop)
    }

    /// Sends a query; its values.
    ///
    /// # Errors
    /// See [`Error`].
    pub async fn query(&self, command: Command) -> Result<Answer, Error> {
        self.handle.call(|reply| Call::Single(PendingInstruction { command, reply })).await?
    }

    /// Returns the handle with the parts that all handles have: every event, the state of the connection, the end.
    pub const fn handle(&self) -> &Handle<Instructions> {
        &self.handle
    }
}

impl Command {
    /// Returns an instruction with parameters, which are as in [`Host::submit`].
    pub fn new(
        word: u16,
        parameters: impl Fn(&mut Payload<'_>) -> Result<(), EncodeError> + Send + 'static,
    ) -> Self {
        Self { word, parameters: Box::new(parameters) }
    }

    /// Creates an instruction without parameters.
    pub fn bare(word: u16) -> Self {
        Self::new(word, |_| Ok(()))
    }

    fn submit(&self, session: &mut Host) -> Result<u64, SessionError> {
        session.submit(self.word, |payload| (self.parameters)(payload))
    }
}

impl fmt::Debug for Command {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Command").field("word", &format_args!("{:04X}h", self.word)).finish_non_exhaustive()
    }
}

impl Answer {
    /// Returns the values.
    pub fn items(&self) -> Items<'_> {
        Items::new(&self.bytes, &self.profile)
    }
}

/// A call of a [`Laser`].
#[derive(Debug)]
pub enum Call {
    /// Sends interpreted instructions, in as many frames as needed.
    Run(Run),
    /// Sends an instruction in a frame of its own, between two frames of a run.
    Single(PendingInstruction),
}

/// A run, and the channel of its outcome.
#[derive(Debug)]
pub struct Run {
    commands: Vec<Command>,
    /// The first that was not submitted.
    next: usize,
    /// The number of accepted instructions at the beginning of the run.
    taken: usize,
    unfit: Option<Error>,
    reply: Reply<Result<(), Error>>,
}

/// An instruction in a frame of its own, and the channel of its reply.
#[derive(Debug)]
pub struct PendingInstruction {
    command: Command,
    reply: Reply<Result<Answer, Error>>,
}

/// The service of the task: submits instructions, and returns outcomes to their callers.
#[derive(Debug, Default)]
pub struct Instructions {
    singles: VecDeque<PendingInstruction>,
    /// The first one is being sent.
    runs: VecDeque<Run>,
    /// The submitted instructions without an outcome; `None` is an instruction of the run.
    submitted: VecDeque<Option<PendingInstruction>>,
}

impl Instructions {
    /// Submits the instructions that fit.
    fn fill(&mut self, session: &mut Host) {
        while self.fill_with_single(session) || self.fill_with_run(session) {}
    }

    /// Returns whether there is more to send.
    fn fill_with_single(&mut self, session: &mut Host) -> bool {
        let Some(single) = self.singles.pop_front() else { return false };
        if single.reply.is_abandoned() {
            return true;
        }
        match single.command.submit(session) {
            Ok(_) => self.submitted.push_back(Some(single)),
            Err(SessionError::Full) => {
                self.singles.push_front(single);
                return false;
            }
            Err(error) => drop(single.reply.send(Err(Error::Unfit { index: 0, error }))),
        }
        true
    }

    fn fill_with_run(&mut self, session: &mut Host) -> bool {
        // A query that waits for a frame of its own goes first.
        let (true, Some(run)) = (self.singles.is_empty(), self.runs.front_mut()) else { return false };
        if run.reply.is_abandoned() {
            run.commands.truncate(run.next);
        }
        match run.commands.get(run.next).map(|command| command.submit(session)) {
            None if run.taken < run.next => return false,
            None => self.end_run(Ok(())),
            Some(Ok(_)) => {
                run.next += 1;
                self.submitted.push_back(None);
            }
            Some(Err(SessionError::Full)) => return false,
            Some(Err(error)) => {
                run.unfit = Some(Error::Unfit { index: run.next, error });
                run.commands.truncate(run.next);
            }
        }
        true
    }

    /// Ends the first run with its outcome. If the run is no longer awaited, its events report the outcome.
    fn end_run(&mut self, outcome: Result<(), Error>) {
        if let Some(Run { reply, unfit, .. }) = self.runs.pop_front() {
            let _ = reply.send(unfit.map_or(outcome, Err));
        }
    }

    /// Fails the first run; the runs after it are not sent.
    fn end_runs(&mut self, error: Error) {
        self.end_run(Err(error));
        while !self.runs.is_empty() {
            self.end_run(Err(Error::NotSent));
        }
    }

    /// Called when `count` instructions of one frame have an outcome.
    fn taken(&mut self, session: &mut Host, count: u8, answer: &[u8]) {
        for _ in 0..count {
            match self.submitted.pop_front().flatten() {
                Some(PendingInstruction { reply, .. }) => {
                    let (bytes, profile) = (answer.to_vec(), session.config().profile);
                    let _ = reply.send(Ok(Answer { bytes, profile }));
                }
                None => {
                    if let Some(run) = self.runs.front_mut() {
                        run.taken += 1;
                    }
                }
            }
        }
        self.fill(session);
    }

    /// Called when a frame of `count` instructions was not queued, or its outcome is unknown.
    fn failed(&mut self, session: &mut Host, count: u8, error: impl FnOnce(usize) -> Error) {
        let mut is_of_run = false;
        let mut single = None;
        for _ in 0..count {
            match self.submitted.pop_front().flatten() {
                Some(failed) => single = Some(failed),
                None => is_of_run = true,
            }
        }
        let taken = self.runs.front().map_or(0, |run| if is_of_run { run.taken } else { 0 });
        let error = error(taken);
        if let Some(PendingInstruction { reply, .. }) = single {
            let _ = reply.send(Err(error));
        } else {
            for _ in 0..session.take_back() {
                // Of the run nothing more is sent; a query is.
                self.singles.extend(self.submitted.pop_back().flatten());
            }
            self.end_runs(error);
        }
        session.resume();
        self.fill(session);
    }
}

impl Service for Instructions {
    type Session = Host;
    type Call = Call;
    type Event = HostEvent;

    fn call(&mut self, session: &mut Host, _now: Duration, call: Call) {
        match call {
            Call::Run(run) => self.runs.push_back(run),
            Call::Single(single) => self.singles.push_back(single),
        }
        self.fill(session);
    }

    fn event(&mut self, session: &mut Host, event: HostEvent, reports: &mut Reports<'_, HostEvent>) {
        match event {
            HostEvent::Done { count, .. } => self.taken(session, count, &[]),
            HostEvent::Answer { .. } => {
                let answer = session.answer().as_bytes().to_vec();
                self.taken(session, 1, &answer);
            }
            HostEvent::Refused { count, refusal, .. } => {
                self.failed(session, count, |taken| Error::Refused { taken, refusal });
            }
            HostEvent::Unknown { count, reason, .. } => {
                let of = usize::from(count);
                self.failed(session, count, |taken| Error::Unknown { taken, count: of, reason });
            }
            _ => {}
        }
        reports.event(event);
    }

    fn give_up(&mut self, session: &mut Host, why: &Arc<io::Error>, _: &mut Reports<'_, HostEvent>) {
        // All sent instructions have an outcome, since their connection was lost.
        session.take_back();
        self.singles.extend(self.submitted.drain(..).flatten());
        for single in core::mem::take(&mut self.singles) {
            self.refuse(Call::Single(single), why);
        }
        if let Some(Run { taken: taken @ 1.., .. }) = self.runs.front() {
            let taken = *taken;
            self.end_runs(Error::Unknown { taken, count: 0, reason: UnknownReason::Disconnected });
        }
        for run in core::mem::take(&mut self.runs) {
            self.refuse(Call::Run(run), why);
        }
    }

    fn refuse(&mut self, call: Call, why: &Arc<io::Error>) {
        let error = Error::NotConnected(Arc::clone(why));
        match call {
            Call::Run(Run { reply, .. }) => drop(reply.send(Err(error))),
            Call::Single(PendingInstruction { reply, .. }) => drop(reply.send(Err(error))),
        }
    }
}
