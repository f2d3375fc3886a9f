use core::time::Duration;

use robot_session::{Decoder as _, EventQueue, Session, Unexpected};

use super::config::PcConfig;
use super::event::PcEvent;
use super::packet::PacketAnswer;
use super::source::JobSource;
use super::state::{Action, CommandOutcome, Commands, Input, Machine, Outcome, Rejection, Report};
use crate::content::{FromRobot, phase};
use crate::decoder::Decoder;
use crate::dialect::Params;
use crate::error::{ConfigError, MessageError, SessionError};
use crate::job::{self, Work};
use crate::message::Message;
use crate::numbering::ALL_NUMBERS;
use crate::packet::Packet;
use crate::phase::Phase;
use crate::role::{Field, Role};
use crate::statistics::PcStatistics;

/// The session of a PC: it listens, and sends only what the robot waits for. Drive it as [`Session`] describes, each packet in
/// one write: a connection that was accepted is [`handle_connected`](Session::handle_connected), its end
/// [`handle_disconnected`](Session::handle_disconnected). The order goes on with the next one.
///
/// Nothing is sent unless the robot has sent something first: it cannot flush what it does not expect (thesis, section 10.4).
/// The whole of what has come is read before it is answered, and the answer is made from the state of then: nothing of an earlier
/// answer is left to be sent twice (thesis, sections 11.3 and 12.2). It holds the messages for which a reply is defined, or
/// filler.
///
/// **Corrupt bytes** cost the message that they touch and are reported as an event; the bytes always advance. All bytes of an
/// input are taken. **Events** that nobody polls: see [`PcEvent`].
///
/// **Orders** may have a number that was used before, also at once (over UDP not: give every order a new number there). An order
/// that the robot is in when it connects is not ours unless we have sent its start, whatever its number is.
///
/// It can hold a message of `MESSAGE` bytes, and tell job numbers below 64 for each of its `WORDS` apart where jobs may overtake one
/// another ([`PcConfig::cumulative_acks`]). What needs more is a [`ConfigError`]: `Pc::<_, 512>::sized`, or a [`LargePc`].
#[derive(Debug)]
pub struct Pc<'a, S: JobSource, const MESSAGE: usize = 256, const WORDS: usize = 16> {
    config: PcConfig<'a>,
    ranges: Ranges<S>,
    machine: Machine<WORDS>,
    decoder: Decoder<MESSAGE>,
    source: Option<S>,
    /// The commands that have no outcome yet, oldest first.
    commands: [(u8, i32); Commands::MAX as usize],
    events: Events,
    statistics: PcStatistics,
}

/// A [`Pc`] for messages of every length and all job numbers: [`LargePc::sized`](Pc::sized).
pub type LargePc<'a, S> = Pc<'a, S, { Message::MAX_LEN }, ALL_NUMBERS>;

type Events = EventQueue<PcEvent, 32>;

type Ranges<S> = <<S as JobSource>::Work as Work>::Ranges;

/// The outcomes of an order, one of them a job that does not fit, and of all commands.
const OUTCOMES: usize = 2 + Commands::MAX as usize;

impl<'a, S: JobSource> Pc<'a, S> {
    /// A session without an order that listens. The ranges of a job's fields are the default ones.
    ///
    /// # Errors
    /// When the configuration cannot work.
    pub fn new(config: PcConfig<'a>) -> Result<Self, ConfigError> {
        Self::sized(config)
    }
}

impl<'a, S: JobSource, const MESSAGE: usize, const WORDS: usize> Pc<'a, S, MESSAGE, WORDS> {
    /// As [`new`](Pc::new), of the size that its type says.
    ///
    /// # Errors
    /// When the configuration cannot work, or needs more.
    pub fn sized(config: PcConfig<'a>) -> Result<Self, ConfigError> {
        let ranges = Ranges::<S>::default();
        config.check::<MESSAGE, WORDS>(job::check::<S::Work>(&ranges)?)?;
        Ok(Self {
            config,
            ranges,
            machine: Machine::new(),
            decoder: Decoder::sized(config.dialect.charset()),
            source: None,
            commands: [(0, 0); Commands::MAX as usize],
            events: EventQueue::new(),
            statistics: PcStatistics::default(),
        })
    }

    /// The same session with other ranges of a job's fields: those of the robot.
    ///
    /// # Errors
    /// When a range is empty, or a job with the longest values does not fit a packet or the session.
    pub fn with_ranges(self, ranges: Ranges<S>) -> Result<Self, ConfigError> {
        self.config.check::<MESSAGE, WORDS>(job::check::<S::Work>(&ranges)?)?;
        Ok(Self { ranges, ..self })
    }

