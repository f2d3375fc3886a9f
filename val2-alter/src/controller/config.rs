//! The controller's configuration, events and counters.

use core::time::Duration;

use robot_session::Unexpected;

use crate::error::ConfigError;
use crate::framing::Framing;
use crate::message::{AXES, Accumulation, ErrorCode, Exception, HostMessage, List, Mode, Reply};
use crate::timing::{self, Budget};

/// The configuration of a [`Controller`](crate::Controller): the ALTER instruction and the line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ControllerConfig {
    /// The envelope of the messages. Default: [`Framing::DEFAULT`].
    pub framing: Framing,
    /// The line's baud rate: the reply window opens when the request has left, and bytes that arrive before are not a reply
    /// to it. Default: 38400.
    pub baud: u32,
    /// The mode of the ALTER instruction. Default: 23.
    pub mode: Mode,
    /// The data list of the ALTER instruction. Default: empty.
    pub data: List,
    /// Whether the ALTER instruction has an exception subroutine; without one, an exception aborts the program. Default: no.
    pub subroutine: bool,
    /// Start messages sent before giving up, from 1. Default: 3. (The source has "up to twice repeated" in one place and "after
    /// the third repetition" in another; set 4 for the second reading.)
    pub attempts: u8,
    /// The meaning of a value that a reply does not transmit. Default: [`Unselected::ByMode`].
    pub unselected: Unselected,
    /// The silence inside a frame that ends the frame; `None`: no silence does. Default: 4 ms.
    pub gap: Option<Duration>,
    /// The rules of its machine that are in force.
    #[cfg(feature = "model")]
    #[doc(hidden)]
    pub rules: robot_session::end::Rules<Rule>,
}

robot_session::rules! {
    /// A rule of the controller's machine, which the model can disable to show that it is needed.
    pub enum Rule for ControllerConfig {
        /// An interruption is in one message at least.
        ReportInterruption,
        /// Bytes that arrive while the message is still on the line are not an answer to it.
        AfterRequest,
        /// Only the first reply of a window counts.
        FirstReply,
        /// A missing reply ends ALTER.
        EndOnMissing,
        /// While the subroutine runs no exception starts it again.
        OneSubroutine,
        /// An unread start message is sent again.
        Attempts,
        /// The arm does not move while the subroutine runs.
        RestInterrupted,
    }
}

impl ControllerConfig {
    pub(super) fn check(&self) -> Result<(), ConfigError> {
        if self.attempts == 0 {
            return Err(ConfigError::Attempts);
        }
        let request = timing::min_request_len(self.mode.has_transform(), self.framing);
        let reply = timing::min_reply_len(1, self.framing);
        let budget = Budget::new(self.mode.accumulation(), self.baud, request, reply);
        let window = ConfigError::Window { baud: self.baud, mode: self.mode.0 };
        budget.slack().map(|_| ()).ok_or(window)
    }
}

impl Default for ControllerConfig {
    /// Returns the configuration of `ALTER(0, 23)`, without a subroutine, on the source's line.
    fn default() -> Self {
        Self {
            framing: Framing::DEFAULT,
            baud: timing::BAUD,
            mode: Mode::CUMULATIVE_23,
            data: List::EMPTY,
            subroutine: false,
            attempts: 3,
            unselected: Unselected::default(),
            gap: Some(Duration::from_millis(4)),
            #[cfg(feature = "model")]
            rules: robot_session::end::Rules::ALL,
        }
    }
}

/// The treatment of a value that a reply does not transmit.
///
/// The source: "Im kumulativen Betrieb wird jedes nicht übertragene Datenwort von VAL-II intern unverändert gelassen.
/// Anfangs werden alle Werte als Null angenommen" (§3.3.2). Taken literally, an increment would then repeat without end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Unselected {
    /// Cumulative: zero, nothing moves. Non-cumulative: as before, the offset stays.
    #[default]
    ByMode,
    /// As before, in both modes: the words of the source.
    Hold,
    /// Zero in both modes.
    Zero,
}

impl Unselected {
    /// Returns whether a word that is not transmitted keeps its value.
    pub fn holds(self, accumulation: Accumulation) -> bool {
        match self {
            Self::ByMode => accumulation == Accumulation::NonCumulative,
            Self::Hold => true,
            Self::Zero => false,
        }
    }
}

/// An event of a [`Controller`](crate::Controller). Each start ends in `Refused`, `GaveUp` or `Ended`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "event", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum ControllerEvent {
    /// The host accepted: standard messages follow.
    Started,
    /// The host refused: the program ends with an error.
    Refused,
    /// No start message was accepted.
    GaveUp,
    /// A reply was accepted in its window.
    Reply {
        /// The reply as it came.
        #[cfg_attr(feature = "serde", serde(rename = "message", serialize_with = "message"))]
        reply: Reply,
        /// The effect on the arm: the increments of this cycle (cumulative), or the offset of the arm from the path
        /// (non-cumulative). While the exception subroutine runs, a reply has no effect.
        values: [i16; AXES],
    },
    /// A reply or an answer to a start message could not be read, or did not come; the next message reports it to the host.
    #[cfg_attr(feature = "serde", serde(serialize_with = "robot_session::under::error"))]
    BadReply(ErrorCode),
    /// The exception subroutine begins: call [`Controller::resume`](crate::Controller::resume) when it returns.
    #[cfg_attr(feature = "serde", serde(serialize_with = "exception"))]
    Exception(Exception),
    /// An exception came, and the program has no subroutine for it: the program is aborted.
    #[cfg_attr(feature = "serde", serde(serialize_with = "exception"))]
    Aborted(Exception),
    /// ALTER is over, the arm is at rest: the end message was sent, or the port is gone.
    #[cfg_attr(feature = "serde", serde(serialize_with = "robot_session::under::error"))]
    Ended(ErrorCode),
    /// A message that no window was open for: late, early, or one too many. It has no effect.
    #[cfg_attr(feature = "serde", serde(serialize_with = "robot_session::under::message"))]
    Stray(HostMessage),
    /// A call that the contract does not allow, or an input that the machine did not expect. It has no effect.
    Unexpected(Unexpected),
}

#[cfg(feature = "serde")]
fn message<S: serde::Serializer>(reply: &Reply, serializer: S) -> Result<S::Ok, S::Error> {
    serde::Serialize::serialize(&HostMessage::Reply(*reply), serializer)
}

#[cfg(feature = "serde")]
fn exception<S: serde::Serializer>(exception: &Exception, serializer: S) -> Result<S::Ok, S::Error> {
    robot_session::under::name("exception", exception, serializer)
}

robot_session::counters! {
    /// The counts of a [`Controller`](crate::Controller) since it was made.
    pub struct ControllerStatistics {
        /// Start messages sent.
        pub attempts: u64,
        /// Times that ALTER began.
        pub starts: u64,
        /// Standard messages sent.
        pub cycles: u64,
        /// Replies taken.
        pub replies: u64,
        /// Replies that could not be read.
        pub bad_replies: u64,
        /// Cycles without a reply: each has ended ALTER.
        pub timeouts: u64,
        /// Messages that no window was open for.
        pub strays: u64,
    }
}
