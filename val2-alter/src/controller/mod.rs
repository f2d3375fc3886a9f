//! The robot controller's end.

mod config;
mod input;
pub mod machine;
mod state;

#[doc(hidden)]
pub use config::Rule;
pub use config::{ControllerConfig, ControllerEvent, ControllerStatistics, Unselected};

use core::time::Duration;

use robot_session::Decoder as _;
use robot_session::end::{Core, CoreOf, End as _, EventQueue, QueueSpace};

use crate::decoder::Decoder;
use crate::error::{ConfigError, DecodeError, SessionError};
use crate::frame::Frame;
use crate::message::{
    AXES, Accumulation, End, ErrorCode, HostMessage, Message, Motion, Reply, RobotMessage, SegmentStatus,
    Start, Transform,
};
use machine::{
    Action, ControllerMachine, ControllerPhase, DueMessage, ExceptionHandling, Input, Progress, ReplyEffect,
    StartOutcome,
};

/// The controller's session: a MARK III without its arm. Its verbs are those of [`robot_session::Session`]; it never reads a
/// clock and never blocks. [`start`](Controller::start) executes the ALTER instruction.
///
/// The first good reply in the window of a message decides; a reply outside a window, or while the message is still on the
/// line, has no effect and is reported. A reply that cannot be read sets the error code of the next message, and does not
/// move the arm; a missing one ends ALTER with error 6. A session that is late itself sends the next message late: it never
/// sends two in one cycle. When 16 events wait, the oldest notice is dropped and counted; the result of a start, exceptions
/// and the end of ALTER are outcomes, which are not dropped.
#[derive(Debug, Clone)]
pub struct Controller {
    core: CoreOf<Self>,
    /// The segment status and its two values in the next standard messages.
    segment: (SegmentStatus, u16, u16),
    transform: Transform,
    /// The words that the controller keeps, and their effect on the arm in the last cycle.
    words: [i16; AXES],
    applied: [i16; AXES],
}

/// The outcomes of an ALTER: started, an exception, ended.
const OUTCOMES: usize = 3;

