//! The robot controller's end.

mod config;
mod input;
mod machine;
mod state;

pub use config::{ControllerConfig, ControllerEvent, ControllerRule, ControllerStatistics, Unselected};
pub use input::{ControllerActions, ControllerInput, Handling, Outgoing, StartOutcome, Taken};
pub use state::{Alter, ControllerMachine, ControllerPhase, Progress, Turn};

use core::time::Duration;

use robot_session::{Decoder as _, EventQueue, Session};

use crate::decoder::Decoder;
use crate::error::{ConfigError, DecodeError, SessionError};
use crate::frame::Frame;
use crate::message::{
    AXES, Accumulation, End, HostMessage, Message, Motion, Reply, RobotMessage, SegmentStatus, Start,
    Transform,
};

/// The controller's session: a MARK III without its arm. Its verbs are those of [`robot_session::Session`]; it never reads a
/// clock and never blocks. [`start`](Controller::start) executes the ALTER instruction.
///
/// The first good reply in the window of a message decides; what comes outside a window, or while the message is still on the
/// line, has no effect and is reported. A reply that cannot be read gives the error code of the next message, and the arm does
/// not move by it; a missing one ends ALTER with error 6. A session that is late itself sends the next message late: it never
/// sends two in one cycle. Of 16 events that nobody fetches, the oldest notice is dropped and counted; how a start goes,
/// exceptions and the end of ALTER are outcomes and are not.
#[derive(Debug, Clone)]
pub struct Controller {
    config: ControllerConfig,
    machine: ControllerMachine,
    decoder: Decoder<HostMessage>,
    events: EventQueue<ControllerEvent, 16>,
    statistics: ControllerStatistics,
    /// What the next standard messages say.
    segment: (SegmentStatus, u16, u16),
    transform: Transform,
    /// The words that the controller keeps, and what they did to the arm in the last cycle.
    words: [i16; AXES],
    applied: [i16; AXES],
}

/// The outcomes of an ALTER: started, an exception, ended.
const OUTCOMES: usize = 3;

impl Controller {
    /// A controller whose port is not open.
    ///
    /// # Errors
    /// [`ConfigError::Window`]: no reply fits the line; [`ConfigError::Attempts`].
    pub fn new(config: ControllerConfig) -> Result<Self, ConfigError> {
        config.check()?;
        Ok(Self {
            config,
            machine: ControllerMachine::NEW,
            decoder: Decoder::new(config.framing),
            events: EventQueue::new(),
            statistics: ControllerStatistics::default(),
            segment: (SegmentStatus::Normal, 1, 0),
            transform: Transform([0; 12]),
            words: [0; AXES],
            applied: [0; AXES],
        })
    }

    /// Executes the ALTER instruction: the first start message is due at `now`.
    ///
    /// # Errors
    /// [`SessionError::NotConnected`], [`SessionError::AlreadyStarted`], [`SessionError::EventsFull`]
    pub fn start(&mut self, now: Duration) -> Result<(), SessionError> {
        let has_room = self.events.has_room(OUTCOMES);
        self.request(now, ControllerInput::Start { has_room })
    }

    /// The program ends ALTER: the end message is sent with the next cycle.
    ///
    /// # Errors
    /// [`SessionError::NotRunning`]
    pub fn finish(&mut self, now: Duration) -> Result<(), SessionError> {
        self.request(now, ControllerInput::Finish)
    }

    /// The program runs a subroutine by itself, between two cycles: until [`resume`](Controller::resume) the replies move nothing.
    ///
    /// # Errors
    /// [`SessionError::NotRunning`]: also while a reply is awaited, because an exception in it would be lost.
    pub fn interrupt(&mut self, now: Duration) -> Result<(), SessionError> {
        self.request(now, ControllerInput::Interrupt)
    }

    /// The subroutine returns. At least one message says that it ran.
    ///
    /// # Errors
    /// [`SessionError::NotRunning`]
    pub fn resume(&mut self, now: Duration) -> Result<(), SessionError> {
        self.request(now, ControllerInput::Return)
    }

    /// Sets what the next messages say of the motion segment: its status, its number (from 1), and the part of it that is done
    /// ([`Motion::DONE`] is all).
    pub fn set_segment(&mut self, status: SegmentStatus, number: u16, percent: u16) {
        self.segment = (status, number, percent);
    }

