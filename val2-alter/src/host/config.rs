//! The host's configuration, events and counters.

use core::time::Duration;

use robot_session::Unexpected;

use crate::error::{ConfigError, DecodeError};
use crate::framing::Framing;
use crate::limit::Limits;
use crate::message::{End, ErrorCode, Exception, Mode, Motion, Start};
use crate::timing::{self, Budget, after};

/// Settings of a [`Host`](crate::Host).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct HostConfig {
    /// The envelope of the messages. Default: [`Framing::DEFAULT`].
    pub framing: Framing,
    /// The line's baud rate, which determines the transmission time of a reply. Default: 38400.
    pub baud: u32,
    /// The mode of the ALTER instruction. A start message with another one is refused. Default: 23.
    pub mode: Mode,
    /// The limits of each axis. Default: [`Limits::GENTLE`].
    pub limits: Limits,
    /// Whether the ALTER instruction has an exception subroutine. Without one an exception aborts the robot's program,
    /// and [`Host::exception`](crate::Host::exception) refuses it. Default: no.
    pub subroutine: bool,
    /// The policy for start messages; [`Host::set_policy`](crate::Host::set_policy) changes it. Default: accept.
    pub policy: Policy,
    /// The number of times in a row that a corrupt start message is requested again; the next one is refused.
    /// Default: 2, since a controller gives up after its third attempt.
    pub repeats: u8,
    /// The number of cycles without a message after which the controller counts as lost; from 2. Default: 4.
    pub silence_cycles: u32,
    /// The longest silence inside a frame. `None` if reads are further apart than bytes, such as with
    /// a buffering adapter. Default: 4 ms.
    pub gap: Option<Duration>,
    /// The time for which a target is valid. Then speeds go to zero (cumulative), and an offset stays constant
    /// (non-cumulative). [`Duration::MAX`] means no limit. Default: 200 ms.
    pub target_timeout: Duration,
    /// The time left in the window when another axis begins to move: for doubled DLEs in the next messages, and for the time
    /// of the host. Relevant on slow lines. Default: 1 ms.
    pub reserve: Duration,
    /// An assumption: the longest total delay of reading a message and sending its reply, without the transmission
    /// time on the line. A reply has no number, and a later one may be taken for the reply to the next message; an
    /// exception that it carries could then be executed twice. If it is not shorter than the rest of a cycle after
    /// the window (13 ms cumulative, 11 ms non-cumulative), no message shows the result of the previous reply: an
    /// exception that was sent is not sent again, and its outcome is unknown; a word is sent, even as zero, until no
    /// reply in which it was not zero can arrive any more (a tenth of a second and more), and a stop takes as long.
    /// [`HostEvent::Delayed`] shows that the assumption is wrong for messages, [`HostEvent::Rejected`] with a timeout
    /// that it may be wrong for replies. Default: 10 ms.
    pub max_delay: Duration,
    /// The rules that its machine keeps.
    #[cfg(feature = "model")]
    #[doc(hidden)]
    pub rules: robot_session::end::Rules<Rule>,
}

robot_session::rules! {
    /// A rule of the host's machine, which the model can disable to show that it is needed.
    pub enum Rule for HostConfig {
        /// Only the configured mode is accepted.
        Mode,
        /// A word counts as zero only when the zero was read.
        WordsUntilRead,
        /// The controller's treatment of words during an interruption is unknown.
        WordsInterrupted,
        /// The same holds while an exception that was not read may come late.
        WordsUnread,
        /// Words that may be other than zero are always sent.
        WordsKept,
        /// If a reply may be late for its window, no message shows the outcome of a reply.
        InTime,
        /// An error code counts only in the message that follows the reply directly.
        InSequence,
        /// A reply counts as not read only in the message that follows it directly.
        Rejected,
        /// If a reply may be late for its window, a word counts as zero only when no other value can arrive any more.
        WordsLate,
        /// A reply that was not read may be late: the message after shows whether its exception was executed.
        Unread,
        /// An exception that was read is not sent again.
        SendOnce,
        /// No exception is sent while the subroutine runs.
        NotInterrupted,
        /// A stop is done when the zeros were read.
        ZerosRead,
        /// After a stop no message is answered.
        Silent,
        /// A target expires.
        Stale,
        /// A target that is too old is not followed, even before a late caller passes the time.
        FreshInUse,
        /// Another start message ends the previous ALTER.
        Restart,
        /// A controller that sends nothing is lost.
        Lost,
        /// A reply that is too late is not sent.
        Late,
        /// Requests to repeat are forgotten.
        Forget,
    }
}

