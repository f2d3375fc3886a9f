//! The controller: the robot's end, which queues instructions and answers.

mod config;
pub mod machine;
mod verdict;

use core::time::Duration;

use robot_session::end::{Core, Echo, End, EventQueue, Machine as _, QueueSpace};
use robot_session::{Decoder as _, EchoError, Encode as _, Unexpected};
use robot_work_queue::{NoWake, Wake, Writer};

pub use self::config::ControllerConfig;
#[doc(hidden)]
pub use self::config::Rule;
use self::machine::{Action, Answer, ControllerMachine, Input, Work};
use self::verdict::{Verdict, judge};
use crate::decoder::Decoder;
use crate::error::{ConfigError, DecodeError, EncodeError, SessionError};
use crate::frame::{Frame, MAX_PAYLOAD};
use crate::instruction::Instruction;
use crate::items::Items;
use crate::payload::Payload;
use crate::words::{Class, Refusal};

/// The controller (下位机): interpreted instructions go into a [`robot_work_queue`] and are answered at once, immediate ones
/// are executed first (§2). Drive it as every [`Session`](robot_session::Session).
///
/// `T` is the job of the motion task: it is built from an [`Instruction`] by `TryFrom`, which also checks the parameters. It
/// is called twice for each instruction, because a frame is queued completely or not at all: every instruction is checked,
/// and the free space for all of them, before the first is queued. The job numbers of the queue are counted here; the link
/// does not have any. The queue's [`Wake`] wakes the motion task; the controller checks the queue when a frame comes, and
/// need not be woken.
///
/// - [`Execute`](ControllerEvent::Execute) is answered by [`answer`](Self::answer) or [`refuse`](Self::refuse); until then
///   [`instruction`](Self::instruction) returns the instruction to execute.
/// - A corrupt frame is dropped, and answered with an error code when the line has been silent for
///   [`silence`](ControllerConfig::silence). The beginning of a frame that is held then is dropped with it. Two answers to
///   one frame would make the host send, and the robot execute, a frame twice; so bytes that are too few for a frame are not
///   answered at all, nor is corruption between a good frame and its answer, nor, after an error code, bytes without a head:
///   they are the rest of the answered frame.
/// - Nothing is executed from the middle of corrupt bytes: after them a frame is executed only when the line was silent in
///   between, and answered with an error code before. Fewer than eight bytes of noise before it do not count.
/// - A frame with an immediate instruction or a query and another instruction is refused, and so is a NaN or an infinity.
/// - An answer is sent at the end of the controller's cycle. If another frame comes before, the host has stopped waiting: the
///   older answer is withdrawn.
/// - While an instruction is executed, input waits in a buffer of [`Frame::MAX_LEN`] bytes; bytes that do not fit are
///   dropped.
/// - An instruction that is being executed when the connection is lost still waits for its `answer`, which goes nowhere.
#[derive(Debug)]
pub struct Controller<'q, T, R: Wake = NoWake> {
    core: Core<ControllerMachine, Decoder, EventQueue<ControllerEvent, EVENTS>, ControllerStatistics>,
    echo: Echo<{ Frame::MAX_LEN }>,
    queue: Writer<'q, T, R>,
    /// The parameters of the instruction to execute, then the values of the answer.
    values: [u8; MAX_PAYLOAD],
    len: usize,
}

/// An event of the controller.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "event", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum ControllerEvent {
    /// An immediate instruction or a query: execute [`Controller::instruction`], then call [`Controller::answer`].
    Execute {
        /// Whether the answer carries values.
        class: Class,
        /// The command word of the instruction.
        word: u16,
    },
    /// A notice: instructions were queued.
    Queued {
        /// The number of instructions of the frame, from 1.
        count: u8,
    },
    /// A notice: a frame, or corrupt bytes, are answered with an error code.
    #[cfg_attr(feature = "serde", serde(serialize_with = "refusal"))]
    Refused(Refusal),
    /// A notice: bytes that are not a frame.
    #[cfg_attr(feature = "serde", serde(serialize_with = "robot_session::under::error"))]
    Corrupt(DecodeError),
    /// A notice: the line returns the sent bytes, and [`echo`](ControllerConfig::echo) is off; or it is on, and other bytes
    /// came back.
    #[cfg_attr(feature = "serde", serde(serialize_with = "robot_session::under::error"))]
    Echo(EchoError),
    /// A notice: a call that is invalid in this state.
    Unexpected(Unexpected),
}

