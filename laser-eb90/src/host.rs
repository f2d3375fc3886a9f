//! The host: the PC that sends instructions and hears whether they were taken.

use core::time::Duration;

use crate::decoder::Decoder;
use crate::error::{DecodeError, EncodeError, SessionError};
use crate::frame::{Frame, MAX_PAYLOAD};
use crate::instruction::{Class, Instruction, Refusal, Words, word_of};
use crate::message::{Items, Payload};
use crate::profile::Profile;
use crate::state::{HostAction, HostInput, HostState};
use crate::timing;

/// The host (上位机): sends one frame at a time, compares the echo, resends from its backup (§3(4), §3(5)).
///
/// [`submit`](Self::submit) instructions until it says [`SessionError::Full`]; whenever bytes arrive call
/// [`handle_input`](Self::handle_input), when the time of [`poll_timeout`](Self::poll_timeout) has come
/// [`handle_timeout`](Self::handle_timeout); after any of them [`poll_event`](Self::poll_event) until it gives `None`, then
/// [`poll_transmit`](Self::poll_transmit).
///
/// - Interpreted instructions that are submitted while a frame is on its way travel together in the next one, up to
///   [`batch`](HostConfig::batch); immediate instructions and queries travel alone.
/// - An error code proves that nothing of the frame was taken: it is sent again, up to [`resends`](HostConfig::resends) times.
///   Silence proves nothing, because the frames have no number: what was lost may be the answer. Its outcome is
///   [`Unknown`](HostEvent::Unknown), and so is that of an answer with another command word.
/// - After `Refused` and `Unknown` nothing is sent until [`resume`](Self::resume), so that the caller can look first.
/// - Damaged bytes in an answer are skipped; what was wrong is the cause in [`Doubt::Damaged`] when nothing better follows.
///   What the controller says while nothing is awaited is ignored.
/// - There is one event for each frame, and nothing is sent before it has been taken: no event is ever lost.
#[derive(Debug, Clone)]
pub struct Host {
    config: HostConfig,
    decoder: Decoder,
    state: HostState,
    /// The frame that is being filled.
    forming: Batch,
    /// The frame on its way (备份): kept until its answer has come.
    backup: Batch,
    outcome: Option<Outcome>,
    /// The values of a query's answer.
    answer: [u8; MAX_PAYLOAD],
    answer_len: usize,
    /// When the answer is overdue.
    deadline: Duration,
    /// The time that the frame takes on the line.
    line_time: Duration,
    /// Nothing is sent before.
    quiet_until: Duration,
    /// Since when the controller's queue has been full.
    full_since: Option<Duration>,
    fault: Option<DecodeError>,
    next_ticket: u64,
}

/// How the host behaves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct HostConfig {
    /// How frames are written.
    pub profile: Profile,
    /// Command words and error codes.
    pub words: Words,
    /// The line's baud rate: an answer cannot be awaited before the frame has left. Default: 9600.
    pub baud: u32,
    /// How many interpreted instructions a frame holds at most. Default: 7, as in the source (§3(6)); at least 1.
    pub batch: u8,
    /// How often a frame that an error code answers is sent again. Default: 3; the source gives no limit.
    pub resends: u8,
    /// Sends a frame again when no answer comes, up to the same limit: whatever it holds may then be executed several
    /// times. Default: off.
    pub resend_on_silence: bool,
    /// From the frame's last byte to the answer of interpreted instructions. Default: 250 ms, which holds the controller's
    /// cycle, its silence before an error code, and a short answer at 9600 baud.
    pub answer_timeout: Duration,
    /// From the frame's last byte to the answer of an immediate instruction or a query, which is executed first. Set it
    /// above the longest execution. Default: 30 s.
    pub execution_timeout: Duration,
    /// How long the line is left alone after an error code or an unknown outcome, and what comes meanwhile ignored: a
    /// second error code for the same damage must not be taken for the next frame's. It counts from the time that the frame
    /// takes once more: where a PC paused within a frame, the rest may still be on its way. Above the controller's silence,
    /// cycle and answer together. Default: 100 ms.
    pub settle: Duration,
    /// How long to wait when the controller's queue is full. Default: 100 ms.
    pub backoff: Duration,
    /// How long the queue may stay full before the frame counts as refused. Default: 60 s.
    pub full_timeout: Duration,
}

