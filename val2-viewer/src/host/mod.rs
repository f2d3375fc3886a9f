//! The computer that knows the position of the arm.

mod config;
pub mod machine;

use core::time::Duration;

use robot_session::end::{ByteDecoder, Core, CoreOf, Echo, End, EventQueue, QueueSpace};
use robot_session::{Decoder as _, EchoError, Unexpected};

#[doc(hidden)]
pub use config::Rule;
pub use config::{Format, HostConfig};

use crate::error::ConfigError;
use crate::flow::{XOFF, XON};
use crate::message::{ENQ, PosePacket};
use machine::{Action, Answer, HostMachine, Input};

/// The computer that knows the position of the arm, "Steuerrechner" (§5): answers a request with the newest pose, and sends
/// only replies.
///
/// The order of calls is the [`Session`](robot_session::Session)'s; [`set_pose`](Self::set_pose) whenever there is a new
/// pose, which ALTER gives every 28 ms.
///
/// - Requests that have piled up have one answer (§9.4): at most one packet is sent in an [`interval`](HostConfig::interval), the
///   first one that long after the connection was made. A host that does not read while ALTER is off reports
///   [`handle_connected`](robot_session::Session::handle_connected) when it reads again.
/// - A pose that is older than [`max_age`](HostConfig::max_age) is not sent: the request waits for a new one.
/// - A request of one connection is not answered on the next. The pose outlasts it.
/// - XOFF holds the next packet until XON, or until [`max_hold`](HostConfig::max_hold) is over.
/// - Any other byte is an event without an effect.
/// - Every event is a notice: when more than eight wait, the oldest are dropped.
#[derive(Debug, Clone)]
pub struct Host {
    core: CoreOf<Self>,
    echo: Echo<256>,
    /// The next packet: how many were sent before it, and the newest pose.
    packet: PosePacket,
}

/// The events of the host.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "event", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum HostEvent {
    /// A request has come: it is answered as soon as there is a pose, and the interval is over.
    Asked,
    /// A packet was sent, with this pose.
    #[cfg_attr(feature = "serde", serde(serialize_with = "robot_session::under::message"))]
    Sent(PosePacket),
    /// A request came before the answer to the last one was sent: one packet answers both.
    Ignored,
    /// The pose is too old: requests wait for a new one. Once for each pose.
    Stale,
    /// The [`format`](HostConfig::format) gave a packet with XON or XOFF in it, which is not sent: the request has no answer.
    Unsendable,
    /// No XON has come since the last XOFF, for [`max_hold`](HostConfig::max_hold): packets are sent again.
    HoldEnded,
    /// A byte other than ENQ, XON and XOFF.
    #[cfg_attr(feature = "serde", serde(serialize_with = "robot_session::under::byte"))]
    Unknown(u8),
    /// A notice: the line returns the sent bytes, and [`echo`](HostConfig::echo) is off; or it is on, and other bytes came back.
    #[cfg_attr(feature = "serde", serde(serialize_with = "robot_session::under::error"))]
    Echo(EchoError),
    /// A request, XON or XOFF came without a connection.
    Unexpected(Unexpected),
}

robot_session::counters! {
    /// Counters of a host.
    pub struct HostStatistics {
        /// Requests that have or had a packet of their own.
        pub asked: u64,
        /// Packets that were sent, each for one request or more.
        pub sent: u64,
        /// Requests that have no packet of their own.
        pub ignored: u64,
        /// Poses that became too old before a newer one came.
        pub stale: u64,
        /// Packets that could not be sent.
        pub unsendable: u64,
        /// Times that the line was held for longer than it may be.
        pub holds_ended: u64,
        /// Bytes other than ENQ, XON and XOFF.
        pub unknown: u64,
    }
}

impl Host {
    /// Returns a host without a pose and without a connection.
    ///
    /// # Errors
    /// [`ConfigError::Interval`], [`ConfigError::MaxAge`], [`ConfigError::MaxHold`].
    pub fn new(config: HostConfig) -> Result<Self, ConfigError> {
        config.check()?;
        let core = Core::new(config, HostMachine::NEW, ByteDecoder::new());
        let packet = PosePacket { count: 0, pose: [0; 12] };
        Ok(Self { core, echo: Echo::new(config.echo), packet })
    }

    /// Sets the pose that requests are answered with from now on.
    pub fn set_pose(&mut self, now: Duration, pose: [i16; 12]) {
        self.packet.pose = pose;
        self.request(now, Input::Pose);
    }
}

impl End for Host {
    type Machine = HostMachine;
    type Decoder = ByteDecoder;
    type Events = EventQueue<HostEvent, 8>;
    type Statistics = HostStatistics;
    type Payload = ();

    const LINK: &'static str = "val2-viewer";
    const END: &'static str = "host";
    // The buffer of a serial port. Requests that have piled up there have one answer.
    const MAX_INPUT: usize = 4096;
    const MAX_TRANSMIT: usize = 256;
    const QUEUE_SPACE: QueueSpace = QueueSpace::NONE;

    robot_session::core!(HostEvent::Unexpected);
    robot_session::echo!(HostEvent::Echo);

    fn next_input(&mut self) -> Option<(Input, Option<()>)> {
        loop {
            match self.core.decoder.next_frame()?.ok()? {
                ENQ => return Some((Input::Enquiry, None)),
                XOFF => return Some((Input::Xoff, None)),
                XON => return Some((Input::Xon, None)),
                byte => {
                    self.core.statistics.unknown += 1;
                    self.core.events.push_notice(HostEvent::Unknown(byte));
                }
            }
        }
    }

    fn act(&mut self, _now: Duration, action: Action, _: Option<()>) {
        let (count, event) = match action {
            Action::Nothing => return,
            Action::Accept => (&mut self.core.statistics.asked, HostEvent::Asked),
            Action::Ignore => (&mut self.core.statistics.ignored, HostEvent::Ignored),
            Action::Stale => (&mut self.core.statistics.stale, HostEvent::Stale),
            Action::HoldEnded => (&mut self.core.statistics.holds_ended, HostEvent::HoldEnded),
            Action::Unsendable => (&mut self.core.statistics.unsendable, HostEvent::Unsendable),
            Action::Sent => {
                let packet = self.packet;
                self.packet.count = packet.count.wrapping_add(1);
                (&mut self.core.statistics.sent, HostEvent::Sent(packet))
            }
        };
        *count += 1;
        self.core.events.push_notice(event);
    }

    fn write(&mut self, _now: Duration, Answer: Answer, out: &mut [u8]) -> Option<(usize, Input)> {
        let length = (self.core.config.format)(&self.packet, out).filter(|length| *length > 0)?;
        let packet = out.get(..length)?;
        let is_sendable = !packet.iter().any(|byte| matches!(*byte, XON | XOFF));
        if is_sendable {
            self.echo.sent(packet, true);
        }
        Some(if is_sendable { (length, Input::Sent) } else { (0, Input::Unsendable) })
    }
}
