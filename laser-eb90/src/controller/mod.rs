//! The controller: the robot's end, which queues instructions and answers.

mod config;
pub mod machine;
mod verdict;

use core::time::Duration;

use robot_session::{Decoder as _, Encode as _, EventQueue, Session, Unexpected};
use robot_work_queue::Writer;

pub use self::config::{ControllerConfig, ControllerRule};
use self::machine::{Answer, ControllerAction, ControllerInput, ControllerMachine, Receiving, Work};
use self::verdict::{Verdict, judge};
use crate::decoder::Decoder;
use crate::error::{ConfigError, DecodeError, EncodeError, SessionError};
use crate::frame::{Frame, MAX_PAYLOAD};
use crate::instruction::Instruction;
use crate::items::Items;
use crate::payload::Payload;
use crate::words::{Class, Refusal};

/// The controller (下位机): interpreted instructions go into a [`robot_work_queue`] and are answered at once, immediate ones
/// are executed first (§2). Drive it as every [`Session`].
///
/// `T` is what the motion task takes: it is built from an [`Instruction`] by `TryFrom`, which also checks the parameters. It is
/// called twice for each instruction, because a frame is queued whole or not at all: every instruction is checked, and the
/// room for all of them, before the first is queued. The job numbers of the queue are counted here; the link has none.
///
/// - [`Execute`](ControllerEvent::Execute) is answered by [`answer`](Self::answer) or [`refuse`](Self::refuse); until then
///   [`instruction`](Self::instruction) holds what to execute.
/// - A corrupt frame is dropped, and answered with an error code when the line has been silent for
///   [`silence`](ControllerConfig::silence) and no good frame was among the bytes. The beginning of a frame that is held then is
///   dropped with it. Two answers to one frame would make the host send, and the robot execute, a frame twice; so bytes that
///   are too few for a frame are not answered at all, nor is corruption between a good frame and its answer.
/// - A frame with an immediate instruction or a query and another instruction is refused, and so is a NaN or an infinity.
/// - An answer is sent at the end of the controller's cycle. If another frame comes before, the host has stopped waiting: the
///   older answer is withdrawn.
/// - While an instruction is executed, input waits in a buffer of [`Frame::MAX_LEN`] bytes; what does not fit is dropped.
/// - An instruction that is being executed when the connection is lost still waits for its `answer`, which goes nowhere.
#[derive(Debug)]
pub struct Controller<'q, T> {
    config: ControllerConfig,
    machine: ControllerMachine,
    decoder: Decoder,
    queue: Writer<'q, T>,
    /// The parameters of the instruction to execute, then the values of the answer.
    values: [u8; MAX_PAYLOAD],
    len: usize,
    events: EventQueue<ControllerEvent, EVENTS>,
    statistics: ControllerStatistics,
}

/// What has happened.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum ControllerEvent {
    /// An immediate instruction or a query: execute [`Controller::instruction`], then call [`Controller::answer`].
    Execute {
        /// Whether the answer carries values.
        class: Class,
        /// The command word.
        word: u16,
    },
    /// A notice: instructions were queued.
    Queued {
        /// How many.
        count: u8,
    },
    /// A notice: a frame, or corrupt bytes, are answered with an error code.
    Refused(Refusal),
    /// A notice: bytes that are no frame.
    Corrupt(DecodeError),
    /// A notice: a call that the state does not allow.
    Unexpected(Unexpected),
}

/// What a controller has counted since it was made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub struct ControllerStatistics {
    /// Instructions queued.
    pub queued: u64,
    /// Immediate instructions and queries to execute.
    pub executed: u64,
    /// Frames and corrupt stretches refused.
    pub refused: u64,
    /// Corrupt stretches of bytes.
    pub corrupt: u64,
    /// Answers sent.
    pub answers: u64,
    /// Inputs that the machine did not expect.
    pub unexpected: u64,
    /// Notices dropped because nobody took them.
    pub dropped_notices: u64,
}

const EVENTS: usize = 8;
/// The command word in front of an answer's values.
const WORD_LEN: usize = 4;