/// What became of a frame. Instructions are counted as they were submitted, from 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum HostEvent<'a> {
    /// The controller echoed the command word: interpreted instructions are queued (not yet executed), an immediate one is
    /// executed.
    Done {
        /// The first instruction.
        first: u64,
        /// How many.
        count: u8,
        /// How often the frame was sent again.
        resends: u8,
        /// How many of the transmissions before brought no answer: each may have been taken as well. 0 unless
        /// [`resend_on_silence`](HostConfig::resend_on_silence) is on.
        unanswered: u8,
    },
    /// The answer to a query.
    Answer {
        /// The query.
        ticket: u64,
        /// Its values.
        values: Items<'a>,
    },
    /// Error codes to the end: nothing of the frame was taken.
    Refused {
        /// The first instruction.
        first: u64,
        /// How many.
        count: u8,
        /// The last error code.
        refusal: Refusal,
    },
    /// The instructions may have been taken or not. Nobody can tell from here.
    Unknown {
        /// The first instruction.
        first: u64,
        /// How many.
        count: u8,
        /// Why.
        cause: Doubt,
    },
}

/// Why an outcome is unknown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Doubt {
    /// No byte came.
    Silence,
    /// Bytes came, but no answer.
    Damaged(DecodeError),
    /// The answer was another word than the command's.
    OtherWord {
        /// The command word that was sent.
        expected: u16,
        /// The word that came back.
        found: u16,
    },
}

impl Host {
    /// A host that has sent nothing yet.
    pub fn new(config: HostConfig) -> Self {
        Self {
            config,
            decoder: Decoder::new(&config.profile),
            state: HostState::Idle,
            forming: Batch::EMPTY,
            backup: Batch::EMPTY,
            outcome: None,
            answer: [0; MAX_PAYLOAD],
            answer_len: 0,
            deadline: Duration::ZERO,
            line_time: Duration::ZERO,
            quiet_until: Duration::ZERO,
            full_since: None,
            fault: None,
            next_ticket: 0,
        }
    }