    /// Sets where the next messages say that the tool is, if mode bit 2 asks for it. At first all words are zero.
    pub fn set_transform(&mut self, transform: Transform) {
        self.transform = transform;
    }

    /// The values that moved the arm in the last cycle (cumulative), or that hold it off the path (non-cumulative).
    pub fn values(&self) -> [i16; AXES] {
        self.applied
    }

    /// The machine: what the session is doing.
    pub fn machine(&self) -> &ControllerMachine {
        &self.machine
    }

    /// What the session is doing, in a word.
    pub fn state(&self) -> ControllerState {
        match &self.machine.phase {
            ControllerPhase::Disconnected => ControllerState::Disconnected,
            ControllerPhase::Off => ControllerState::Off,
            ControllerPhase::On(alter) => match alter.progress {
                Progress::Starting { .. } => ControllerState::Starting,
                Progress::Running => ControllerState::Running,
                Progress::Interrupted { .. } => ControllerState::Interrupted,
                Progress::Ending => ControllerState::Ending,
            },
        }
    }

    /// The configuration.
    pub fn config(&self) -> &ControllerConfig {
        &self.config
    }

    fn request(&mut self, now: Duration, input: ControllerInput) -> Result<(), SessionError> {
        self.on(now, input).refused.map_or(Ok(()), Err)
    }

    fn read(&mut self, now: Duration) {
        loop {
            let item = self.decoder.next_frame();
            // At once: what is corrupt before the window opens is no reply to the message.
            if let Some(error) = self.decoder.corruption() {
                self.on(now, ControllerInput::Corrupt(error.code()));
            }
            match item {
                None => return,
                Some(Ok(received)) => self.on_message(now, received.message),
                Some(Err(error @ DecodeError::StartMark { .. })) => {
                    self.on(now, ControllerInput::Corrupt(error.code()));
                }
                Some(Err(_)) => {}
            }
        }
    }

    fn on_message(&mut self, now: Duration, message: HostMessage) {
        let input = match &message {
            HostMessage::StartReply(code) => ControllerInput::StartReply(*code),
            HostMessage::Reply(Reply { exception, .. }) => {
                // The exception's, and that of the end.
                let has_room = self.events.has_room(2);
                ControllerInput::Reply { exception: *exception, has_room }
            }
        };
        let Ok(actions) = self.step(now, input) else { return };
        if actions.stray {
            self.statistics.strays += 1;
            self.events.push_notice(ControllerEvent::Stray(message));
        }
        if let (Some(taken), HostMessage::Reply(reply)) = (actions.taken, message) {
            self.statistics.replies += 1;
            match taken {
                Taken::Moves => self.take(&reply),
                Taken::Rests => self.rest(),
            }
            self.events.push_notice(ControllerEvent::Reply { reply, values: self.applied });
        }
        self.act(now, &actions);
    }

    /// Gives the machine an input and does what it says, but for sending and for taking a reply.
    fn on(&mut self, now: Duration, input: ControllerInput) -> ControllerActions {
        let actions = self.step(now, input).unwrap_or_default();
        self.act(now, &actions);
        actions
    }

    fn step(&mut self, now: Duration, input: ControllerInput) -> Result<ControllerActions, ()> {
        self.machine.on(now, input, &self.config).map_err(|unexpected| {
            self.statistics.unexpected += 1;
            self.events.push_notice(ControllerEvent::Unexpected(unexpected));
        })
    }

    fn act(&mut self, now: Duration, actions: &ControllerActions) {
        if actions.restart {
            (self.words, self.applied) = ([0; AXES], [0; AXES]);
        }
        if actions.end_frame || actions.close_window {
            self.decoder.finish();
            self.read(now);
        }
        if actions.close_window {
            self.on(now, ControllerInput::WindowClosed);
        }
        if actions.rest {
            self.rest();
        }
        if let Some(code) = actions.bad_reply {
            if actions.start.is_none() && self.state() != ControllerState::Starting {
                self.statistics.bad_replies += u64::from(self.state() != ControllerState::Ending);
                self.statistics.timeouts += u64::from(self.state() == ControllerState::Ending);
            }
            self.events.push_notice(ControllerEvent::BadReply(code));
        }
        match actions.start {
            Some(StartOutcome::Started) => {
                self.statistics.starts += 1;
                self.push_outcome(ControllerEvent::Started);
            }
            Some(StartOutcome::Refused) => self.push_outcome(ControllerEvent::Refused),
            Some(StartOutcome::GaveUp) => self.push_outcome(ControllerEvent::GaveUp),
            None => {}
        }
        match actions.exception {
            Some(Handling::Subroutine(exception)) => self.push_outcome(ControllerEvent::Exception(exception)),
            Some(Handling::Abort(exception)) => self.push_outcome(ControllerEvent::Aborted(exception)),
            None => {}
        }
        if let Some(error) = actions.ended {
            self.push_outcome(ControllerEvent::Ended(error));
        }
    }

