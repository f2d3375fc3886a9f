use core::time::Duration;

use robot_session::end::{Core, CoreOf, End, EventQueue, QueueSpace};
use robot_session::{Decoder as _, Unexpected};

use super::config::PcConfig;
use super::event::PcEvent;
use super::source::{JobSource, Supply};
use super::state::{
    Action, Answer, CommandOutcome, Commands, Input, Machine, Outcome, Reaction, Rejection, Report,
    SentAnswer, UnsentJobs,
};
#[cfg(feature = "tokio")]
use super::state::{Order, Start};
use crate::content::{FromRobot, Status};
use crate::decoder::Decoder;
use crate::error::{ConfigError, EncodeError, MessageError, SessionError};
use crate::job::{self, Job, Work};
use crate::message::Message;
use crate::numbering::Numbering;
use crate::packet::{AddResult as PacketRoom, Packet};
use crate::params::Params;
use crate::phase::Phase;
use crate::role::{Field, Role};
use crate::statistics::PcStatistics;

/// The session of a PC: it listens, and sends only when the robot waits for an answer. Drive it as
/// [`Session`](robot_session::Session) describes, each packet in one write: call
/// [`handle_connected`](robot_session::Session::handle_connected) when a connection was accepted,
/// [`handle_disconnected`](robot_session::Session::handle_disconnected) when it has ended. The order continues on the next
/// one.
///
/// Nothing is sent unless the robot has sent something first: it cannot flush unexpected bytes (thesis, section 10.4). All
/// bytes that have come are read before they are answered, and the answer is made from the state at that time: no part of an
/// earlier answer is left to be sent twice (thesis, sections 11.3 and 12.2). It contains the messages for which a reply is
/// defined, or filler.
///
/// **Corrupt bytes** cost the message that they touch and are reported as an event; the bytes always advance. All bytes of an
/// input are taken. **Events** that are not polled: see [`PcEvent`].
///
/// **Orders** may have a number that was used before, even at once (except over UDP: give every order a new number there).
/// An order that is active in the robot when it connects belongs to another session unless this one has sent its start,
/// regardless of its number.
///
/// The session can hold a message of `MESSAGE` bytes. A table that needs more is a [`ConfigError`]:
/// `Pc::<_, 512>::with_ranges`, or a [`LargePc`].
#[derive(Debug)]
pub struct Pc<S: JobSource, const MESSAGE: usize = 256> {
    core: CoreOf<Self>,
    ranges: Ranges<S>,
    source: Option<S>,
    /// The commands that have no outcome yet, oldest first.
    commands: [(u8, i32); Commands::MAX as usize],
}

/// A [`Pc`] for messages of every length: [`LargePc::with_ranges`](Pc::with_ranges).
pub type LargePc<S> = Pc<S, { Message::MAX_LEN }>;

type Ranges<S> = <<S as JobSource>::Work as Work>::Ranges;

/// The outcomes of an order, one of them a job that does not fit, and of all commands.
const OUTCOMES: usize = 2 + Commands::MAX as usize;

impl<S: JobSource> Pc<S> {
    /// Creates a session that listens, without an order. The ranges of a job's fields are the defaults.
    ///
    /// # Errors
    /// If the configuration cannot work.
    pub fn new(config: PcConfig) -> Result<Self, ConfigError> {
        Self::with_ranges(config, Ranges::<S>::default())
    }
}

impl<S: JobSource, const MESSAGE: usize> Pc<S, MESSAGE> {
    /// Creates a session as [`new`](Pc::new) does, of the size of its type, with other ranges of a job's fields: those of
    /// the robot.
    ///
    /// # Errors
    /// If a range is empty, a job with the longest values does not fit a packet or the session, or the configuration cannot work.
    pub fn with_ranges(config: PcConfig, ranges: Ranges<S>) -> Result<Self, ConfigError> {
        config.check(job::check::<S::Work>(&ranges)?, MESSAGE)?;
        Ok(Self {
            core: Core::new(config, Machine::default(), Decoder::sized(config.dialect.charset())),
            ranges,
            source: None,
            commands: [(0, 0); Commands::MAX as usize],
        })
    }

    /// Begins an order. The robot receives it in its next cycle; it need not be connected yet.
    ///
    /// # Errors
    /// If there is an order already, `order` is 0, or the event queue is full.
    pub fn start(&mut self, order: u16, source: S) -> Result<(), SessionError> {
        if order == 0 {
            return Err(SessionError::OrderZero);
        }
        if !self.core.events.has_room(OUTCOMES) {
            return Err(SessionError::TooManyEvents);
        }
        let active = self.core.machine.order.number();
        self.ask(Duration::ZERO, Input::Start { order }).map_err(|_| SessionError::OrderActive { active })?;
        self.source = Some(source);
        Ok(())
    }

