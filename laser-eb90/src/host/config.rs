//! The configuration of the host, and its assumptions about controller and line.

use core::time::Duration;

use crate::error::ConfigError;
use crate::frame::Frame;
use crate::profile::Profile;
use crate::timing;
use crate::words::{Class, Words};

/// Settings of the host, and its assumptions about controller and line.
///
/// Frames have no number, so an answer is matched to its frame by time alone: the fields marked *assumption*. If
/// one of them is wrong, an answer can be taken for another frame's. It is then followed by an unsolicited answer:
/// [`HostEvent::Unasked`](crate::HostEvent::Unasked) is the sign.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct HostConfig {
    /// The profile by which frames are written.
    pub profile: Profile,
    /// Command words and error codes.
    pub words: Words,
    /// The line's baud rate, 10 bits a byte: an answer cannot be awaited before the frame has been transmitted. Above 0.
    /// Default: 9600.
    pub baud: u32,
    /// The largest number of interpreted instructions in a frame. Default: 7, as in the source (§3(6)); at least 1.
    pub batch: u8,
    /// The number of times that a frame is resent after an error code. Default: 3; the source gives no limit.
    pub resends: u8,
    /// Resends a frame without an answer, up to the same limit: its contents may then be executed several
    /// times. Default: off.
    pub resend_on_silence: bool,
    /// From the frame's last byte to the answer of interpreted instructions. Default: 250 ms, which holds the controller's
    /// cycle, its silence before an error code, and a short answer at 9600 baud.
    pub answer_timeout: Duration,
    /// From the frame's last byte to the answer of an immediate instruction or a query, which is executed first.
    /// *Assumption:* above the longest execution. Default: 30 s.
    pub execution_timeout: Duration,
    /// *Assumption:* the latest answer after the last byte of its frame, or after the end of the
    /// execution. After an error code and after an unknown outcome nothing is sent until all of the frame has certainly been
    /// received, and for this long after that. Above the controller's silence, cycle and answer together. Default: 100 ms.
    pub settle: Duration,
    /// *Assumption:* the longest total pause of PC and line within a frame. It is unnecessary, except for the first frame of
    /// a connection, if the driver calls `handle_transmitted` before it passes on later bytes. Default: 300 ms.
    pub max_pause: Duration,
    /// *Assumption:* the longest from the controller's decision to the last byte of its answer: an error code that comes later
    /// than this after the end of the frame refers to the whole frame. Default: 40 ms.
    pub reply_time: Duration,
    /// *Assumption:* the longest frame in bytes that a host on this line sends. The first frame of a connection waits until one
    /// that an earlier host began has passed. Default: [`Frame::MAX_LEN`](crate::Frame::MAX_LEN).
    pub longest_frame: usize,
    /// *Assumption:* the longest time for which an immediate instruction or a query of an earlier host may still be executed
    /// after a connection is made: its answer could be taken for the first frame's. Default: 0; set it to the longest
    /// execution if a host may be restarted while the robot executes.
    pub earlier_execution: Duration,
    /// The controller drops a partial frame when it answers an error code, as this crate's does. Then "bad frame"
    /// always proves that nothing was queued. A controller that keeps it reads the rest after a pause as the same frame, so
    /// "bad frame" that comes early proves nothing: the outcome is
    /// [`UnknownReason::PartialFrame`](crate::UnknownReason::PartialFrame) unless the echo follows. Default: off, the safe
    /// side.
    pub controller_drops_partial: bool,
    /// The delay when the controller's queue is full. Default: 100 ms.
    pub backoff: Duration,
    /// The time for which the queue may stay full before the frame counts as refused. Default: 60 s.
    pub full_timeout: Duration,
    /// Whether the line returns the sent bytes, as adapters for two wires do. Off. The bytes of a frame come back first
    /// then: they are compared with it and dropped, and others are [`HostEvent::Echo`](crate::HostEvent::Echo), a collision.
    /// While it is off, a frame with more than one command word shows it, because an answer has only one. This is reported
    /// by the same event, and from then on the returned bytes are dropped.
    pub echo: bool,
    /// The rules of the machine, all of which are kept.
    #[cfg(feature = "model")]
    #[doc(hidden)]
    pub rules: robot_session::end::Rules<Rule>,
}

robot_session::rules! {
    /// The rules of the host's machine that are independent of settings.
    pub enum Rule for HostConfig {
        /// The first frame of a connection waits until frames of an earlier host have been answered.
        DrainFirst,
        /// An echo confirms, also after an error code.
        ConfirmLate,
        /// Only after a bad checksum, a bad frame and a full queue is a frame resent.
        FinalCodes,
        /// An immediate instruction whose execution failed has an unknown outcome.
        FailedIsUnknown,
        /// The next frame waits for a possible execution.
        OutlastExecution,
        /// An error code refers to the last transmission alone.
        UnansweredIsUnknown,
        /// A word other than the command's is not a confirmation.
        CompareWord,
    }
}

impl HostConfig {
    /// Returns the defaults for a line of this rate: below 9600 baud, the timeout of an answer is longer by the additional
    /// time of the transmission.
    pub fn at_baud(baud: u32) -> Self {
        let answer = |baud| timing::transmission_time(timing::SHORT_ANSWER, baud);
        let longer = answer(baud).saturating_sub(answer(timing::BAUD));
        let ms = |ms| Duration::from_millis(ms);
        Self {
            profile: Profile::default(),
            words: Words::default(),
            baud,
            batch: 7,
            resends: 3,
            resend_on_silence: false,
            answer_timeout: ms(250).saturating_add(longer),
            execution_timeout: ms(30_000).saturating_add(longer),
            settle: ms(100).saturating_add(longer),
            max_pause: ms(300),
            reply_time: ms(40).saturating_add(longer),
            longest_frame: Frame::MAX_LEN,
            earlier_execution: Duration::ZERO,
            controller_drops_partial: false,
            backoff: ms(100),
            full_timeout: ms(60_000),
            echo: false,
            #[cfg(feature = "model")]
            rules: robot_session::end::Rules::ALL,
        }
    }

    pub(crate) fn check(&self) -> Result<(), ConfigError> {
        match self {
            Self { batch: 0, .. } => Err(ConfigError::NoBatch),
            Self { baud: 0, .. } => Err(ConfigError::NoBaud),
            _ => Ok(()),
        }
    }

    /// Returns the execution time of an instruction before its answer.
    pub(crate) fn execution(&self, class: Class) -> Duration {
        match class {
            Class::Interpreted => Duration::ZERO,
            Class::Immediate | Class::Query => self.execution_timeout,
        }
    }

    /// Returns the timeout of an answer.
    pub(crate) fn timeout(&self, class: Class) -> Duration {
        match class {
            Class::Interpreted => self.answer_timeout,
            Class::Immediate | Class::Query => self.execution_timeout,
        }
    }

    /// Returns the time for which frames of an earlier host can still have effects.
    pub(crate) fn drain(&self) -> Duration {
        timing::transmission_time(self.longest_frame, self.baud)
            .saturating_add(self.max_pause)
            .saturating_add(self.earlier_execution)
            .saturating_add(self.settle)
    }
}

impl Default for HostConfig {
    fn default() -> Self {
        Self::at_baud(timing::BAUD)
    }
}
