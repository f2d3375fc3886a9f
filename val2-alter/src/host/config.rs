//! What a host is told, what it tells, and what it counts.

use core::time::Duration;

use crate::limit::Limits;
use crate::message::{Accumulation, End, ErrorCode, Motion, Start};
use crate::{DecodeError, Framing, timing};

/// How a [`Host`](crate::Host) behaves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct HostConfig {
    /// The envelope.
    pub framing: Framing,
    /// The line's baud rate: what a reply takes of the window follows from it.
    pub baud: u32,
    /// What each axis may do.
    pub limits: Limits,
    /// Which values a reply transmits.
    pub select: Select,
    /// What the controller makes of a value that is not transmitted; matters for [`Select::Needed`] alone.
    pub unselected: Unselected,
    /// Whether the ALTER instruction names an exception subroutine. Without one an exception aborts the robot's program,
    /// and [`Host::exception`](crate::Host::exception) refuses it.
    pub subroutine: bool,
    /// How start messages are answered; [`Host::set_policy`](crate::Host::set_policy) changes it.
    pub policy: Policy,
    /// How often in a row a damaged start message is asked for again. The controller gives up after its third attempt.
    pub repeats: u8,
    /// After how many cycles without a message the controller counts as gone.
    pub silence_cycles: u32,
    /// A gap of more than this between bytes ends a frame. `None` when reads are far apart though bytes are not, as with an
    /// adapter that collects them.
    pub gap: Option<Duration>,
}

impl Default for HostConfig {
    fn default() -> Self {
        Self {
            framing: Framing::DEFAULT,
            baud: timing::BAUD,
            limits: Limits::GENTLE,
            select: Select::All,
            unselected: Unselected::ByMode,
            subroutine: false,
            policy: Policy::Accept,
            repeats: 3,
            silence_cycles: 4,
            gap: Some(Duration::from_millis(4)),
        }
    }
}

/// How start messages are answered.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Policy {
    /// Accepted; a damaged one is asked for again.
    Accept,
    /// Refused: VAL II ends its program with an error (the operator's command "Verweigern", §10.6).
    Refuse,
    /// Not answered at all.
    Ignore,
}

/// Which values a reply transmits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Select {
    /// All six in every reply: right whatever the controller makes of the others. Up to 33 bytes, which fit at 38400 baud;
    /// at 19200 only without many doubled DLEs.
    All,
    /// Only those that differ from what the controller assumes. For slow lines; needs [`Unselected`] to be right.
    Needed,
}

/// What a controller makes of a value that a reply does not transmit.
///
/// The source: "Im kumulativen Betrieb wird jedes nicht übertragene Datenwort von VAL-II intern unverändert gelassen.
/// Anfangs werden alle Werte als Null angenommen" (§3.3.2). Word for word, an increment would then repeat for ever.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Unselected {
    /// Cumulative: zero, nothing moves. Non-cumulative: as before, the offset stays.
    #[default]
    ByMode,
    /// As before, also in cumulative mode: the words of the source.
    Hold,
    /// Zero in both.
    Zero,
}

impl Unselected {
    pub(crate) fn holds(self, accumulation: Accumulation) -> bool {
        match self {
            Self::ByMode => accumulation == Accumulation::NonCumulative,
            Self::Hold => true,
            Self::Zero => false,
        }
    }
}

/// What a [`Host`](crate::Host) tells its caller.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum HostEvent {
    /// A start message. It is answered by the policy that holds when `poll_transmit` is called next.
    Start(Start),
    /// A standard message. While ALTER runs, a reply to it is due.
    Motion(Motion),
    /// The controller has ended ALTER. The host takes its next start by itself.
    End(End),
    /// Bytes that are no message. `Host` has done what is to be done about it.
    Damaged(DecodeError),
    /// The deadline passed before `poll_transmit` was called: no reply was sent, and the controller will end ALTER.
    Missed,
    /// The controller could not read the last reply, and said why. (An exception in it will be sent again.)
    Rejected(ErrorCode),
    /// [`Host::stop`](crate::Host::stop) is done: the values are zero, and no message is answered any more.
    Stopped,
    /// Nothing was heard for several cycles.
    Lost,
}

/// What a [`Host`](crate::Host) has counted since it was made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct HostStats {
    /// Start messages accepted.
    pub starts: u64,
    /// Standard messages that wanted a reply.
    pub cycles: u64,
    /// Replies sent.
    pub replies: u64,
    /// Cycles whose deadline passed without a reply.
    pub missed: u64,
    /// Replies that the controller could not read.
    pub rejected: u64,
    /// Stretches of damaged bytes.
    pub damaged: u64,
    /// Ends by the controller.
    pub ends: u64,
    /// Times that the controller fell silent.
    pub lost: u64,
    /// Events that were dropped because nobody fetched them.
    pub events_lost: u64,
}
