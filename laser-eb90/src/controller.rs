//! The controller: the robot's end, which queues instructions and answers.

use core::time::Duration;

use robot_work_queue::Writer;

use crate::decoder::Decoder;
use crate::error::{DecodeError, EncodeError, SessionError};
use crate::frame::{Frame, MAX_PAYLOAD};
use crate::instruction::{Class, Instruction, Instructions, Refusal, Words};
use crate::message::{Items, Payload};
use crate::profile::Profile;
use crate::state::{ControllerAction, ControllerInput, ControllerState};
use crate::timing;

/// The controller (下位机): interpreted instructions go into a [`robot_work_queue`] and are answered at once, immediate ones
/// are executed first (§2).
///
/// `T` is what the motion task wants: it is made of an [`Instruction`] by `TryFrom`, which also checks the parameters. It is
/// called twice for each instruction, because a frame is queued whole or not at all: every instruction is checked, and the
/// room for all of them, before the first is queued. The job numbers of the queue are counted here; the link has none.
///
/// Whenever bytes arrive call [`handle_input`](Self::handle_input), when the time of [`poll_timeout`](Self::poll_timeout) has
/// come [`handle_timeout`](Self::handle_timeout); after either [`poll_event`](Self::poll_event) until it gives `None`, then
/// [`poll_transmit`](Self::poll_transmit). [`Execute`](ControllerEvent::Execute) is answered by [`answer`](Self::answer) or
/// [`refuse`](Self::refuse).
///
/// - A damaged frame is dropped, and answered with an error code when the line has been silent for
///   [`silence`](ControllerConfig::silence) and no good frame was among the bytes. Two answers to one frame would make the host
///   send, and the robot execute, a frame twice; so bytes that are too few for a frame are not answered at all, nor is damage
///   between a good frame and its answer.
/// - An answer leaves at the end of the controller's cycle. If another frame comes before, the host has stopped waiting: the
///   older answer is withdrawn.
/// - While an instruction is executed, input waits in a buffer of [`Frame::MAX_LEN`] bytes; what does not fit is dropped.
/// - `Execute` waits until it has been taken; of the other events the latest is kept.
#[derive(Debug)]
pub struct Controller<'q, T> {
    config: ControllerConfig,
    decoder: Decoder,
    queue: Writer<'q, T>,
    state: ControllerState,
    /// The instruction to execute, then the answer.
    payload: [u8; MAX_PAYLOAD],
    len: usize,
    word: u16,
    class: Class,
    /// Damage that has not been answered, and the bytes heard since the last frame, answer or silence.
    fault: Option<Refusal>,
    heard: usize,
    /// When the line counts as silent; `None` when it does.
    silent_at: Option<Duration>,
    /// When the answer may leave.
    due: Duration,
    event: Option<Event>,
}

/// How the controller behaves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ControllerConfig {
    /// How frames are written.
    pub profile: Profile,
    /// Command words and error codes.
    pub words: Words,
    /// The most instructions that a frame may hold. Default: 7 (§3(6)).
    pub batch: u8,
    /// The controller's cycle, at whose end answers leave. Default: 16 ms (§4.1).
    pub tick: Duration,
    /// How long no byte must come before damaged bytes are answered. Default: 50 ms, above the pauses that a PC makes within
    /// a frame.
    pub silence: Duration,
}

/// What the controller has to tell.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum ControllerEvent<'a> {
    /// Instructions were queued.
    Queued {
        /// How many.
        count: u8,
    },
    /// An immediate instruction or a query: execute it, then call [`Controller::answer`].
    Execute {
        /// Whether the answer carries values.
        class: Class,
        /// What to execute.
        instruction: Instruction<'a>,
    },
    /// A frame, or damage, is answered with an error code.
    Refused(Refusal),
}