    /// Adds an instruction to the next frame; returns the number that events know it by: 0, 1, 2 …
    ///
    /// `parameters` writes what goes behind the command word. In an interpreted instruction no item may be a single short:
    /// that begins the next instruction.
    ///
    /// # Errors
    /// [`SessionError::Full`] when the frame has no room, or would mix classes: call again when it has been sent. A word
    /// that is no command, and parameters that no frame can carry. Nothing has changed then.
    pub fn submit(
        &mut self,
        word: u16,
        parameters: impl FnOnce(&mut Payload<'_>) -> Result<(), EncodeError>,
    ) -> Result<u64, SessionError> {
        let class = self.config.words.class(word).ok_or(SessionError::UnknownWord { word })?;
        let forming = &mut self.forming;
        let room = match (forming.class, class) {
            _ if forming.count == 0 => true,
            (Class::Interpreted, Class::Interpreted) => forming.count < self.config.batch,
            _ => false,
        };
        if !room {
            return Err(SessionError::Full);
        }
        let mut payload = Payload::with_len(&mut forming.payload, forming.len, &self.config.profile);
        let written = payload.word(word).map(drop).and_then(|()| parameters(&mut payload));
        let len = payload.as_bytes().len();
        match written {
            Err(EncodeError::BufferTooSmall { .. }) if forming.count > 0 => return Err(SessionError::Full),
            Err(error) => return Err(SessionError::Encode(error)),
            Ok(()) => {}
        }
        let instruction = forming.payload.get(forming.len..len).unwrap_or_default();
        let mut items = Items::new(instruction, &self.config.profile).flatten().skip(1);
        if class == Class::Interpreted && items.any(|item| word_of(&item).is_some()) {
            return Err(SessionError::LoneShort);
        }
        if forming.count == 0 {
            forming.first = self.next_ticket;
            forming.word = word;
            forming.class = class;
        }
        forming.len = len;
        forming.count += 1;
        self.next_ticket += 1;
        Ok(self.next_ticket - 1)
    }

    /// Takes bytes from the line.
    pub fn handle_input(&mut self, now: Duration, mut bytes: &[u8]) {
        while self.state == HostState::Awaiting && !bytes.is_empty() {
            let taken = self.decoder.push(bytes);
            bytes = bytes.get(taken..).unwrap_or_default();
            while let Some(frame) = self.decoder.next_frame() {
                match frame.and_then(|frame| Instruction::single(frame.items())) {
                    Ok(answer) => {
                        let values = answer.parameters.as_bytes();
                        self.answer_len = values.len();
                        if let Some(slot) = self.answer.get_mut(..values.len()) {
                            slot.copy_from_slice(values);
                        }
                        let word = answer.word;
                        return self.take(now, word);
                    }
                    Err(error) => self.fault = Some(error),
                }
            }
        }
    }

    /// Lets time pass: the answer may be overdue.
    pub fn handle_timeout(&mut self, now: Duration) {
        if self.state != HostState::Awaiting || now < self.deadline {
            return;
        }
        self.decoder.finish();
        if let Some(Err(error)) = self.decoder.next_frame() {
            self.fault = Some(error);
        }
        let again = self.config.resend_on_silence && self.backup.resends < self.config.resends;
        if again {
            self.backup.resends += 1;
            self.backup.unanswered += 1;
        }
        let input = if again { HostInput::RetriedSilence } else { HostInput::Silence };
        let cause = self.fault.map_or(Doubt::Silence, Doubt::Damaged);
        self.advance(now, input, Refusal::BadFrame, cause);
    }

    /// Writes the next frame when it is due; returns its length. `out` needs [`Frame::MAX_LEN`] bytes: a frame that does
    /// not fit waits.
    pub fn poll_transmit(&mut self, now: Duration, out: &mut [u8]) -> Option<usize> {
        self.handle_timeout(now);
        if !self.may_send() || now < self.quiet_until {
            return None;
        }
        let batch = if self.state == HostState::Idle { &self.forming } else { &self.backup };
        let len = Frame::new(batch.payload.get(..batch.len)?, &self.config.profile).encode(out).ok()?;
        if self.state == HostState::Idle {
            core::mem::swap(&mut self.forming, &mut self.backup);
            self.forming.clear();
            self.full_since = None;
        }
        // Whatever came before this frame is no answer to it.
        self.decoder.clear();
        self.fault = None;
        let timeout = match self.backup.class {
            Class::Interpreted => self.config.answer_timeout,
            Class::Immediate | Class::Query => self.config.execution_timeout,
        };
        self.line_time = timing::transmission_time(len, self.config.baud);
        self.deadline = now.saturating_add(self.line_time).saturating_add(timeout);
        self.advance(now, HostInput::Send, Refusal::BadFrame, Doubt::Silence);
        Some(len)
    }

    /// What became of the frame, once it is known.
    pub fn poll_event(&mut self) -> Option<HostEvent<'_>> {
        let outcome = self.outcome.take()?;
        let Batch { first, count, resends, unanswered, .. } = self.backup;
        Some(match outcome {
            Outcome::Confirmed if self.backup.class == Class::Query => {
                let values = self.answer.get(..self.answer_len).unwrap_or_default();
                HostEvent::Answer { ticket: first, values: Items::new(values, &self.config.profile) }
            }
            Outcome::Confirmed => HostEvent::Done { first, count, resends, unanswered },
            Outcome::Refused(refusal) => HostEvent::Refused { first, count, refusal },
            Outcome::Unknown(cause) => HostEvent::Unknown { first, count, cause },
        })
    }

    /// When to call [`handle_timeout`](Self::handle_timeout) or [`poll_transmit`](Self::poll_transmit) at the latest; `None`
    /// when only the caller can make something happen.
    pub fn poll_timeout(&self) -> Option<Duration> {
        match self.state {
            HostState::Awaiting => Some(self.deadline),
            HostState::Idle | HostState::Resending => self.may_send().then_some(self.quiet_until),
            HostState::Held => None,
        }
    }

