//! The host: the PC that sends instructions and learns whether they were taken.

mod buffers;
mod config;
mod link;
pub mod machine;

use core::time::Duration;

use robot_session::end::{Core, CoreOf, Echo, End, EventQueue, QueueSpace};
use robot_session::{Decoder as _, EchoError, Encode as _, Unexpected};

use self::buffers::{Buffer, Buffers};
pub use self::config::HostConfig;
#[doc(hidden)]
pub use self::config::Rule;
use self::machine::{Action, Batch, DueFrame, HostLink, HostMachine, Input, Outcome, UnknownReason};
use crate::decoder::Decoder;
use crate::error::{ConfigError, DecodeError, EncodeError, SessionError};
use crate::frame::Frame;
use crate::instruction::{Instruction, word_of};
use crate::items::Items;
use crate::payload::Payload;
use crate::timing;
use crate::words::{Class, Refusal};

/// The host (上位机): sends one frame at a time, compares the echo, resends from its backup (§3(4), §3(5)).
///
/// [`submit`](Self::submit) instructions until it returns [`SessionError::Full`]; drive it as every
/// [`Session`](robot_session::Session).
///
/// - Interpreted instructions that are submitted while a frame is in flight travel together in the next one, up to
///   [`batch`](HostConfig::batch); immediate instructions and queries travel alone.
/// - A bad checksum, a bad frame and a full queue prove that nothing of the frame was queued: it is resent, up to
///   [`resends`](HostConfig::resends) times. Other error codes refuse it for good. An immediate instruction whose execution
///   failed may have had effects: its outcome is [`Unknown`](HostEvent::Unknown).
/// - Silence proves nothing, because frames have no number: the answer may have been lost. The outcome is unknown, and so
///   is that of an answer with another command word.
/// - After an error code and after an unknown outcome nothing is sent until every possible effect of the frame has occurred. The
///   first frame of a connection waits until the same holds for frames of an earlier host.
/// - After `Refused` and `Unknown` nothing is sent until [`resume`](Self::resume), so that the caller can check first.
/// - Corrupt bytes are skipped and reported. An unsolicited answer is reported: it is the only sign that an assumption
///   of [`HostConfig`] is wrong.
/// - There is one outcome for each frame, and nothing is sent before it has been taken. Instructions that were submitted but
///   not sent when a connection is lost are sent on the next.
#[derive(Debug, Clone)]
pub struct Host {
    core: CoreOf<Self>,
    echo: Echo<{ Frame::MAX_LEN }>,
    /// The frame that is being filled, and the one in flight (备份), which is kept until its answer has come.
    frames: Buffers,
    /// The values of the query that was answered last.
    answer: Buffer,
}

/// The events. Instructions are numbered as they were submitted, from 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "event", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum HostEvent {
    /// The controller echoed the command word: interpreted instructions are queued (not yet executed), an immediate one is
    /// executed.
    Done {
        /// The number of the first instruction, from 0.
        first: u64,
        /// The number of instructions of the frame, from 1.
        count: u8,
        /// The number of times that the frame was resent.
        resends: u8,
        /// The number of earlier transmissions without an answer: each may have been queued as well. 0 unless
        /// [`resend_on_silence`](HostConfig::resend_on_silence) is on.
        unanswered: u8,
    },
    /// A query was answered: its values are in [`Host::answer`] until the next one is.
    Answer {
        /// The number of the query, from 0.
        ticket: u64,
    },
    /// Only error codes: nothing of the frame was queued.
    Refused {
        /// The number of the first instruction, from 0.
        first: u64,
        /// The number of instructions of the frame, from 1.
        count: u8,
        /// The error code that came last.
        refusal: Refusal,
    },
    /// The instructions may have been queued or not, but not more than once unless
    /// [`resend_on_silence`](HostConfig::resend_on_silence) is on.
    Unknown {
        /// The number of the first instruction, from 0.
        first: u64,
        /// The number of instructions of the frame, from 1.
        count: u8,
        /// The reason that the outcome is unknown.
        reason: UnknownReason,
    },
    /// A notice: an unsolicited answer. An assumption of [`HostConfig`] is wrong, or another host talks to the
    /// controller.
    Unasked {
        /// The command word or error code of the answer.
        word: u16,
    },
    /// A notice: bytes that are not an answer.
    #[cfg_attr(feature = "serde", serde(serialize_with = "robot_session::under::error"))]
    Corrupt(DecodeError),
    /// A notice: the line returns the sent bytes, and [`echo`](HostConfig::echo) is off; or it is on, and other bytes came back.
    #[cfg_attr(feature = "serde", serde(serialize_with = "robot_session::under::error"))]
    Echo(EchoError),
    /// A notice: a call that is invalid in this state.
    Unexpected(Unexpected),
}