    /// Continues an order that an earlier PC has begun: a process that was killed, and had stored the progress. The robot
    /// receives nothing twice, whether it is still in the order, has ended it, or was restarted meanwhile
    /// ([`PcEvent::OutcomeUnknown`]).
    ///
    /// Of the jobs, the first `executed` are known to be executed, and those in `ahead`, counted from 0, ahead of others;
    /// these count only if jobs are acknowledged individually ([`PcConfig::cumulative_acks`]). The jobs from `sent` on were
    /// not sent: this number must be stored safely **before** the packet is sent. [`sent`](Self::sent) returns it when
    /// [`poll_transmit`](robot_session::Session::poll_transmit) has returned. The source must return the same jobs at the
    /// same indices, and the highest job number must be the same.
    ///
    /// # Errors
    /// If there is an order already, `order` is 0, the event queue is full, the source has fewer jobs than were sent, or
    /// more jobs are in flight than numbers can distinguish.
    pub fn resume(
        &mut self,
        order: u16,
        mut source: S,
        executed: u32,
        sent: u32,
        ahead: impl IntoIterator<Item = u32>,
    ) -> Result<(), SessionError> {
        if order == 0 {
            return Err(SessionError::OrderZero);
        }
        if !self.core.events.has_room(OUTCOMES) {
            return Err(SessionError::TooManyEvents);
        }
        let error = match self.core.machine.order.number() {
            0 => SessionError::NotInFlight { executed, sent },
            active => SessionError::OrderActive { active },
        };
        // The robot may report the end before it requests a job.
        let total = matches!(source.job(sent), Supply::End).then_some(sent);
        let before = self.core.machine.clone();
        self.ask(Duration::ZERO, Input::Resume { order, executed, sent, total }).map_err(|_| error)?;
        if sent.checked_sub(1).is_some_and(|last| matches!(source.job(last), Supply::End)) {
            // The order would be complete at the end of a different list.
            self.core.machine = before;
            return Err(SessionError::FewerJobs { sent });
        }
        for index in ahead {
            let _always = self.ask(Duration::ZERO, Input::Ahead { index });
        }
        self.source = Some(source);
        Ok(())
    }

    /// Ends the order when the jobs that the robot has queued are executed.
    ///
    /// # Errors
    /// If no order is active.
    pub fn end(&mut self) -> Result<(), SessionError> {
        self.ask(Duration::ZERO, Input::End).map_err(|_| SessionError::NoOrder)
    }

    /// Ends the order when the job that is being executed is done. It cannot continue after that (thesis, section 11.1).
    ///
    /// # Errors
    /// If there is no order, or if the dialect lacks the message.
    pub fn interrupt(&mut self) -> Result<(), SessionError> {
        let role = Role::OrderInterrupt;
        if self.core.config.dialect.entry(role).is_none() {
            return Err(SessionError::Lacks { role });
        }
        self.ask(Duration::ZERO, Input::Interrupt).map_err(|_| SessionError::NoOrder)
    }

    /// Sends a command that bypasses the queue, once, with the next answer: no reply is defined for it. Its outcome is
    /// [`PcEvent::Command`].
    ///
    /// # Errors
    /// If the dialect has no such command, or too many wait.
    pub fn command(&mut self, id: u8, value: i32) -> Result<(), SessionError> {
        if self.core.config.dialect.entry(Role::Command(id)).is_none() {
            return Err(SessionError::UnknownCommand { id });
        }
        let Commands { in_flight, waiting } = self.core.machine.commands;
        let place = usize::from(in_flight + waiting);
        let too_many = SessionError::TooManyCommands { waiting: place };
        if !self.core.events.has_room(OUTCOMES) {
            return Err(too_many);
        }
        self.ask(Duration::ZERO, Input::Command).map_err(|_| too_many)?;
        if let Some(command) = self.commands.get_mut(place) {
            *command = (id, value);
        }
        Ok(())
    }

    /// Discards order and commands, as a restart of the program does. Returns whether the robot may have received the order:
    /// it is to be [resumed](Self::resume) then. Call it without a connection.
    #[cfg(feature = "tokio")]
    pub(crate) fn forget(&mut self) -> bool {
        let is_unsent = matches!(
            self.core.machine.order,
            Order::Idle | Order::Starting { start: Start::Unsent | Start::Foreign { .. }, .. }
        );
        self.core.machine = Machine::default();
        self.source = None;
        !is_unsent
    }

