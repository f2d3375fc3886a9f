//! The computer that polls the ball.

mod config;
pub mod machine;

use core::time::Duration;

use robot_session::end::{Core, CoreOf, Echo, End, EventQueue, QueueSpace};
use robot_session::{Decoder as _, EchoError, Unexpected};

pub use config::HostConfig;
#[doc(hidden)]
pub use config::Rule;

use crate::decoder::Decoder;
use crate::envelope::ENQ;
use crate::error::{ConfigError, DecodeError};
use crate::message::Packet;
use machine::{Action, Enquiry, HostMachine, Input};

/// The computer that polls the ball, "Steuerrechner" (§4.2, §9.5): one ENQ a period, one packet back.
///
/// The order of calls is the [`Session`](robot_session::Session)'s. Every poll has one outcome:
/// [`Packet`](HostEvent::Packet), [`Old`](HostEvent::Old) or [`Missed`](HostEvent::Missed). No poll is sent before the
/// outcomes of the ones before are taken.
///
/// - **Age.** A ball that cannot measure repeats its values and marks them as old; one that measured long ago marks the values as
///   new all the same, because no poll came since. So values are reported as new only if the reply before proves that they
///   are at most [`max_age`](HostConfig::max_age) old, the first reply of a connection never; and they are
///   [`Stale`](HostEvent::Stale) when they become older. [`live_until`](Self::live_until) is when.
/// - **Replies.** Packets have no number: the reply to a poll is the packet that comes when a reply can come. Any other is
///   [`Unasked`](HostEvent::Unasked).
///   A ball with a constant delay is rejected: the poll after one without a reply comes
///   [later](HostConfig::quiet) than the others, and no delay fits both.
/// - **Corrupt bytes** are an event, and the next packet is still read. Bytes that are still without a whole packet when no
///   reply can come any more are given up: the line is half duplex, so nothing before a poll belongs to its reply.
/// - **Life.** A poll without reply ends with its connection, and the values are stale then. The first poll of a connection
///   is sent after the time in which the reply to a poll of another host could still come.
#[derive(Debug, Clone)]
pub struct Host {
    core: CoreOf<Self>,
    echo: Echo<1>,
}

/// The events of the host.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "event", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum HostEvent {
    /// The reply to a poll, with new values: use them until [`Host::live_until`].
    #[cfg_attr(feature = "serde", serde(rename = "new", serialize_with = "robot_session::under::message"))]
    Packet(Packet),
    /// The reply to a poll, with values that were used before or may be too old: use the previous ones, as long as they are
    /// not stale.
    #[cfg_attr(feature = "serde", serde(serialize_with = "robot_session::under::message"))]
    Old(Packet),
    /// A poll without a reply.
    Missed,
    /// The values are older than [`max_age`](HostConfig::max_age), or the connection is lost: stop the motion. Once, until
    /// new values come.
    Stale,
    /// A notice: a packet that is not a reply. Packets are delayed by more than [`max_delay`](HostConfig::max_delay), or noise
    /// was a poll to the ball, which only sends when polled (§4.2). An occasional one is noise; if they continue and no
    /// values are new, it is a delay.
    #[cfg_attr(feature = "serde", serde(serialize_with = "robot_session::under::message"))]
    Unasked(Packet),
    /// A notice: bytes without a packet, a corrupt packet, or one of unknown layout.
    #[cfg_attr(feature = "serde", serde(serialize_with = "robot_session::under::error"))]
    Corrupt(DecodeError),
    /// A notice: the line returns the sent bytes, and [`echo`](HostConfig::echo) is off; or it is on, and other bytes came back.
    #[cfg_attr(feature = "serde", serde(serialize_with = "robot_session::under::error"))]
    Echo(EchoError),
    /// A notice: bytes came without a connection.
    Unexpected(Unexpected),
}

