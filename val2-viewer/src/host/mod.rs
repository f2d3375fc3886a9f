//! The computer that knows where the arm is.

mod config;
pub mod machine;

use core::time::Duration;

use robot_session::{EventQueue, Session, Unexpected};

#[doc(hidden)]
pub use config::Rule;
pub use config::{Format, HostConfig};

use crate::error::ConfigError;
use crate::message::{ENQ, PosePacket};
use machine::{Action, HostMachine, Input};

/// The computer that knows where the arm is, "Steuerrechner" (§5): answers a request with the newest pose, and sends nothing
/// unasked.
///
/// The order of calls is the [`Session`]'s; [`set_pose`](Self::set_pose) whenever there is a new pose, which ALTER gives every
/// 28 ms.
///
/// - Requests that have piled up have one answer (§9.4): at most one packet is sent in an [`interval`](HostConfig::interval), the
///   first one that long after the connection was made. A host that does not read while ALTER is off reports
///   [`handle_connected`](Session::handle_connected) when it reads again.
/// - A pose that is older than [`max_age`](HostConfig::max_age) is not sent: the request waits for a new one.
/// - A request of one connection is not answered on the next. The pose outlasts it.
/// - Any other byte than ENQ is an event and changes nothing.
/// - Every event is a notice: of more than eight that nobody takes, the oldest are dropped.
#[derive(Debug, Clone)]
pub struct Host {
    config: HostConfig,
    machine: HostMachine,
    /// The next packet: how many were sent before it, and the newest pose.
    packet: PosePacket,
    events: EventQueue<HostEvent, 8>,
    statistics: HostStatistics,
}

/// What the host reports.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum HostEvent {
    /// A request has come: it is answered as soon as there is a pose, and the interval is over.
    Asked,
    /// A packet was sent.
    Sent(PosePacket),
    /// A request came before the answer to the last one was sent: one packet answers both.
    Ignored,
    /// The pose is too old: requests wait for a new one. Once for each pose.
    Stale,
    /// A byte that is not ENQ.
    Unknown(u8),
    /// A request came without a connection.
    Unexpected(Unexpected),
}

/// What a host has done.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub struct HostStatistics {
    /// Requests that have or had a packet of their own.
    pub asked: u64,
    /// Packets sent.
    pub sent: u64,
    /// Requests that have no packet of their own.
    pub ignored: u64,
    /// Poses that became too old before a newer one came.
    pub stale: u64,
    /// Bytes that were no request.
    pub unknown: u64,
    /// Inputs that the state does not allow.
    pub unexpected: u64,
    /// Notices that were dropped because nobody took them.
    pub dropped_notices: u64,
}

impl Host {
    /// A host that knows no pose, without a connection.
    ///
    /// # Errors
    /// [`ConfigError::Interval`], [`ConfigError::MaxAge`].
    pub fn new(config: HostConfig) -> Result<Self, ConfigError> {
        config.check()?;
        Ok(Self {
            config,
            machine: HostMachine::NEW,
            packet: PosePacket { count: 0, pose: [0; 12] },
            events: EventQueue::new(),
            statistics: HostStatistics::default(),
        })
    }

    /// Sets the pose that requests are answered with from now on.
    pub fn set_pose(&mut self, now: Duration, pose: [i16; 12]) {
        self.packet.pose = pose;
        self.advance(now, Input::Pose);
    }

    /// The state that decides what happens next.
    pub fn machine(&self) -> &HostMachine {
        &self.machine
    }

    /// What came due, then the input.
    fn advance(&mut self, now: Duration, input: Input) {
        self.step(now, Input::Timer);
        self.step(now, input);
    }

    fn step(&mut self, now: Duration, input: Input) {
        match self.machine.on(now, input, &self.config) {
            Ok(Action::None | Action::Transmit) => {}
            Ok(Action::Accept) => {
                self.statistics.asked += 1;
                self.events.push_notice(HostEvent::Asked);
            }
            Ok(Action::Ignore) => {
                self.statistics.ignored += 1;
                self.events.push_notice(HostEvent::Ignored);
            }
            Ok(Action::Stale) => {
                self.statistics.stale += 1;
                self.events.push_notice(HostEvent::Stale);
            }
            Err(unexpected) => {
                self.statistics.unexpected += 1;
                self.events.push_notice(HostEvent::Unexpected(unexpected));
            }
        }
    }
}

impl Session for Host {
    type Event = HostEvent;
    type Statistics = HostStatistics;

    const MAX_INPUT: usize = 65536;
    const MAX_TRANSMIT: usize = 256;

    fn handle_connected(&mut self, now: Duration) {
        self.advance(now, Input::Connected);
    }

    fn handle_disconnected(&mut self, now: Duration) {
        self.advance(now, Input::Disconnected);
    }

    fn handle_input(&mut self, now: Duration, bytes: &[u8]) {
        self.handle_timeout(now);
        for &byte in bytes {
            if byte == ENQ {
                self.step(now, Input::Enquiry);
            } else {
                self.statistics.unknown += 1;
                self.events.push_notice(HostEvent::Unknown(byte));
            }
        }
    }

    fn handle_timeout(&mut self, now: Duration) {
        self.step(now, Input::Timer);
    }

    fn poll_event(&mut self) -> Option<HostEvent> {
        self.events.pop()
    }

    fn poll_transmit(&mut self, now: Duration, out: &mut [u8]) -> Option<usize> {
        self.handle_timeout(now);
        if !self.machine.transmits(now) {
            return None;
        }
        let length = (self.config.format)(&self.packet, out).filter(|length| *length > 0)?;
        self.step(now, Input::Answer);
        self.statistics.sent += 1;
        self.events.push_notice(HostEvent::Sent(self.packet));
        self.packet.count = self.packet.count.wrapping_add(1);
        Some(length)
    }

    fn poll_timeout(&self) -> Option<Duration> {
        self.machine.deadline()
    }

    fn statistics(&self) -> HostStatistics {
        HostStatistics { dropped_notices: self.events.dropped_notices(), ..self.statistics }
    }
}