    /// Begins an order. The robot receives it in its next cycle, also when it is not connected yet.
    ///
    /// # Errors
    /// When there is an order already, `order` is 0, or too many events wait.
    pub fn start(&mut self, order: u16, source: S) -> Result<(), SessionError> {
        if order == 0 {
            return Err(SessionError::OrderZero);
        }
        if !self.events.has_room(OUTCOMES) {
            return Err(SessionError::TooManyEvents);
        }
        let active = self.machine.order.number();
        self.request(Input::Start { order }).map_err(|_| SessionError::OrderActive { active })?;
        self.source = Some(source);
        Ok(())
    }

    /// Goes on with an order that an earlier PC has begun: a process that was killed, and that had kept how far it was. The robot
    /// receives nothing twice, whether it is still in the order, has ended it, or was restarted meanwhile
    /// ([`PcEvent::OutcomeUnknown`]).
    ///
    /// Of the jobs, the first `executed` are known to be executed, and those in `ahead`, counted from 0, ahead of others; these only
    /// count where each job is acknowledged by itself ([`PcConfig::cumulative_acks`]). From
    /// `sent` on none was sent: this number has to be kept safely **before** the packet is sent. [`sent`](Self::sent) has it when
    /// [`poll_transmit`](Session::poll_transmit) returns. The source has to give the same jobs at the same places, and the
    /// highest job number has to be the same.
    ///
    /// # Errors
    /// When there is an order already, `order` is 0, too many events wait, or more jobs are in flight than numbers can tell apart.
    pub fn resume(
        &mut self,
        order: u16,
        source: S,
        executed: u32,
        sent: u32,
        ahead: impl IntoIterator<Item = u32>,
    ) -> Result<(), SessionError> {
        if order == 0 {
            return Err(SessionError::OrderZero);
        }
        if !self.events.has_room(OUTCOMES) {
            return Err(SessionError::TooManyEvents);
        }
        let error = match self.machine.order.number() {
            0 => SessionError::NotInFlight { executed, sent },
            active => SessionError::OrderActive { active },
        };
        self.request(Input::Resume { order, executed, sent }).map_err(|_| error)?;
        let each = !self.config.cumulative_acks;
        for index in ahead.into_iter().filter(|index| each && (executed..sent).contains(index)) {
            self.machine.count.ahead.insert(self.config.numbering().next(index));
        }
        self.source = Some(source);
        Ok(())
    }

    /// Ends the order when the jobs that the robot has queued are executed.
    ///
    /// # Errors
    /// When no order is active.
    pub fn end(&mut self) -> Result<(), SessionError> {
        self.request(Input::End).map_err(|_| SessionError::NoOrder)
    }

    /// Ends the order when the job that is being executed is done. It cannot go on after that (thesis, section 11.1).
    ///
    /// # Errors
    /// When there is no order, or the dialect has no such message.
    pub fn interrupt(&mut self) -> Result<(), SessionError> {
        let role = Role::OrderInterrupt;
        if self.config.dialect.entry(role).is_none() {
            return Err(SessionError::Lacks { role });
        }
        self.request(Input::Interrupt).map_err(|_| SessionError::NoOrder)
    }

    /// Sends a command past the queue with the next answer, once: no reply is defined for it. What became of it is
    /// [`PcEvent::Command`].
    ///
    /// # Errors
    /// When the dialect has no such command, or too many wait.
    pub fn command(&mut self, id: u8, value: i32) -> Result<(), SessionError> {
        if self.config.dialect.entry(Role::Command(id)).is_none() {
            return Err(SessionError::UnknownCommand { id });
        }
        let Commands { in_flight, waiting } = self.machine.commands;
        let place = usize::from(in_flight + waiting);
        let too_many = SessionError::TooManyCommands { waiting: place };
        if !self.events.has_room(OUTCOMES) {
            return Err(too_many);
        }
        self.request(Input::Command).map_err(|_| too_many)?;
        if let Some(command) = self.commands.get_mut(place) {
            *command = (id, value);
        }
        Ok(())
    }

    /// Whether a job of the order, or of the last one, counted from 0, is known to be executed.
    pub fn is_executed(&self, index: u32) -> bool {
        let count = &self.machine.count;
        index < count.executed
            || index < count.sent && count.ahead.contains(self.config.numbering().next(index))
    }

    /// Everything that decides what the session does next.
    pub const fn machine(&self) -> &Machine<WORDS> {
        &self.machine
    }

    /// How far the order is.
    pub const fn phase(&self) -> Phase {
        self.machine.phase()
    }

    /// The order of ours; `None` when there is none.
    pub fn order(&self) -> Option<u16> {
        let number = self.machine.order.number();
        (number != 0).then_some(number)
    }