    /// Returns whether a job of the order, or of the last one, counted from 0, is known to be executed.
    pub fn is_executed(&self, index: u32) -> bool {
        let count = &self.core.machine.count;
        index < count.executed || index < count.sent && count.ahead.contains(index - count.executed)
    }

    /// Returns the phase of the order.
    pub const fn phase(&self) -> Phase {
        self.core.machine.phase()
    }

    /// Returns this session's order, if any.
    pub fn order(&self) -> Option<u16> {
        let number = self.core.machine.order.number();
        (number != 0).then_some(number)
    }

    /// Returns the count up to which the jobs of the order, or of the last one, are executed.
    pub const fn executed(&self) -> u32 {
        self.core.machine.count.executed
    }

    /// Returns the number of jobs of the order, or of the last one, that the robot has queued, as far as it has reported.
    pub const fn queued(&self) -> u32 {
        self.core.machine.count.queued
    }

    /// Returns the number of jobs of the order, or of the last one, that were ever sent.
    pub const fn sent(&self) -> u32 {
        self.core.machine.count.sent
    }

    /// Reports the outcome of the first commands.
    fn commands_end(&mut self, count: u8, outcome: CommandOutcome) {
        for (id, value) in self.commands.into_iter().take(count.into()) {
            self.core.push_outcome(PcEvent::Command { id, value, outcome });
        }
        self.commands.rotate_left(count.into());
    }

    /// Writes as many of these jobs as fit.
    fn write_jobs(
        &mut self,
        order: u16,
        (from, until): (u32, u32),
        packet: &mut Packet<'_>,
        sent: &mut SentAnswer,
    ) {
        let numbering = self.core.config.numbering();
        let Some(source) = &mut self.source else { return };
        for index in from..until {
            let work = match source.job(index) {
                Supply::Job(work) => work,
                Supply::Later => return,
                Supply::End => return sent.rest = UnsentJobs::End,
            };
            let job = Job { order, number: numbering.next(index), work };
            match packet.push_job(&job, &self.ranges) {
                Ok(PacketRoom::Added) => sent.jobs += 1,
                Err(EncodeError::Field(error)) => {
                    sent.rest = UnsentJobs::Unfit;
                    return self.core.push_outcome(PcEvent::JobUnfit { order, index, error });
                }
                Ok(PacketRoom::Full) | Err(_) => return,
            }
        }
    }
}

#[cold]
fn rejected(
    numbering: Numbering,
    machine: &Machine,
    why: Rejection,
    role: Role,
    params: &Params,
) -> MessageError {
    match why {
        Rejection::WrongOrder => {
            MessageError::WrongOrder { active: machine.order.number(), found: params.or_zero(Field::Order) }
        }
        Rejection::OutOfOrder => {
            let field = if role == Role::JobAck || role == Role::JobRequest {
                Field::Number
            } else {
                Field::Executed
            };
            let known = if role == Role::JobRequest { machine.count.sent } else { machine.count.executed };
            let found = params.or_zero(field);
            MessageError::OutOfOrder { expected: numbering.next(known), found }
        }
        Rejection::NotExpected => MessageError::NotExpected { role },
    }
}

impl<S: JobSource, const MESSAGE: usize> End for Pc<S, MESSAGE> {
    type Machine = Machine;
    type Decoder = Decoder<MESSAGE>;
    type Events = EventQueue<PcEvent, 32>;
    type Statistics = PcStatistics;
    /// The message, or the reason that it cannot be used.
    type Payload = Result<(Role, Params), MessageError>;

    const LINK: &'static str = "kawasaki-msg";
    const END: &'static str = "pc";
    /// Longer than any message, so that a datagram that is too long is noticed.
    const MAX_INPUT: usize = 2 * Message::MAX_LEN;
    const MAX_TRANSMIT: usize = Message::MAX_LEN;
    const QUEUE_SPACE: QueueSpace = QueueSpace::NONE;

    robot_session::core!(PcEvent::Unexpected);

    fn discards_after(&self) -> Option<Duration> {
        Some(self.core.config.silence)
    }

    fn begin_input(&mut self, _now: Duration) -> bool {
        let is_connected = self.core.machine.is_connected();
        if !is_connected {
            self.refuse(Unexpected { state: "not connected", input: "bytes" });
        }
        is_connected
    }

    fn end_input(&mut self, now: Duration) {
        if self.core.config.datagrams {
            // A message does not continue after the end of a datagram.
            self.finish(now);
        }
        let whole = !self.core.decoder.is_inside_message();
        self.advance(now, Input::ReadEnd { whole }, None);
    }