robot_session::counters! {
    /// Counters of a host.
    pub struct HostStatistics {
        /// Polls sent.
        pub polls: u64,
        /// Replies with new values.
        pub packets: u64,
        /// Replies with values that were sent before.
        pub old: u64,
        /// Polls without a reply.
        pub missed: u64,
        /// Times that the values became too old.
        pub stale: u64,
        /// Packets that were not replies.
        pub unasked: u64,
        /// Errors in the decoded bytes.
        pub corrupt: u64,
    }
}

impl Host {
    /// Creates a host without a connection.
    ///
    /// # Errors
    /// [`ConfigError::Period`] if a poll and its packet do not fit the line in the period, [`ConfigError::MaxAge`] if the
    /// values of a correct ball could become stale.
    pub fn new(config: HostConfig) -> Result<Self, ConfigError> {
        config.check()?;
        let core = Core::new(config, HostMachine::Disconnected, Decoder::new());
        Ok(Self { core, echo: Echo::new(config.echo) })
    }

    /// Returns the time until which the values of the last [`HostEvent::Packet`] may be used; `None` if they are
    /// stale. A consumer that runs apart from this session compares it with its own clock, and so stops even if this
    /// session is not called any more.
    pub fn live_until(&self) -> Option<Duration> {
        self.core.machine.live_until()
    }

    fn report(&mut self, outcome: HostEvent) {
        let count = match outcome {
            HostEvent::Packet(_) => &mut self.core.statistics.packets,
            HostEvent::Old(_) => &mut self.core.statistics.old,
            HostEvent::Missed => &mut self.core.statistics.missed,
            _ => &mut self.core.statistics.stale,
        };
        *count += 1;
        self.core.push_outcome(outcome);
    }
}

impl End for Host {
    type Machine = HostMachine;
    type Decoder = Decoder;
    type Events = EventQueue<HostEvent, 8>;
    type Statistics = HostStatistics;
    type Payload = Packet;

    const LINK: &'static str = "isra-ball";
    const END: &'static str = "host";
    const MAX_INPUT: usize = 256;
    const MAX_TRANSMIT: usize = 1;
    /// Between a poll and the next: values that become stale, the poll's own, and its values that become stale.
    const QUEUE_SPACE: QueueSpace = QueueSpace { connect: 0, read: 0, transmit: 3 };

    robot_session::core!(HostEvent::Unexpected);
    robot_session::echo!(HostEvent::Echo);

    fn next_input(&mut self) -> Option<(Input, Option<Packet>)> {
        loop {
            match self.core.decoder.next_frame()?.and_then(|frame| frame.packet()) {
                Ok(packet) => {
                    return Some((Input::Packet { fresh: packet.status.is_fresh() }, Some(packet)));
                }
                Err(error) => {
                    self.core.statistics.corrupt += 1;
                    self.core.events.push_notice(HostEvent::Corrupt(error));
                }
            }
        }
    }

    fn act(&mut self, now: Duration, action: Action, packet: Option<Packet>) {
        match (action, packet) {
            (Action::New, Some(packet)) => self.report(HostEvent::Packet(packet)),
            (Action::Old, Some(packet)) => self.report(HostEvent::Old(packet)),
            (Action::Unasked, Some(packet)) => {
                self.core.statistics.unasked += 1;
                self.core.events.push_notice(HostEvent::Unasked(packet));
            }
            (Action::Missed, _) => {
                self.finish(now);
                self.report(HostEvent::Missed);
            }
            (Action::Stale, _) => self.report(HostEvent::Stale),
            (Action::Closed { missed, stale }, _) => {
                if missed {
                    self.report(HostEvent::Missed);
                }
                if stale {
                    self.report(HostEvent::Stale);
                }
            }
            (Action::Sent, _) => self.core.statistics.polls += 1,
            (Action::Nothing | Action::New | Action::Old | Action::Unasked, _) => {}
        }
    }

    fn write(&mut self, now: Duration, Enquiry: Enquiry, out: &mut [u8]) -> Option<(usize, Input)> {
        *out.first_mut()? = ENQ;
        // An incomplete packet is not a reply to this poll.
        self.finish(now);
        // A packet may begin with the same byte.
        self.echo.sent(&[ENQ], false);
        Some((1, Input::Sent))
    }
}