    /// Up to which count the jobs of the order, or of the last one, are executed.
    pub const fn executed(&self) -> u32 {
        self.machine.count.executed
    }

    /// How many jobs of the order, or of the last one, the robot has queued, as far as it has reported.
    pub const fn queued(&self) -> u32 {
        self.machine.count.queued
    }

    /// How many jobs of the order, or of the last one, were ever sent.
    pub const fn sent(&self) -> u32 {
        self.machine.count.sent
    }

    /// A request of the caller.
    fn request(&mut self, input: Input) -> Result<(), Unexpected> {
        let order = self.machine.order.number();
        let action = self.machine.on(Duration::ZERO, input, &self.config)?;
        self.act(order, action);
        Ok(())
    }

    fn input(&mut self, now: Duration, input: Input) {
        let order = self.machine.order.number();
        match self.machine.on(now, input, &self.config) {
            Ok(action) => self.act(order, action),
            Err(unexpected) => self.unexpected(unexpected),
        }
    }

    #[cold]
    fn unexpected(&mut self, Unexpected { state, input }: Unexpected) {
        self.statistics.unexpected += 1;
        self.events.push_notice(PcEvent::Unexpected { state, input });
    }

    /// Everything that the decoder has.
    fn read(&mut self, now: Duration) {
        loop {
            let order = self.machine.order.number();
            let action = match self.decoder.next_frame() {
                None => break,
                Some(Ok(message)) => {
                    let (machine, events) = (&mut self.machine, &mut self.events);
                    Self::on_message(&self.config, machine, events, &mut self.commands, now, &message)
                }
                Some(Err(error)) => {
                    self.statistics.corrupt += 1;
                    self.events.push_notice(PcEvent::Corrupt(error));
                    self.machine.on(now, Input::Corrupt, &self.config)
                }
            };
            match action {
                Ok(action) => self.act(order, action),
                Err(unexpected) => self.unexpected(unexpected),
            }
        }
    }

    /// Does what the machine asks for; `order` is the one that was active before.
    fn act(&mut self, order: u16, action: Action) {
        match action {
            // What is rejected is reported where the message is known.
            Action::Nothing | Action::Rejected(_) => {}
            Action::Started => self.events.push_notice(PcEvent::OrderStarted { order }),
            Action::Refused { active } => {
                self.events.push_notice(PcEvent::OrderRefused { order, active, given_up: false });
            }
            Action::Paused => {
                self.events.push_notice(PcEvent::Paused { queued: self.machine.count.queued });
            }
            Action::ExecutedAhead { index } => self.events.push_notice(PcEvent::ExecutedAhead { index }),
            Action::Commands { count, outcome } => {
                commands_end(&mut self.commands, &mut self.events, count, outcome);
            }
            Action::Outcome(outcome) => {
                self.source = None;
                push(
                    &mut self.events,
                    match outcome {
                        Outcome::Over { executed, complete } => {
                            PcEvent::OrderOver { order, executed, complete }
                        }
                        Outcome::Unknown { executed, sent } => {
                            PcEvent::OutcomeUnknown { order, executed, sent }
                        }
                        Outcome::GivenUp { active } => {
                            PcEvent::OrderRefused { order, active, given_up: true }
                        }
                    },
                );
            }
        }
    }
}

impl<S: JobSource, const MESSAGE: usize, const WORDS: usize> Pc<'_, S, MESSAGE, WORDS> {
    /// What the machine is to do with a message; why it is not used is for the event.
    fn on_message(
        config: &PcConfig<'_>,
        machine: &mut Machine<WORDS>,
        events: &mut Events,
        commands: &mut [(u8, i32)],
        now: Duration,
        message: &Message<'_>,
    ) -> Result<Action, Unexpected> {
        if let Action::Commands { count, outcome } = machine.on(now, Input::Received, config)? {
            commands_end(commands, events, count, outcome);
        }
        let (role, params) = match config.dialect.read(message) {
            Ok((role, params)) => (role, config.dialect.complete(role, params, machine.order.number())),
            Err(error) => {
                events.push_notice(PcEvent::Rejected(error));
                return machine.on(now, Input::Message(FromRobot::Unusable), config);
            }
        };
        let action = machine.on(now, Input::Message(FromRobot::read(role, &params)), config)?;
        if role == Role::Status {
            let (queued, executed) = (params.number(Field::Queued), params.number(Field::Executed));
            let order = params.number(Field::Order).unwrap_or(0);
            events.push_notice(PcEvent::PeerStatus { order, phase: phase(&params), queued, executed });
        }
        if let Action::Rejected(why) = action {
            events.push_notice(PcEvent::Rejected(rejected(config, machine, why, role, &params)));
        }
        Ok(action)
    }
}