    fn push_outcome(&mut self, event: ControllerEvent) {
        let pushed = self.events.push_outcome(event);
        debug_assert!(pushed.is_ok(), "room was asked for when it began");
    }

    fn take(&mut self, reply: &Reply) {
        let holds = self.config.unselected.holds(self.config.mode.accumulation());
        for (word, sent) in self.words.iter_mut().zip(reply.values) {
            *word = sent.unwrap_or(if holds { *word } else { 0 });
        }
        self.applied = self.words;
    }

    /// Without a reply the arm is at rest: no increment, and an offset stays.
    fn rest(&mut self) {
        if self.config.mode.accumulation() == Accumulation::Cumulative {
            self.applied = [0; AXES];
        }
    }

    fn message(&self, due: Outgoing) -> RobotMessage {
        match due {
            Outgoing::Start(error) => {
                RobotMessage::Start(Start { error, ..Start::new(self.config.mode, self.config.data) })
            }
            Outgoing::Motion(phase, error) => {
                let (segment_status, segment, percent) = self.segment;
                let transform = self.config.mode.has_transform().then_some(self.transform);
                RobotMessage::Motion(Motion { phase, error, segment_status, segment, percent, transform })
            }
            Outgoing::End(error) => RobotMessage::End(End { error }),
        }
    }
}

impl Session for Controller {
    type Event = ControllerEvent;
    type Statistics = ControllerStatistics;

    const MAX_INPUT: usize = 65536;
    const MAX_TRANSMIT: usize = Frame::MAX_LEN;

    fn handle_connected(&mut self, now: Duration) {
        self.decoder.clear();
        self.on(now, ControllerInput::Connected);
    }

    fn handle_disconnected(&mut self, now: Duration) {
        self.decoder.clear();
        self.on(now, ControllerInput::Disconnected);
    }

    fn handle_input(&mut self, now: Duration, bytes: &[u8]) {
        self.handle_timeout(now);
        let mut rest = bytes;
        while !rest.is_empty() && self.machine.phase != ControllerPhase::Disconnected {
            let taken = self.decoder.push(rest);
            rest = rest.get(taken..).unwrap_or_default();
            self.read(now);
        }
        self.on(now, ControllerInput::Bytes { partial: self.decoder.pending() > 0 });
    }

    fn handle_timeout(&mut self, now: Duration) {
        self.on(now, ControllerInput::Timeout);
    }

    fn poll_event(&mut self) -> Option<ControllerEvent> {
        self.events.pop()
    }

    fn poll_transmit(&mut self, now: Duration, out: &mut [u8]) -> Option<usize> {
        self.handle_timeout(now);
        let message = self.message(self.machine.due(now)?);
        let len = message.encode(self.config.framing, out).ok()?;
        self.on(now, ControllerInput::Transmit { len: u8::try_from(len).unwrap_or(u8::MAX) }).send?;
        self.decoder.clear();
        match message {
            RobotMessage::Start(_) => self.statistics.attempts += 1,
            RobotMessage::Motion(_) => self.statistics.cycles += 1,
            RobotMessage::End(_) => {}
        }
        Some(len)
    }

    fn poll_timeout(&self) -> Option<Duration> {
        self.machine.deadline()
    }

    fn statistics(&self) -> ControllerStatistics {
        ControllerStatistics { dropped_notices: self.events.dropped_notices(), ..self.statistics }
    }
}

/// What a controller is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ControllerState {
    /// The port is not open.
    Disconnected,
    /// No ALTER: the arm is at rest.
    Off,
    /// Start messages are sent until one is accepted or there were enough.
    Starting,
    /// A standard message is sent each cycle, and the replies move the arm.
    Running,
    /// The same while the exception subroutine runs; the replies move nothing.
    Interrupted,
    /// The end message is sent with the next cycle; the arm is at rest.
    Ending,
}