impl Controller {
    /// Creates a controller whose port is not open.
    ///
    /// # Errors
    /// [`ConfigError::Window`]: no reply fits the line; [`ConfigError::Attempts`].
    pub fn new(config: ControllerConfig) -> Result<Self, ConfigError> {
        config.check()?;
        Ok(Self {
            core: Core::new(config, ControllerMachine::NEW, Decoder::new(config.framing)),
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
        let has_room = self.core.events.has_room(OUTCOMES);
        self.ask(now, Input::Start { has_room })
    }

    /// Ends ALTER, as the program does: the end message is sent with the next cycle.
    ///
    /// # Errors
    /// [`SessionError::NotRunning`]
    pub fn finish(&mut self, now: Duration) -> Result<(), SessionError> {
        self.ask(now, Input::Finish)
    }

    /// Begins a subroutine of the program, which runs on its own between two cycles: until [`resume`](Controller::resume)
    /// the replies do not move the arm.
    ///
    /// # Errors
    /// [`SessionError::NotRunning`]: also while a reply is awaited, because an exception in it would be lost.
    pub fn interrupt(&mut self, now: Duration) -> Result<(), SessionError> {
        self.ask(now, Input::Interrupt)
    }

    /// Ends the subroutine. At least one message reports that it ran.
    ///
    /// # Errors
    /// [`SessionError::NotRunning`]
    pub fn resume(&mut self, now: Duration) -> Result<(), SessionError> {
        self.ask(now, Input::Return)
    }

    /// Sets the motion segment in the next messages: its status, its number (from 1), and its completed part
    /// ([`Motion::DONE`] is all).
    pub fn set_segment(&mut self, status: SegmentStatus, number: u16, percent: u16) {
        self.segment = (status, number, percent);
    }

    /// Sets the position of the tool in the next messages, if mode bit 2 requests it. At first all words are zero.
    pub fn set_transform(&mut self, transform: Transform) {
        self.transform = transform;
    }

    /// Returns the values that moved the arm in the last cycle (cumulative), or its offset from the path (non-cumulative).
    pub fn values(&self) -> [i16; AXES] {
        self.applied
    }

    /// Returns the state of the session.
    pub fn state(&self) -> ControllerState {
        match &self.core.machine.phase {
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

    fn ask(&mut self, now: Duration, input: Input) -> Result<(), SessionError> {
        match self.core.on(now, input) {
            Ok(Action::Refuse(error)) => return Err(error),
            Ok(action) => self.act(now, action, None),
            Err(unexpected) => self.refuse(unexpected),
        }
        Ok(())
    }

    fn bad_reply(&mut self, code: ErrorCode) {
        self.rest();
        self.core.events.push_notice(ControllerEvent::BadReply(code));
    }

    fn started(&mut self, outcome: StartOutcome) {
        self.core.statistics.starts += u64::from(outcome == StartOutcome::Started);
        self.core.push_outcome(match outcome {
            StartOutcome::Started => ControllerEvent::Started,
            StartOutcome::Refused => ControllerEvent::Refused,
            StartOutcome::GaveUp => ControllerEvent::GaveUp,
        });
    }

    fn take(&mut self, reply: &Reply) {
        let holds = self.core.config.unselected.holds(self.core.config.mode.accumulation());
        for (word, sent) in self.words.iter_mut().zip(reply.values) {
            *word = sent.unwrap_or(if holds { *word } else { 0 });
        }
        self.applied = self.words;
    }

    /// Handles a cycle without a reply: the arm is at rest, without an increment, and an offset stays.
    fn rest(&mut self) {
        if self.core.config.mode.accumulation() == Accumulation::Cumulative {
            self.applied = [0; AXES];
        }
    }

    fn message(&self, due: DueMessage) -> RobotMessage {
        match due {
            DueMessage::Start(error) => RobotMessage::Start(Start {
                error,
                ..Start::new(self.core.config.mode, self.core.config.data)
            }),
            DueMessage::Motion(phase, error) => {
                let (segment_status, segment, percent) = self.segment;
                let transform = self.core.config.mode.has_transform().then_some(self.transform);
                RobotMessage::Motion(Motion { phase, error, segment_status, segment, percent, transform })
            }
            DueMessage::End(error) => RobotMessage::End(End { error }),
        }
    }
}

impl robot_session::end::End for Controller {
    type Machine = ControllerMachine;
    type Decoder = Decoder<HostMessage>;
    type Events = EventQueue<ControllerEvent, 16>;
    type Statistics = ControllerStatistics;
    type Payload = HostMessage;

    const LINK: &'static str = "val2-alter";
    const END: &'static str = "controller";
    const MAX_INPUT: usize = 4096;
    const MAX_TRANSMIT: usize = Frame::MAX_LEN;
    const QUEUE_SPACE: QueueSpace = QueueSpace::NONE;

    robot_session::core!(ControllerEvent::Unexpected);

    fn begin_input(&mut self, now: Duration) -> bool {
        let is_connected = self.core.machine.is_connected();
        if !is_connected {
            self.advance(now, Input::Bytes { partial: false }, None);
        }
        is_connected
    }

    fn end_input(&mut self, now: Duration) {
        let partial = self.core.decoder.pending() > 0;
        self.advance(now, Input::Bytes { partial }, None);
    }

    fn next_input(&mut self) -> Option<(Input, Option<HostMessage>)> {
        loop {
            let item = self.core.decoder.next_frame();
            // Report corruption at once: corrupt bytes before the window opens are not a reply to the message.
            if let Some(error) = self.core.decoder.corruption() {
                return Some((Input::Corrupt(error.code()), None));
            }
            let message = match item? {
                Ok(received) => received.message,
                Err(error @ DecodeError::StartMark { .. }) => {
                    return Some((Input::Corrupt(error.code()), None));
                }
                Err(_) => continue,
            };
            let input = match &message {
                HostMessage::StartReply(code) => Input::StartReply(*code),
                HostMessage::Reply(Reply { exception, .. }) => {
                    // The exception's, and that of the end.
                    let has_room = self.core.events.has_room(2);
                    Input::Reply { exception: *exception, has_room }
                }
            };
            return Some((input, Some(message)));
        }
    }

    fn act(&mut self, _now: Duration, action: Action, message: Option<HostMessage>) {
        match action {
            Action::Nothing | Action::Refuse(_) => {}
            Action::Begin => (self.words, self.applied) = ([0; AXES], [0; AXES]),
            Action::Sent(message) => {
                self.core.decoder.clear();
                match message {
                    DueMessage::Start(_) => self.core.statistics.attempts += 1,
                    DueMessage::Motion(..) => self.core.statistics.cycles += 1,
                    DueMessage::End(error) => self.core.push_outcome(ControllerEvent::Ended(error)),
                }
            }
            Action::Take(taken, handling) => {
                let Some(HostMessage::Reply(reply)) = message else { return };
                self.core.statistics.replies += 1;
                match taken {
                    ReplyEffect::Moves => self.take(&reply),
                    ReplyEffect::Rests => self.rest(),
                }
                self.core.events.push_notice(ControllerEvent::Reply { reply, values: self.applied });
                match handling {
                    None => {}
                    Some(ExceptionHandling::Subroutine(code)) => {
                        self.core.push_outcome(ControllerEvent::Exception(code))
                    }
                    Some(ExceptionHandling::Abort(code)) => {
                        self.core.push_outcome(ControllerEvent::Aborted(code))
                    }
                }
            }
            Action::Start(outcome) => self.started(outcome),
            Action::BadStart(code, outcome) => {
                self.bad_reply(code);
                outcome.into_iter().for_each(|outcome| self.started(outcome));
            }
            Action::BadReply(code) => {
                self.core.statistics.bad_replies += 1;
                self.bad_reply(code);
            }
            Action::Missing => {
                self.core.statistics.timeouts += 1;
                self.bad_reply(ErrorCode::Timeout);
            }
            Action::Rest => self.rest(),
            Action::End(error) => {
                self.rest();
                self.core.push_outcome(ControllerEvent::Ended(error));
            }
            Action::Stray => {
                self.core.statistics.strays += 1;
                message.into_iter().for_each(|it| self.core.events.push_notice(ControllerEvent::Stray(it)));
            }
        }
    }

    fn write(&mut self, _now: Duration, what: DueMessage, out: &mut [u8]) -> Option<(usize, Input)> {
        let len = self.message(what).encode(self.core.config.framing, out).ok()?;
        Some((len, Input::Sent { len: u8::try_from(len).unwrap_or(u8::MAX) }))
    }
}

/// The state of a controller.
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
    /// As `Running`, while the exception subroutine runs; the replies move nothing.
    Interrupted,
    /// The end message is sent with the next cycle; the arm is at rest.
    Ending,
}