/// An outcome: what it is of was begun only with room for it.
fn push(events: &mut Events, outcome: PcEvent) {
    let pushed = events.push_outcome(outcome);
    debug_assert!(pushed.is_ok(), "begun only with room for its outcomes");
}

/// The first commands have an outcome.
fn commands_end(commands: &mut [(u8, i32)], events: &mut Events, count: u8, outcome: CommandOutcome) {
    let count = usize::from(count);
    for (id, value) in commands.iter().take(count).copied() {
        push(events, PcEvent::Command { id, value, outcome });
    }
    commands.rotate_left(count);
}

#[cold]
fn rejected<const WORDS: usize>(
    config: &PcConfig<'_>,
    machine: &Machine<WORDS>,
    why: Rejection,
    role: Role,
    params: &Params,
) -> MessageError {
    match why {
        Rejection::WrongOrder => MessageError::WrongOrder {
            active: machine.order.number(),
            found: params.number(Field::Order).unwrap_or(0),
        },
        Rejection::OutOfOrder => {
            let field = if role == Role::JobAck || role == Role::JobRequest {
                Field::Number
            } else {
                Field::Executed
            };
            let known = if role == Role::JobRequest { machine.count.sent } else { machine.count.executed };
            let found = params.number(field).unwrap_or(0);
            MessageError::OutOfOrder { expected: config.numbering().next(known), found }
        }
        Rejection::NotExpected => MessageError::NotExpected { role },
    }
}

impl<S: JobSource, const MESSAGE: usize, const WORDS: usize> Session for Pc<'_, S, MESSAGE, WORDS> {
    type Event = PcEvent;
    type Statistics = PcStatistics;

    const MAX_INPUT: usize = 65536;
    const MAX_TRANSMIT: usize = Message::MAX_LEN;

    fn handle_connected(&mut self, now: Duration) {
        self.decoder.clear();
        self.input(now, Input::Connected);
    }

    fn handle_disconnected(&mut self, now: Duration) {
        self.input(now, Input::Disconnected);
    }

    fn handle_input(&mut self, now: Duration, mut bytes: &[u8]) {
        if !self.machine.is_connected() {
            return self.unexpected(Unexpected { state: "not connected", input: "bytes" });
        }
        loop {
            bytes = self.decoder.take(bytes, self.config.datagrams);
            self.read(now);
            if bytes.is_empty() {
                break;
            }
        }
        let whole = !self.decoder.is_inside_message();
        self.input(now, Input::ReadEnd { whole });
    }

    fn handle_timeout(&mut self, now: Duration) {
        self.input(now, Input::Timeout);
    }

    fn poll_event(&mut self) -> Option<PcEvent> {
        self.events.pop().or_else(|| {
            Some(match self.machine.report()? {
                Report::Disconnect => PcEvent::Disconnect,
                Report::Progress => PcEvent::Progress { executed: self.executed(), queued: self.queued() },
            })
        })
    }

    /// A buffer shorter than [`Limits::packet`](crate::Limits) is too small.
    fn poll_transmit(&mut self, now: Duration, out: &mut [u8]) -> Option<usize> {
        let out = out.get_mut(..self.config.limits.packet)?;
        let mut packet = Packet::new(out, self.config.limits, self.config.dialect.charset());
        let Commands { in_flight, waiting } = self.machine.commands;
        let (first, last) = (usize::from(in_flight), usize::from(in_flight + waiting));
        let mut answer = PacketAnswer {
            packet: &mut packet,
            dialect: &self.config.dialect,
            source: &mut self.source,
            ranges: &self.ranges,
            unfit: None,
            commands: self.commands.get(first..last).unwrap_or_default(),
        };
        let sent = self.machine.transmit(now, &self.config, &mut answer);
        let unfit = answer.unfit;
        if sent && packet.is_empty() {
            // All that was to be sent is of roles that the table lacks.
            packet.write(&self.config.dialect, Role::Filler, &Params::default());
        }
        let length = packet.as_bytes().len();
        if let Some((index, error)) = unfit {
            let order = self.machine.order.number();
            push(&mut self.events, PcEvent::JobUnfit { order, index, error });
            // The jobs before it are executed; no later one is ever asked for.
            if let Err(unexpected) = self.request(Input::End) {
                self.unexpected(unexpected);
            }
        }
        self.statistics.packets += u64::from(sent);
        sent.then_some(length)
    }

    fn poll_timeout(&self) -> Option<Duration> {
        self.machine.deadline()
    }

    fn statistics(&self) -> PcStatistics {
        PcStatistics { dropped_notices: self.events.dropped_notices(), ..self.statistics }
    }
}