impl<'q, T> Controller<'q, T>
where
    T: for<'a> TryFrom<Instruction<'a>>,
{
    /// A controller without a connection that queues into `queue`.
    ///
    /// # Errors
    /// A configuration that cannot work.
    pub fn new(config: ControllerConfig, queue: Writer<'q, T>) -> Result<Self, ConfigError> {
        config.check()?;
        Ok(Self {
            config,
            machine: ControllerMachine::NEW,
            decoder: Decoder::new(&config.profile),
            queue,
            values: [0; MAX_PAYLOAD],
            len: 0,
            events: EventQueue::new(),
            statistics: ControllerStatistics::default(),
        })
    }

    /// The instruction is executed: the answer echoes its command word, and carries what `values` writes.
    ///
    /// # Errors
    /// Nothing is being executed, its event has not been taken, or the values do not fit a frame; the instruction still waits
    /// for its answer then.
    pub fn answer(
        &mut self,
        now: Duration,
        values: impl FnOnce(&mut Payload<'_>) -> Result<(), EncodeError>,
    ) -> Result<(), SessionError> {
        self.check_executing()?;
        let room = self.values.get_mut(..MAX_PAYLOAD - WORD_LEN).unwrap_or_default();
        let mut payload = Payload::new(room, &self.config.profile);
        values(&mut payload).map_err(SessionError::Encode)?;
        self.len = payload.as_bytes().len();
        self.executed(now, Ok(()));
        Ok(())
    }

    /// The instruction could not be executed: the answer is an error code.
    ///
    /// # Errors
    /// Nothing is being executed, or its event has not been taken.
    pub fn refuse(&mut self, now: Duration, refusal: Refusal) -> Result<(), SessionError> {
        self.check_executing()?;
        self.executed(now, Err(refusal));
        Ok(())
    }

    /// What is to be executed; `None` when nothing is.
    pub fn instruction(&self) -> Option<Instruction<'_>> {
        match self.machine.work {
            Work::Executing { word, .. } => {
                Some(Instruction { word, parameters: Items::new(self.values(), &self.config.profile) })
            }
            Work::Listening { .. } | Work::Answering { .. } => None,
        }
    }

    /// The queue's end, to clear it or to look at its room.
    pub fn queue_mut(&mut self) -> &mut Writer<'q, T> {
        &mut self.queue
    }

    /// The machine.
    pub fn machine(&self) -> &ControllerMachine {
        &self.machine
    }

    fn check_executing(&self) -> Result<(), SessionError> {
        let is_taken = self.events.has_room(EVENTS);
        if is_taken && !self.machine.reads_frames() { Ok(()) } else { Err(SessionError::NotExecuting) }
    }

    fn executed(&mut self, now: Duration, result: Result<(), Refusal>) {
        self.advance(now, ControllerInput::Executed(result));
        self.read(now);
    }

    /// Reads the frames that are there, until one is to be executed.
    fn read(&mut self, now: Duration) {
        while self.machine.reads_frames() {
            let before = self.decoder.position();
            let Some(frame) = self.decoder.next_frame() else { break };
            let input = match frame {
                Ok(frame) => match judge(frame.items(), &self.config, &mut self.queue) {
                    Ok(Verdict::Queued { word, count }) => {
                        self.statistics.queued += u64::from(count);
                        self.events.push_notice(ControllerEvent::Queued { count });
                        ControllerInput::Queued { word }
                    }
                    Ok(Verdict::Execute { class, instruction: Instruction { word, parameters } }) => {
                        let parameters = parameters.as_bytes();
                        if let Some(slot) = self.values.get_mut(..parameters.len()) {
                            slot.copy_from_slice(parameters);
                        }
                        self.len = parameters.len();
                        self.statistics.executed += 1;
                        // There is room: the event before was taken when its instruction was answered.
                        let _ = self.events.push_outcome(ControllerEvent::Execute { class, word });
                        ControllerInput::Immediate { word }
                    }
                    Err(refusal) => ControllerInput::Refused(refusal),
                },
                Err(error) => {
                    self.statistics.corrupt += 1;
                    self.events.push_notice(ControllerEvent::Corrupt(error));
                    let checksum = matches!(error, DecodeError::Checksum { .. });
                    let refusal = if checksum { Refusal::BadChecksum } else { Refusal::BadFrame };
                    let bytes = u8::try_from(self.decoder.position() - before).unwrap_or(u8::MAX);
                    ControllerInput::Corrupt { refusal, bytes }
                }
            };
            self.advance(now, input);
        }
        if matches!(self.machine.line, Receiving::Bytes { .. }) {
            self.advance(now, ControllerInput::Read { partial: !self.decoder.is_empty() });
        }
    }

    /// Whether the state allows the input.
    fn advance(&mut self, now: Duration, input: ControllerInput) -> bool {
        let result = self.machine.on(now, input, &self.config);
        match result {
            Ok(ControllerAction::Nothing | ControllerAction::Execute) => {}
            Ok(ControllerAction::Answer(Answer::Error(refusal))) => {
                self.len = 0;
                self.statistics.refused += 1;
                self.events.push_notice(ControllerEvent::Refused(refusal));
            }
            Ok(ControllerAction::Answer(Answer::Echo(_))) => {
                if !matches!(input, ControllerInput::Executed(_)) {
                    self.len = 0;
                }
            }
            Err(unexpected) => {
                self.statistics.unexpected += 1;
                self.events.push_notice(ControllerEvent::Unexpected(unexpected));
            }
        }
        result.is_ok()
    }

    fn values(&self) -> &[u8] {
        self.values.get(..self.len).unwrap_or_default()
    }

    fn encode(&self, answer: Answer, out: &mut [u8]) -> Option<usize> {
        let Self { config, .. } = self;
        let word = match answer {
            Answer::Echo(word) => word,
            Answer::Error(refusal) => config.words.errors().code(refusal),
        };
        let mut buffer = [0; MAX_PAYLOAD];
        let mut payload = Payload::new(&mut buffer, &config.profile);
        payload.word(word).ok()?.items(Items::new(self.values(), &config.profile)).ok()?;
        payload.frame().ok()?.encode(out).ok()
    }
}