robot_session::counters! {
    /// Counters of a host.
    pub struct HostStatistics {
        /// Instructions submitted: also the number of the next one.
        pub submitted: u64,
        /// Frames sent, again or for the first time.
        pub frames: u64,
        /// Frames sent again.
        pub resends: u64,
        /// Unsolicited answers.
        pub unasked: u64,
        /// Runs of corrupt bytes.
        pub corrupt: u64,
    }
}

const EVENTS: usize = 8;

impl Host {
    /// Creates a host without a connection.
    ///
    /// # Errors
    /// An invalid configuration.
    pub fn new(config: HostConfig) -> Result<Self, ConfigError> {
        config.check()?;
        let core = Core::new(config, HostMachine::NEW, Decoder::new(&config.profile));
        Ok(Self { core, echo: Echo::new(config.echo), frames: Buffers::EMPTY, answer: Buffer::EMPTY })
    }

    /// Adds an instruction to the next frame; returns its number in events: 0, 1, 2 …
    ///
    /// `parameters` writes the items after the command word. In an interpreted instruction no item may be a single short,
    /// because that begins the next instruction. In other instructions a single short must not be a command word.
    ///
    /// # Errors
    /// [`SessionError::Full`] if the instruction does not fit the frame, or would mix classes: call again when the
    /// frame has been sent. A word that is not a command, and parameters that do not fit a frame. A failed call has
    /// no effect.
    pub fn submit(
        &mut self,
        word: u16,
        parameters: impl FnOnce(&mut Payload<'_>) -> Result<(), EncodeError>,
    ) -> Result<u64, SessionError> {
        let Core { config, machine, .. } = &self.core;
        let class = config.words.class(word).ok_or(SessionError::UnknownWord { word })?;
        if !machine.has_room(class, config) {
            return Err(SessionError::Full);
        }
        let next = self.frames.next_mut();
        let begin = if machine.next.is_some() { next.len.into() } else { 0 };
        let mut payload = Payload::with_len(&mut next.bytes, begin, &config.profile);
        let written = payload.word(word).map(drop).and_then(|()| parameters(&mut payload));
        let len = payload.as_bytes().len();
        match written {
            Err(EncodeError::BufferTooSmall { .. }) if begin > 0 => return Err(SessionError::Full),
            Err(error) => return Err(SessionError::Encode(error)),
            Ok(()) => {}
        }
        let instruction = next.bytes.get(begin..len).unwrap_or_default();
        let shorts = Items::new(instruction, &config.profile).flatten().skip(1);
        let mut shorts = shorts.filter_map(|item| word_of(&item));
        if shorts.any(|word| class == Class::Interpreted || config.words.class(word).is_some()) {
            return Err(SessionError::LoneShort);
        }
        next.set_len(len);
        let ticket = self.core.statistics.submitted;
        self.core.statistics.submitted += 1;
        self.advance(Duration::ZERO, Input::Submit { ticket, word, class }, None);
        Ok(ticket)
    }

    /// Continues after `Refused` or `Unknown`. Instructions submitted meanwhile are sent when the line has settled.
    pub fn resume(&mut self) {
        self.advance(Duration::ZERO, Input::Resume, None);
    }

    /// Withdraws the instructions that are not yet sent; returns their number. They will have no event.
    pub fn take_back(&mut self) -> u8 {
        let count = self.core.machine.next.map_or(0, |next| next.count);
        self.advance(Duration::ZERO, Input::TakeBack, None);
        count
    }

    /// Returns the values of the query that was answered last.
    pub fn answer(&self) -> Items<'_> {
        Items::new(self.answer.as_bytes(), &self.core.config.profile)
    }

    /// Returns whether the host waits for [`resume`](Self::resume).
    pub fn is_held(&self) -> bool {
        matches!(self.core.machine.link, HostLink::Held { .. } | HostLink::Disconnected { held: true, .. })
    }