impl HostConfig {
    /// Returns the time at which a controller that sends nothing from now on counts as lost.
    pub(super) fn lost_at(&self, now: Duration) -> Duration {
        after(now, timing::CYCLE_NANOS * u64::from(self.silence_cycles))
    }

    /// Returns the same time while ALTER runs.
    pub(super) fn lost_from(&self, now: Duration) -> Duration {
        if self.keeps(Rule::Lost) { self.lost_at(now) } else { Duration::MAX }
    }

    /// Returns whether a reply arrives before the next message has left, so that it cannot be taken for the reply to the
    /// next message.
    pub(super) fn is_in_time(&self) -> bool {
        self.max_delay < timing::CYCLE.saturating_sub(timing::window(self.mode.accumulation()))
    }

    /// Returns the time at which all bytes sent before `now` are read, and a message has reported it, if replies are
    /// late: a reply, the message after its window, and two cycles. If the line is later than the silence of a lost
    /// controller, ALTER is over before.
    pub(super) fn settles_at(&self, now: Duration) -> Duration {
        let most = timing::CYCLE.saturating_mul(self.silence_cycles);
        let late = self.max_delay.min(most);
        now.saturating_add(late.saturating_add(timing::CYCLE).saturating_mul(2))
    }

    /// Returns the length of a reply with this many values and without doubled DLEs.
    pub(super) fn reply_len(&self, values: usize) -> usize {
        timing::min_reply_len(values, self.framing)
    }

    pub(super) fn check(&self) -> Result<(), ConfigError> {
        if self.silence_cycles < 2 {
            return Err(ConfigError::SilenceCycles { found: self.silence_cycles });
        }
        let request = timing::min_request_len(self.mode.has_transform(), self.framing);
        let budget = Budget::new(self.mode.accumulation(), self.baud, request, self.reply_len(1));
        match budget.slack() {
            Some(slack) if slack >= self.reserve => Ok(()),
            _ => Err(ConfigError::Window { baud: self.baud, mode: self.mode.0 }),
        }
    }
}

impl Default for HostConfig {
    fn default() -> Self {
        Self {
            framing: Framing::DEFAULT,
            baud: timing::BAUD,
            mode: Mode::CUMULATIVE_23,
            limits: Limits::GENTLE,
            subroutine: false,
            policy: Policy::Accept,
            repeats: 2,
            silence_cycles: 4,
            gap: Some(Duration::from_millis(4)),
            target_timeout: Duration::from_millis(200),
            reserve: Duration::from_millis(1),
            max_delay: Duration::from_millis(10),
            #[cfg(feature = "model")]
            rules: robot_session::end::Rules::ALL,
        }
    }
}

/// The policy for start messages.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
pub enum Policy {
    /// Accepted; a corrupt one is requested again.
    Accept,
    /// Refused: VAL II ends its program with an error (the operator's command "Verweigern", §10.6).
    Refuse,
    /// Start messages are not answered.
    Ignore,
}

