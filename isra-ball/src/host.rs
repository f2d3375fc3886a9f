use core::time::Duration;

use crate::queue::Queue;
use crate::state::{Poll, PollAction, PollInput, Sensor, SensorAction, SensorInput};
use crate::{DecodeError, Decoder, ENQ, Packet, SessionError, timing};

/// The computer that polls the ball, "Steuerrechner" (§4.2, §9.5): one ENQ a period, one packet back.
///
/// Whenever bytes arrive: [`handle_input`](Self::handle_input). When the time of [`poll_timeout`](Self::poll_timeout) has come:
/// [`handle_timeout`](Self::handle_timeout). After either: [`poll_transmit`](Self::poll_transmit) until it gives `None`, then
/// [`poll_event`](Self::poll_event) until it gives `None`. The first poll is due at once.
///
/// - A decode error is an event; the stream has gone on to the next packet header. Bytes that are still without a whole packet
///   when the next poll is due are given up as an error: the line is half duplex, so nothing before a poll belongs to its reply.
/// - A poll without reply is [`HostEvent::Missed`] when the next one is due, which is sent all the same.
/// - The event queue holds eight. When it is full the oldest is given up: an old force is worth less than a new one. Compare
///   keys with [`KeyEdges`](crate::KeyEdges), which goes by their state.
#[derive(Debug, Clone)]
pub struct Host {
    config: Config,
    decoder: Decoder,
    poll: Poll,
    sensor: Sensor,
    enq_pending: bool,
    next_poll: Option<Duration>,
    last_fresh: Option<Duration>,
    events: Queue<HostEvent>,
}

/// How the host polls.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Config {
    /// The line's baud rate: 9600 in the source (§4.1). Two polls are never closer than [`timing::min_period`].
    pub baud: u32,
    /// From one poll to the next. 28 ms by default, the robot's cycle, which the ball's 13.54 ms fit into.
    pub period: Duration,
    /// Without a packet of fresh values for this long the sensor is [`HostEvent::Stale`]. 100 ms by default, which is our choice:
    /// the source gives none.
    pub stale_after: Duration,
}

/// What the host has to tell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum HostEvent {
    /// The reply to a poll. Old values are used too, see [`Status`](crate::Status).
    Packet(Packet),
    /// A good packet while no reply was outstanding: a late one. The ball sends nothing unasked (§4.2).
    Unasked(Packet),
    /// Bytes without a packet, a damaged packet, or one of unknown layout.
    Error(DecodeError),
    /// The last poll brought no packet.
    Missed,
    /// No fresh values for [`Config::stale_after`]: stop what they drive. Once, until fresh values come again.
    Stale,
}

impl Host {
    /// A host that polls from its first call on.
    ///
    /// # Errors
    /// [`SessionError::Period`] if a poll and its packet do not fit the line in the period.
    pub fn new(config: Config) -> Result<Self, SessionError> {
        let minimum = timing::min_period(config.baud);
        if config.period < minimum {
            return Err(SessionError::Period { minimum, found: config.period });
        }
        Ok(Self {
            config,
            decoder: Decoder::new(),
            poll: Poll::Idle,
            sensor: Sensor::Alive,
            enq_pending: false,
            next_poll: None,
            last_fresh: None,
            events: Queue::new(),
        })
    }

    /// Takes bytes from the line.
    pub fn handle_input(&mut self, now: Duration, mut bytes: &[u8]) {
        while !bytes.is_empty() {
            let taken = self.decoder.push(bytes);
            bytes = bytes.get(taken..).unwrap_or_default();
            self.drain_decoder(now);
        }
    }

    /// Lets time pass: a poll falls due, the sensor goes stale.
    pub fn handle_timeout(&mut self, now: Duration) {
        let last_fresh = *self.last_fresh.get_or_insert(now);
        if now.saturating_sub(last_fresh) >= self.config.stale_after {
            self.sense(SensorInput::Silence);
        }
        if !self.enq_pending && self.next_poll.is_none_or(|due| due <= now) {
            self.decoder.finish();
            self.drain_decoder(now);
            let (poll, action) = self.poll.on(PollInput::PollDue);
            self.poll = poll;
            self.enq_pending = true;
            if action == PollAction::PollAgain {
                self.events.push(HostEvent::Missed);
            }
        }
    }

    /// Writes the ENQ when it is due; the bytes written.
    pub fn poll_transmit(&mut self, now: Duration, out: &mut [u8]) -> Option<usize> {
        self.handle_timeout(now);
        let first = out.first_mut().filter(|_| self.enq_pending)?;
        *first = ENQ;
        self.enq_pending = false;
        // No burst after a pause: the reply needs the line until then.
        let earliest = now.saturating_add(timing::min_period(self.config.baud));
        let due = self.next_poll.unwrap_or(now).saturating_add(self.config.period);
        self.next_poll = Some(due.max(earliest));
        Some(1)
    }

    /// The next event.
    pub fn poll_event(&mut self) -> Option<HostEvent> {
        self.events.pop()
    }

    /// When to call [`handle_timeout`](Self::handle_timeout) at the latest.
    pub fn poll_timeout(&self) -> Option<Duration> {
        let poll = self.next_poll.filter(|_| !self.enq_pending).unwrap_or_default();
        let stale = match self.sensor {
            Sensor::Alive => self.last_fresh.map(|at| at.saturating_add(self.config.stale_after)),
            Sensor::Stale => None,
        };
        Some(stale.map_or(poll, |stale| stale.min(poll)))
    }

    /// Whether fresh values came within [`Config::stale_after`].
    pub fn is_alive(&self) -> bool {
        self.sensor == Sensor::Alive
    }

    /// The events given up because nobody took them.
    pub fn dropped_events(&self) -> u64 {
        self.events.dropped()
    }

    fn drain_decoder(&mut self, now: Duration) {
        while let Some(frame) = self.decoder.next_frame() {
            match frame.and_then(|frame| frame.packet()) {
                Ok(packet) => self.take(now, packet),
                Err(error) => self.events.push(HostEvent::Error(error)),
            }
        }
    }

    fn take(&mut self, now: Duration, packet: Packet) {
        if packet.status.is_fresh() {
            self.last_fresh = Some(now);
            self.sense(SensorInput::Fresh);
        }
        let (poll, action) = self.poll.on(PollInput::Packet);
        self.poll = poll;
        self.events.push(match action {
            PollAction::Unasked => HostEvent::Unasked(packet),
            PollAction::Deliver | PollAction::Poll | PollAction::PollAgain => HostEvent::Packet(packet),
        });
    }

    fn sense(&mut self, input: SensorInput) {
        let (sensor, action) = self.sensor.on(input);
        self.sensor = sensor;
        if action == SensorAction::ReportStale {
            self.events.push(HostEvent::Stale);
        }
    }
}

impl Default for Config {
    fn default() -> Self {
        Self {
            baud: timing::BAUD,
            period: Duration::from_millis(28),
            stale_after: Duration::from_millis(100),
        }
    }
}