impl<'q, T> Controller<'q, T>
where
    T: for<'a> TryFrom<Instruction<'a>>,
{
    /// A controller that queues into `queue`.
    pub fn new(config: ControllerConfig, queue: Writer<'q, T>) -> Self {
        Self {
            config,
            decoder: Decoder::new(&config.profile),
            queue,
            state: ControllerState::Listening,
            payload: [0; MAX_PAYLOAD],
            len: 0,
            word: 0,
            class: Class::Interpreted,
            fault: None,
            heard: 0,
            silent_at: None,
            due: Duration::ZERO,
            event: None,
        }
    }

    /// Takes bytes from the line.
    pub fn handle_input(&mut self, now: Duration, mut bytes: &[u8]) {
        while !bytes.is_empty() {
            self.silent_at = Some(now.saturating_add(self.config.silence));
            let taken = self.decoder.push(bytes);
            self.heard += taken;
            bytes = bytes.get(taken..).unwrap_or_default();
            self.drain(now);
            if taken == 0 && self.state == ControllerState::Executing {
                return;
            }
        }
    }

    /// Lets time pass: the line may have fallen silent.
    pub fn handle_timeout(&mut self, now: Duration) {
        if self.state == ControllerState::Executing || self.silent_at.is_none_or(|at| now < at) {
            return;
        }
        self.silent_at = None;
        self.decoder.finish();
        self.drain(now);
        let heard = core::mem::take(&mut self.heard);
        if let Some(refusal) = self.fault.take()
            && heard >= Frame::MIN_LEN
        {
            self.decide(now, ControllerInput::Damaged, Err(refusal));
        }
    }

    /// Writes the answer when it is due; returns its length. `out` needs [`Frame::MAX_LEN`] bytes: an answer that does not
    /// fit waits.
    pub fn poll_transmit(&mut self, now: Duration, out: &mut [u8]) -> Option<usize> {
        self.handle_timeout(now);
        if self.state != ControllerState::Answering || now < self.due || self.is_hearing() {
            return None;
        }
        let payload = self.payload.get(..self.len)?;
        let len = Frame::new(payload, &self.config.profile).encode(out).ok()?;
        (self.state, _) = self.state.on(ControllerInput::Sent);
        self.heard = 0;
        Some(len)
    }

    /// What has happened.
    pub fn poll_event(&mut self) -> Option<ControllerEvent<'_>> {
        Some(match self.event.take()? {
            Event::Queued(count) => ControllerEvent::Queued { count },
            Event::Refused(refusal) => ControllerEvent::Refused(refusal),
            Event::Execute => {
                let payload = self.payload.get(..self.len).unwrap_or_default();
                let parameters = Items::new(payload, &self.config.profile);
                ControllerEvent::Execute {
                    class: self.class,
                    instruction: Instruction { word: self.word, parameters },
                }
            }
        })
    }

    /// When to call [`handle_timeout`](Self::handle_timeout) or [`poll_transmit`](Self::poll_transmit) at the latest.
    pub fn poll_timeout(&self) -> Option<Duration> {
        match self.state {
            ControllerState::Executing => None,
            ControllerState::Listening => self.silent_at,
            ControllerState::Answering if self.is_hearing() => self.silent_at,
            ControllerState::Answering => Some(self.due),
        }
    }

    /// The instruction is executed: the answer echoes its command word, and carries what `values` writes.
    ///
    /// # Errors
    /// Nothing is being executed, or the values do not fit a frame; the instruction still waits for its answer then.
    pub fn answer(
        &mut self,
        now: Duration,
        values: impl FnOnce(&mut Payload<'_>) -> Result<(), EncodeError>,
    ) -> Result<(), SessionError> {
        if self.state != ControllerState::Executing {
            return Err(SessionError::NotExecuting);
        }
        let mut payload = Payload::new(&mut self.payload, &self.config.profile);
        payload
            .word(self.word)
            .map(drop)
            .and_then(|()| values(&mut payload))
            .map_err(SessionError::Encode)?;
        self.len = payload.as_bytes().len();
        self.finish(now);
        Ok(())
    }

    /// The instruction could not be executed: the answer is an error code.
    ///
    /// # Errors
    /// Nothing is being executed.
    pub fn refuse(&mut self, now: Duration, refusal: Refusal) -> Result<(), SessionError> {
        if self.state != ControllerState::Executing {
            return Err(SessionError::NotExecuting);
        }
        self.write_word(self.config.words.errors().code(refusal));
        self.finish(now);
        Ok(())
    }

    /// The queue's end, to clear it or to look at its room.
    pub fn queue(&mut self) -> &mut Writer<'q, T> {
        &mut self.queue
    }

    fn finish(&mut self, now: Duration) {
        self.event = None;
        (self.state, _) = self.state.on(ControllerInput::Done);
        self.due = timing::end_of_tick(now, self.config.tick);
        self.drain(now);
    }

    /// Reads the frames that are there, until one is to be executed.
    fn drain(&mut self, now: Duration) {
        while self.state != ControllerState::Executing {
            let Some(frame) = self.decoder.next_frame() else { return };
            match frame {
                Ok(frame) => {
                    (self.fault, self.heard) = (None, 0);
                    match judge(frame.items(), &self.config, &mut self.queue) {
                        Ok(Verdict::Queued { word, count }) => {
                            self.decide(now, ControllerInput::Decided, Ok((word, count)));
                        }
                        Ok(Verdict::Execute { class, instruction }) => {
                            let parameters = instruction.parameters.as_bytes();
                            (self.class, self.word, self.len) = (class, instruction.word, parameters.len());
                            if let Some(slot) = self.payload.get_mut(..parameters.len()) {
                                slot.copy_from_slice(parameters);
                            }
                            (self.state, _) = self.state.on(ControllerInput::Immediate);
                            self.event = Some(Event::Execute);
                        }
                        Err(refusal) => self.decide(now, ControllerInput::Decided, Err(refusal)),
                    }
                }
                Err(DecodeError::Checksum { .. }) => self.damage(Refusal::BadChecksum),
                Err(_) => self.damage(Refusal::BadFrame),
            }
        }
    }

    /// Remembers the first damage of a stretch, unless a frame of the same stretch is being answered.
    fn damage(&mut self, refusal: Refusal) {
        if self.state == ControllerState::Listening {
            self.fault.get_or_insert(refusal);
        }
    }

    /// Prepares the answer: an echo, or an error code.
    fn decide(&mut self, now: Duration, input: ControllerInput, outcome: Result<(u16, u8), Refusal>) {
        let (state, action) = self.state.on(input);
        self.state = state;
        if action != ControllerAction::Answer {
            return;
        }
        let (word, event) = match outcome {
            Ok((word, count)) => (word, Event::Queued(count)),
            Err(refusal) => (self.config.words.errors().code(refusal), Event::Refused(refusal)),
        };
        self.write_word(word);
        self.event = Some(event);
        self.due = timing::end_of_tick(now, self.config.tick);
    }

    fn write_word(&mut self, word: u16) {
        let mut payload = Payload::new(&mut self.payload, &self.config.profile);
        // A word always fits.
        let _ = payload.word(word);
        self.len = payload.as_bytes().len();
    }

    /// Bytes are coming in that may become a frame.
    fn is_hearing(&self) -> bool {
        self.silent_at.is_some() && !self.decoder.is_empty()
    }
}