#[cfg(feature = "serde")]
fn refusal<S: serde::Serializer>(refusal: &Refusal, serializer: S) -> Result<S::Ok, S::Error> {
    robot_session::under::name("refusal", refusal, serializer)
}

robot_session::counters! {
    /// Counters of a controller.
    pub struct ControllerStatistics {
        /// Instructions queued.
        pub queued: u64,
        /// Immediate instructions and queries to execute.
        pub executed: u64,
        /// Refused frames and runs of corrupt bytes.
        pub refused: u64,
        /// Runs of corrupt bytes.
        pub corrupt: u64,
        /// Answers sent.
        pub answers: u64,
    }
}

const EVENTS: usize = 8;
/// The command word in front of an answer's values.
const WORD_LEN: usize = 4;

impl<'q, T, R: Wake> Controller<'q, T, R>
where
    T: for<'a> TryFrom<Instruction<'a>>,
{
    /// Creates a controller without a connection that queues into `queue`.
    ///
    /// # Errors
    /// An invalid configuration.
    pub fn new(config: ControllerConfig, queue: Writer<'q, T, R>) -> Result<Self, ConfigError> {
        config.check()?;
        Ok(Self {
            core: Core::new(config, ControllerMachine::NEW, Decoder::new(&config.profile)),
            echo: Echo::new(config.echo),
            queue,
            values: [0; MAX_PAYLOAD],
            len: 0,
        })
    }

    /// Answers an instruction that was executed: the answer echoes its command word, and for a query contains the values
    /// that `values` writes.
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
        let class = self.instruction().and_then(|instruction| self.core.config.words.class(instruction.word));
        let room = self.values.get_mut(..MAX_PAYLOAD - WORD_LEN).unwrap_or_default();
        let mut payload = Payload::new(room, &self.core.config.profile);
        values(&mut payload).map_err(SessionError::Encode)?;
        // The answer to an immediate instruction is its echo alone.
        self.len = if class == Some(Class::Query) { payload.as_bytes().len() } else { 0 };
        self.executed(now, Ok(()));
        Ok(())
    }

    /// Answers an instruction that could not be executed, with an error code.
    ///
    /// # Errors
    /// Nothing is being executed, or its event has not been taken.
    pub fn refuse(&mut self, now: Duration, refusal: Refusal) -> Result<(), SessionError> {
        self.check_executing()?;
        self.executed(now, Err(refusal));
        Ok(())
    }

    /// Returns the instruction to execute, if any.
    pub fn instruction(&self) -> Option<Instruction<'_>> {
        match self.core.machine.work {
            Work::Executing { word, .. } => {
                Some(Instruction { word, parameters: Items::new(self.values(), &self.core.config.profile) })
            }
            Work::Listening { .. } | Work::Answering { .. } => None,
        }
    }

    /// Returns the writer of the queue, to clear it or to read its free space.
    pub fn queue_mut(&mut self) -> &mut Writer<'q, T, R> {
        &mut self.queue
    }

    fn check_executing(&self) -> Result<(), SessionError> {
        let is_taken = self.core.events.has_room(EVENTS);
        if is_taken && !self.core.machine.reads() { Ok(()) } else { Err(SessionError::NotExecuting) }
    }

    fn executed(&mut self, now: Duration, result: Result<(), Refusal>) {
        self.advance(now, Input::Executed(result), None);
        // Read the bytes that have arrived meanwhile.
        self.read(now);
        self.end_input(now);
    }

    fn values(&self) -> &[u8] {
        self.values.get(..self.len).unwrap_or_default()
    }

    fn encode(&self, answer: Answer, out: &mut [u8]) -> Option<usize> {
        let Core { config, .. } = &self.core;
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

impl<T, R: Wake> End for Controller<'_, T, R>
where
    T: for<'a> TryFrom<Instruction<'a>>,
{
    type Machine = ControllerMachine;
    type Decoder = Decoder;
    type Events = EventQueue<ControllerEvent, EVENTS>;
    type Statistics = ControllerStatistics;
    /// The event of a good frame.
    type Payload = ControllerEvent;

    const LINK: &'static str = "laser-eb90";
    const END: &'static str = "controller";
    const MAX_INPUT: usize = Frame::MAX_LEN;
    const MAX_TRANSMIT: usize = Frame::MAX_LEN;
    /// The single outcome was taken when the previous instruction was answered.
    const QUEUE_SPACE: QueueSpace = QueueSpace::NONE;

    robot_session::core!(ControllerEvent::Unexpected);
    robot_session::echo!(ControllerEvent::Echo);

    /// Instructions are queued here: whether they all can be is known only then.
    fn next_input(&mut self) -> Option<(Input, Option<ControllerEvent>)> {
        let (before, has_begun) = (self.core.decoder.position(), self.core.decoder.has_begun());
        let trusts = self.core.machine.trusts(&self.core.config);
        let (input, event) = match self.core.decoder.next_frame()? {
            Ok(_) if !trusts => (Input::Untrusted, None),
            Ok(frame) => match judge(frame.items(), &self.core.config, &mut self.queue) {
                Ok(Verdict::Queued { word, count }) => {
                    self.core.statistics.queued += u64::from(count);
                    (Input::Queued { word }, Some(ControllerEvent::Queued { count }))
                }
                Ok(Verdict::Execute { class, instruction: Instruction { word, parameters } }) => {
                    let parameters = parameters.as_bytes();
                    if let Some(slot) = self.values.get_mut(..parameters.len()) {
                        slot.copy_from_slice(parameters);
                    }
                    self.len = parameters.len();
                    (Input::Immediate { word }, Some(ControllerEvent::Execute { class, word }))
                }
                Err(refusal) => (Input::Refused(refusal), None),
            },
            Err(error) => {
                self.core.statistics.corrupt += 1;
                self.core.events.push_notice(ControllerEvent::Corrupt(error));
                let checksum = matches!(error, DecodeError::Checksum { .. });
                let refusal = if checksum { Refusal::BadChecksum } else { Refusal::BadFrame };
                let bytes = u8::try_from(self.core.decoder.position() - before).unwrap_or(u8::MAX);
                let begun = match error {
                    DecodeError::NoHead { .. }
                    | DecodeError::Flag { .. }
                    | DecodeError::Tag { offset: 0, .. } => false,
                    DecodeError::Incomplete { .. } => has_begun,
                    _ => true,
                };
                (Input::Corrupt { refusal, bytes, begun }, None)
            }
        };
        Some((input, event))
    }

    fn act(&mut self, _: Duration, action: Action, frame: Option<ControllerEvent>) {
        match (action, frame) {
            (Action::Execute, Some(event)) => {
                self.core.statistics.executed += 1;
                self.core.push_outcome(event);
            }
            (Action::Answer(Answer::Echo(_)), Some(event)) => {
                self.len = 0;
                self.core.events.push_notice(event);
            }
            (Action::Answer(Answer::Error(refusal)), _) => {
                self.len = 0;
                self.core.statistics.refused += 1;
                self.core.events.push_notice(ControllerEvent::Refused(refusal));
            }
            (Action::Sent, _) => self.core.statistics.answers += 1,
            // An executed instruction is answered with the caller's values.
            (Action::Nothing | Action::Execute | Action::Answer(Answer::Echo(_)), _) => {}
        }
    }

    fn write(&mut self, _: Duration, answer: Answer, out: &mut [u8]) -> Option<(usize, Input)> {
        let len = self.encode(answer, out)?;
        // A host may send the same.
        self.echo.sent(out.get(..len).unwrap_or_default(), false);
        Some((len, Input::Sent))
    }

    /// Returns true also while an instruction is executed: a frame that comes before the answer withdraws the instruction,
    /// so it must not wait in the port.
    fn takes_input(&self) -> bool {
        true
    }

    fn begin_input(&mut self, now: Duration) -> bool {
        self.advance(now, Input::Bytes, None);
        self.core.machine.is_connected()
    }

    fn end_input(&mut self, now: Duration) {
        let partial = !self.core.decoder.is_empty();
        self.advance(now, Input::Read { partial }, None);
    }
}