    /// Goes on after `Refused` or `Unknown`. What has been submitted meanwhile is sent when the line has settled.
    pub fn resume(&mut self) {
        (self.state, _) = self.state.on(HostInput::Resume);
    }

    /// Takes back the instructions that have not been sent yet; returns how many. They will have no event.
    pub fn take_back(&mut self) -> u8 {
        let count = self.forming.count;
        self.forming.clear();
        count
    }

    /// Whether the host waits for [`resume`](Self::resume).
    pub fn is_held(&self) -> bool {
        self.state == HostState::Held
    }

    /// Whether nothing is submitted, on its way or unreported.
    pub fn is_idle(&self) -> bool {
        self.state == HostState::Idle && self.forming.count == 0 && self.outcome.is_none()
    }

    fn may_send(&self) -> bool {
        match self.state {
            HostState::Idle => self.forming.count > 0 && self.outcome.is_none(),
            HostState::Resending => true,
            HostState::Awaiting | HostState::Held => false,
        }
    }

    /// An answer came.
    fn take(&mut self, now: Duration, word: u16) {
        let expected = self.backup.word;
        let other = Doubt::OtherWord { expected, found: word };
        if word == expected {
            return self.advance(now, HostInput::Echo, Refusal::BadFrame, other);
        }
        let Some(refusal) = self.config.words.errors().refusal(word) else {
            return self.advance(now, HostInput::OtherWord, Refusal::BadFrame, other);
        };
        let again = if refusal == Refusal::QueueFull {
            let since = *self.full_since.get_or_insert(now);
            now.saturating_sub(since) < self.config.full_timeout
        } else {
            let again = self.backup.resends < self.config.resends;
            self.backup.resends += u8::from(again);
            again
        };
        let input = if again { HostInput::Refusal } else { HostInput::LastRefusal };
        self.advance(now, input, refusal, other);
    }

    fn advance(&mut self, now: Duration, input: HostInput, refusal: Refusal, cause: Doubt) {
        let (state, action) = self.state.on(input);
        self.state = state;
        let pause = match refusal {
            Refusal::QueueFull => self.config.backoff,
            _ => self.line_time.saturating_add(self.config.settle),
        };
        match action {
            HostAction::Transmit | HostAction::Proceed | HostAction::Ignore => return,
            HostAction::Confirm => {
                self.outcome = Some(Outcome::Confirmed);
                return;
            }
            HostAction::Prepare => {}
            // The error code speaks of the last transmission only.
            HostAction::Refuse if self.backup.unanswered == 0 => {
                self.outcome = Some(Outcome::Refused(refusal));
            }
            HostAction::Refuse | HostAction::Doubt => self.outcome = Some(Outcome::Unknown(cause)),
        }
        self.quiet_until = now.saturating_add(pause);
    }
}

impl Default for HostConfig {
    fn default() -> Self {
        Self {
            profile: Profile::default(),
            words: Words::default(),
            baud: timing::BAUD,
            batch: 7,
            resends: 3,
            resend_on_silence: false,
            answer_timeout: Duration::from_millis(250),
            execution_timeout: Duration::from_secs(30),
            settle: Duration::from_millis(100),
            backoff: Duration::from_millis(100),
            full_timeout: Duration::from_secs(60),
        }
    }
}

/// The instructions of one frame.
#[derive(Debug, Clone)]
struct Batch {
    payload: [u8; MAX_PAYLOAD],
    len: usize,
    /// The first instruction's number and command word: the one that is answered (§3(6)).
    first: u64,
    word: u16,
    class: Class,
    count: u8,
    resends: u8,
    unanswered: u8,
}

impl Batch {
    const EMPTY: Self = Self {
        payload: [0; MAX_PAYLOAD],
        len: 0,
        first: 0,
        word: 0,
        class: Class::Interpreted,
        count: 0,
        resends: 0,
        unanswered: 0,
    };

    fn clear(&mut self) {
        (self.len, self.count, self.resends, self.unanswered) = (0, 0, 0, 0);
    }
}

#[derive(Debug, Clone, Copy)]
enum Outcome {
    Confirmed,
    Refused(Refusal),
    Unknown(Doubt),
}