impl Default for ControllerConfig {
    fn default() -> Self {
        Self {
            profile: Profile::default(),
            words: Words::default(),
            batch: 7,
            tick: timing::TICK,
            silence: Duration::from_millis(50),
        }
    }
}

#[derive(Debug, Clone, Copy)]
enum Event {
    Queued(u8),
    Execute,
    Refused(Refusal),
}

enum Verdict<'a> {
    Queued { word: u16, count: u8 },
    Execute { class: Class, instruction: Instruction<'a> },
}

/// What a good frame is answered with. Interpreted instructions are queued on the way: all of them, or none.
fn judge<'a, T>(
    items: Items<'a>,
    config: &ControllerConfig,
    queue: &mut Writer<'_, T>,
) -> Result<Verdict<'a>, Refusal>
where
    T: for<'i> TryFrom<Instruction<'i>>,
{
    let instruction = Instruction::single(items).map_err(|_| Refusal::BadFrame)?;
    let word = instruction.word;
    let class = config.words.class(word).ok_or(Refusal::UnknownCommand)?;
    if class != Class::Interpreted {
        return Ok(Verdict::Execute { class, instruction });
    }
    let mut count = 0u8;
    for instruction in Instructions::new(items) {
        let instruction = instruction.map_err(|_| Refusal::BadFrame)?;
        match config.words.class(instruction.word) {
            Some(Class::Interpreted) if count < config.batch => count += 1,
            Some(_) => return Err(Refusal::BadBatch),
            None => return Err(Refusal::UnknownCommand),
        }
        T::try_from(instruction).map_err(|_| Refusal::BadParameters)?;
    }
    // Only this end fills the queue: what is free now stays free.
    if queue.free() < usize::from(count) {
        return Err(Refusal::QueueFull);
    }
    for instruction in Instructions::new(items).flatten() {
        if let (Ok(job), Ok(claim)) = (T::try_from(instruction), queue.claim()) {
            claim.push(job);
        }
    }
    Ok(Verdict::Queued { word, count })
}