/// The events of a [`Host`](crate::Host). Each ALTER with at least one message ends in one `End` or `Lost`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "event", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum HostEvent {
    /// A start message. It is answered by the policy that holds when `poll_transmit` is called next.
    #[cfg_attr(feature = "serde", serde(serialize_with = "robot_session::under::message"))]
    Start(Start),
    /// A standard message. While ALTER runs, a reply to it is due.
    #[cfg_attr(feature = "serde", serde(serialize_with = "robot_session::under::message"))]
    Motion(Motion),
    /// The controller has ended ALTER. The host accepts its next start automatically.
    #[cfg_attr(feature = "serde", serde(serialize_with = "robot_session::under::message"))]
    End(End),
    /// ALTER is over without an end message.
    #[cfg_attr(feature = "serde", serde(serialize_with = "reason"))]
    Lost(LostReason),
    /// The outcome of an exception.
    Exception {
        /// The exception that the caller gave.
        exception: Exception,
        /// The outcome of the exception.
        outcome: ExceptionOutcome,
    },
    /// [`Host::stop`](crate::Host::stop) is done: the controller has read zeros, and no message is answered any more.
    Stopped,
    /// Bytes that are not a message. `Host` has reacted to them already.
    #[cfg_attr(feature = "serde", serde(serialize_with = "robot_session::under::error"))]
    Corrupt(DecodeError),
    /// The deadline passed before `poll_transmit` was called: no reply was sent, and the controller will end ALTER.
    Missed,
    /// The previous standard message was read later than [`HostConfig::max_delay`] assumes: the next one came sooner
    /// after it than a controller sends them. Exceptions may be executed twice on such a line: change its adapter or
    /// this setting.
    Delayed,
    /// The controller could not read the last reply, with the reason. After a message that was lost or corrupt, and so not
    /// answered, it may be about the missing reply: then offsets continue from that of the last reply.
    #[cfg_attr(feature = "serde", serde(serialize_with = "robot_session::under::error"))]
    Rejected(ErrorCode),
    /// No target was set for [`HostConfig::target_timeout`].
    TargetStale,
    /// A call that the contract does not allow, or an input that the machine did not expect. It has no effect.
    Unexpected(Unexpected),
}

#[cfg(feature = "serde")]
fn reason<S: serde::Serializer>(reason: &LostReason, serializer: S) -> Result<S::Ok, S::Error> {
    robot_session::under::name("reason", reason, serializer)
}

/// The reason that ALTER is over without an end message.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
pub enum LostReason {
    /// Nothing was received for several cycles.
    Silence,
    /// The controller sent a new start message.
    Restart,
    /// The connection is gone: the port was closed or has failed.
    Disconnected,
}

/// The outcome of an exception.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
pub enum ExceptionOutcome {
    /// The controller has read the exception: the subroutine was started.
    Done,
    /// The exception was never sent, or the controller did not read it, not even late.
    NotDone,
    /// The exception was sent, and it is unknown whether it was read.
    Unknown(UnknownReason),
}

/// The reason that it is unknown whether an exception was read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
pub enum UnknownReason {
    /// ALTER ended before the next message.
    Ended,
    /// A message was lost in between, or replies may be late: the report in the next message may be about another
    /// reply.
    OutOfSequence,
    /// The controller did not read it in time, and the subroutine runs: by a reply that came late, or by itself.
    Unclear,
}

robot_session::counters! {
    /// The counts of a [`Host`](crate::Host) since it was made.
    pub struct HostStatistics {
        /// Start messages accepted.
        pub starts: u64,
        /// Standard messages to be answered.
        pub cycles: u64,
        /// Replies sent.
        pub replies: u64,
        /// Replies in which an axis had to wait at rest because its word did not fit the window.
        pub held: u64,
        /// Standard messages that were read later than is assumed.
        pub delayed: u64,
        /// Cycles whose deadline passed without a reply.
        pub missed: u64,
        /// Replies that the controller could not read.
        pub rejected: u64,
        /// Stretches of corrupt bytes.
        pub corrupt: u64,
        /// Ends by the controller.
        pub ends: u64,
        /// Times that ALTER was over without an end message.
        pub lost: u64,
    }
}