impl<T> Session for Controller<'_, T>
where
    T: for<'a> TryFrom<Instruction<'a>>,
{
    type Event = ControllerEvent;
    type Statistics = ControllerStatistics;

    const MAX_INPUT: usize = 65536;
    const MAX_TRANSMIT: usize = Frame::MAX_LEN;

    fn handle_connected(&mut self, now: Duration) {
        self.decoder.clear();
        self.advance(now, ControllerInput::Connected);
    }

    fn handle_disconnected(&mut self, now: Duration) {
        self.decoder.clear();
        self.advance(now, ControllerInput::Disconnected);
    }

    fn handle_input(&mut self, now: Duration, mut bytes: &[u8]) {
        // Without a connection nothing is queued.
        if bytes.is_empty() || !self.advance(now, ControllerInput::Bytes) {
            return;
        }
        while !bytes.is_empty() {
            let taken = self.decoder.push(bytes);
            bytes = bytes.get(taken..).unwrap_or_default();
            self.read(now);
            if taken == 0 && !self.machine.reads_frames() {
                return;
            }
        }
    }

    fn handle_timeout(&mut self, now: Duration) {
        if self.machine.is_silent(now) {
            self.decoder.finish();
            self.read(now);
            if self.machine.reads_frames() {
                self.advance(now, ControllerInput::Silence);
            }
        }
    }

    fn poll_event(&mut self) -> Option<ControllerEvent> {
        self.events.pop()
    }

    fn poll_transmit(&mut self, now: Duration, out: &mut [u8]) -> Option<usize> {
        self.handle_timeout(now);
        let answer = self.machine.due(now)?;
        let len = self.encode(answer, out)?;
        self.statistics.answers += 1;
        self.advance(now, ControllerInput::Transmit);
        Some(len)
    }

    fn poll_timeout(&self) -> Option<Duration> {
        self.machine.deadline()
    }

    fn statistics(&self) -> ControllerStatistics {
        ControllerStatistics { dropped_notices: self.events.dropped_notices(), ..self.statistics }
    }
}