    /// Returns whether nothing is submitted, in flight or unreported.
    pub fn is_idle(&self) -> bool {
        matches!(self.core.machine.link, HostLink::Idle { .. } | HostLink::Disconnected { held: false, .. })
            && self.core.machine.next.is_none()
            && self.core.events.has_room(EVENTS)
    }

    /// Reports the event of a frame's outcome.
    fn report(&mut self, batch: Batch, outcome: Outcome) {
        let (first, count) = (batch.first, batch.count);
        self.core.push_outcome(match outcome {
            Outcome::Done { .. } if batch.class == Class::Query => HostEvent::Answer { ticket: first },
            Outcome::Done { resends, unanswered } => HostEvent::Done { first, count, resends, unanswered },
            Outcome::Refused(refusal) => HostEvent::Refused { first, count, refusal },
            Outcome::Unknown(reason) => HostEvent::Unknown { first, count, reason },
        });
    }
}

impl End for Host {
    type Machine = HostMachine;
    type Decoder = Decoder;
    type Events = EventQueue<HostEvent, EVENTS>;
    type Statistics = HostStatistics;
    type Payload = ();

    const LINK: &'static str = "laser-eb90";
    const END: &'static str = "host";
    const MAX_INPUT: usize = Frame::MAX_LEN;
    const MAX_TRANSMIT: usize = Frame::MAX_LEN;
    const QUEUE_SPACE: QueueSpace = QueueSpace { connect: 0, read: 0, transmit: EVENTS };

    robot_session::core!(HostEvent::Unexpected);
    robot_session::echo!(HostEvent::Echo);

    fn discards_after(&self) -> Option<Duration> {
        Some(self.core.config.answer_timeout)
    }

    fn next_input(&mut self) -> Option<(Input, Option<()>)> {
        let mut frame = self.core.decoder.next_frame()?;
        while frame.is_ok_and(|frame| self.core.machine.is_in_flight() && is_own(&frame, self.frames.last()))
        {
            let sent = Frame::new(self.frames.last().as_bytes(), &self.core.config.profile);
            if let Some(error) = self.echo.found(sent.encoded_len()) {
                self.core.events.push_notice(HostEvent::Echo(error));
            }
            frame = self.core.decoder.next_frame()?;
        }
        let input = match frame.and_then(|frame| Instruction::single(frame.items())) {
            Ok(Instruction { word, parameters }) => {
                if self.core.machine.is_asked(word) {
                    self.answer.copy(parameters.as_bytes());
                }
                Input::Answer { word, refusal: self.core.config.words.errors().refusal(word) }
            }
            Err(error) => {
                self.core.statistics.corrupt += 1;
                self.core.events.push_notice(HostEvent::Corrupt(error));
                Input::Corrupt
            }
        };
        Some((input, None))
    }

    #[inline]
    fn act(&mut self, _: Duration, action: Action, _: Option<()>) {
        match action {
            Action::Nothing => {}
            Action::Sent(due) => {
                // Bytes that came before this frame are not an answer to it.
                self.core.decoder.clear();
                self.core.statistics.frames += 1;
                match due {
                    DueFrame::Next => self.frames.swap(),
                    DueFrame::Again => self.core.statistics.resends += 1,
                }
            }
            Action::Report(batch, outcome) => self.report(batch, outcome),
            Action::Unasked { word } => {
                self.core.statistics.unasked += 1;
                self.core.events.push_notice(HostEvent::Unasked { word });
            }
        }
    }

    fn write(&mut self, _: Duration, due: DueFrame, out: &mut [u8]) -> Option<(usize, Input)> {
        let frame = match due {
            DueFrame::Next => self.frames.next(),
            DueFrame::Again => self.frames.last(),
        };
        let config = &self.core.config;
        let len = Frame::new(frame.as_bytes(), &config.profile).encode(out).ok()?;
        // Where the echo is not known yet, `next_input` finds it as a frame.
        self.echo.sent(out.get(..len).unwrap_or_default(), false);
        Some((len, Input::Sent { line: timing::transmission_time(len, config.baud) }))
    }

    fn transmitted(&mut self, now: Duration) {
        self.advance(now, Input::Transmitted, None);
    }
}

/// Returns whether a frame is the frame that was sent, returned by the line: an answer has one item, unless it has values.
fn is_own(frame: &Frame<'_>, sent: &Buffer) -> bool {
    frame.payload() == sent.as_bytes() && frame.items().count() > 1
}