    fn next_input(&mut self) -> Option<(Input, Option<Self::Payload>)> {
        match self.core.decoder.next_frame()? {
            Ok(message) => {
                let mut message = self.core.config.dialect.read(&message);
                let report = match &mut message {
                    Ok((role, params)) => {
                        self.core.config.dialect.complete(*role, params, self.core.machine.order.number());
                        FromRobot::read(*role, params)
                    }
                    Err(_) => FromRobot::Unusable,
                };
                Some((Input::Message(report), Some(message)))
            }
            Err(error) => {
                self.core.statistics.corrupt += 1;
                self.core.events.push_notice(PcEvent::Corrupt(error));
                Some((Input::Corrupt, None))
            }
        }
    }

    fn act(&mut self, _now: Duration, reaction: Reaction, message: Option<Self::Payload>) {
        let Reaction { commands: (count, outcome), action } = reaction;
        self.commands_end(count, outcome);
        let message = message.and_then(|message| {
            message.map_err(|error| self.core.events.push_notice(PcEvent::Rejected(error))).ok()
        });
        let order = self.core.machine.order.number();
        if let Some((Role::Status, params)) = &message {
            let Status { order, phase, queued, executed, .. } = Status::read(params);
            self.core.events.push_notice(PcEvent::PeerStatus { order, phase, queued, executed });
        }
        match action {
            Action::Nothing => {}
            Action::Rejected(why) => {
                let Some((role, params)) = message else { return };
                let error = rejected(self.core.config.numbering(), &self.core.machine, why, role, &params);
                self.core.events.push_notice(PcEvent::Rejected(error));
            }
            Action::Started => self.core.events.push_notice(PcEvent::OrderStarted { order }),
            Action::Refused { active } => {
                self.core.events.push_notice(PcEvent::OrderRefused { order, active, given_up: false });
            }
            Action::Paused => {
                let queued = self.core.machine.count.queued;
                self.core.events.push_notice(PcEvent::Paused { queued });
            }
            Action::ExecutedAhead { index } => {
                self.core.events.push_notice(PcEvent::ExecutedAhead { index });
            }
            Action::Sent => self.core.statistics.packets += 1,
            Action::Outcome { order, outcome } => {
                self.source = None;
                self.core.push_outcome(match outcome {
                    Outcome::Over { executed, complete } => PcEvent::OrderOver { order, executed, complete },
                    Outcome::Unknown { executed, sent } => PcEvent::OutcomeUnknown { order, executed, sent },
                    Outcome::GivenUp { active } => PcEvent::OrderRefused { order, active, given_up: true },
                });
            }
        }
    }

    /// Returns a buffer shorter than [`Limits::packet`](crate::Limits) is too small.
    fn write(&mut self, _now: Duration, mut answer: Answer, out: &mut [u8]) -> Option<(usize, Input)> {
        let out = out.get_mut(..self.core.config.limits.packet)?;
        let mut sent = SentAnswer::default();
        if let (Some(index), Some(source)) = (answer.last, &mut self.source)
            && matches!(source.job(index), Supply::End)
        {
            (answer, sent.rest) = (answer.at_end(), UnsentJobs::End);
        }
        let mut packet = Packet::new(out, self.core.config.limits, self.core.config.dialect);
        if let Some(status) = answer.status {
            let _ = packet.push(Role::Status, &status.write());
        }
        if let Some(request) = answer.request {
            let (role, params) = request.write();
            sent.request = packet.push(role, &params) == Ok(PacketRoom::Added);
        }
        let in_flight = self.core.machine.commands.in_flight;
        let waiting = self.commands.into_iter().skip(in_flight.into()).take(answer.commands.into());
        for (id, value) in waiting {
            let mut params = Params::default().with(Field::Order, answer.order);
            params.set(Field::Value, value);
            if packet.push(Role::Command(id), &params) != Ok(PacketRoom::Added) {
                break;
            }
            sent.commands += 1;
        }
        if let Some(jobs) = answer.jobs {
            self.write_jobs(answer.order, jobs, &mut packet, &mut sent);
        }
        if packet.is_empty() {
            let _ = packet.push(Role::Filler, &Params::default());
        }
        Some((packet.as_bytes().len(), Input::Sent(sent)))
    }

    fn next_event(&mut self) -> Option<PcEvent> {
        self.core.events.pop().or_else(|| {
            let event = match self.core.machine.report()? {
                Report::Disconnect => PcEvent::Disconnect,
                Report::Progress => PcEvent::Progress { executed: self.executed(), queued: self.queued() },
            };
            self.advance(Duration::ZERO, Input::Reported, None);
            Some(event)
        })
    }
}
