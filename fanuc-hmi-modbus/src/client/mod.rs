//! The client's end ("master").

mod config;
mod event;
mod held;
mod machine;
mod places;

use core::ops::Range;
use core::time::Duration;

use robot_session::{Decoder as _, Encode as _, EventQueue, Session, Unexpected};

pub use config::ClientConfig;
pub use event::{ClientEvent, ClientStatistics, Failure, Ticket};
pub use held::{Held, Stage};
pub use machine::{ClientAction, ClientInput, ClientLink, ClientMachine, Quiet};
pub use places::Places;

use crate::decoder::Decoder;
use crate::error::{ConfigError, DecodeError, Mismatch, SessionError};
use crate::frame::{Frame, Side};
use crate::framing::{Framing, Framings};
use crate::message::{PduBuf, Reply, Request, function};

/// The client's end of one connection or serial line, with `N` places for requests, 16 at most, and for the framings `F`.
///
/// A [`Session`]: its verbs, and the order of calling them, are the trait's. [`request`](Self::request) at any time; requests
/// are sent in the order in which they were made, and wait for a connection if there is none.
///
/// Every request ends in exactly one [`ClientEvent::Replied`], [`ClientEvent::Announced`] or [`ClientEvent::Failed`], and is sent
/// once at most. Its place is taken until that event was polled, so no event is ever lost: a full client refuses requests.
/// The reply is kept in the place of its request: [`reply`](Self::reply) reads it until the next request takes its place.
///
/// A reply that comes after its request has timed out is dropped and reported as [`ClientEvent::Stray`]. On TCP it is never
/// taken for another one's; off TCP as far as [`ClientConfig::settle`] reaches.
///
/// All bytes are taken. Corrupt ones cost the frames that they touch and are reported.
#[derive(Debug, Clone)]
pub struct Client<const N: usize = 8, F = Framing> {
    config: ClientConfig,
    machine: ClientMachine<N>,
    decoder: Decoder<F>,
    places: [Place; N],
    events: EventQueue<ClientEvent, EVENTS>,
    statistics: ClientStatistics,
}

/// Outcomes have room here for every place.
const EVENTS: usize = 16;

/// The bytes of a request, and then of its reply.
#[derive(Debug, Clone, Copy)]
struct Place {
    ticket: Ticket,
    unit: u8,
    /// How many bits or registers the request reads.
    quantity: u16,
    is_reply: bool,
    pdu: PduBuf,
}

/// What a frame is to the request that it seems to belong to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Misfit {
    Mismatch(Mismatch),
    Malformed(DecodeError),
}

impl<const N: usize, F: Framings> Client<N, F> {
    /// A client without a connection and without requests.
    ///
    /// # Errors
    /// No request can be in flight, or more than there are places for; the timeout is zero; the type is for another framing.
    pub fn new(config: ClientConfig) -> Result<Self, ConfigError> {
        const { assert!(N >= 1 && N <= EVENTS, "a client has 1 to 16 places") };
        let most = if config.framing.has_transactions() { N } else { 1 };
        if !(1..=most).contains(&config.in_flight) {
            return Err(ConfigError::InFlight { found: config.in_flight, most });
        }
        if config.timeout.is_zero() {
            return Err(ConfigError::Timeout);
        }
        let place = Place {
            ticket: Ticket { number: 0, place: 0 },
            unit: 0,
            quantity: 0,
            is_reply: false,
            pdu: PduBuf::EMPTY,
        };
        Ok(Self {
            config,
            machine: ClientMachine::NEW,
            decoder: Decoder::new(F::of(config.framing).ok_or(ConfigError::Framing)?, Side::Server),
            places: [place; N],
            events: EventQueue::new(),
            statistics: ClientStatistics::default(),
        })
    }

    /// Makes a request to a unit.
    ///
    /// # Errors
    /// The specification does not allow the request, every place is taken, or a broadcast would read.
    pub fn request(&mut self, unit: u8, request: &Request<'_>) -> Result<Ticket, SessionError> {
        let broadcast = self.config.is_broadcast(unit);
        if broadcast && request.reads() {
            return Err(SessionError::BroadcastRead { function: request.function() });
        }
        let free = self.machine.free_place();
        let Some((place, kept)) = free.and_then(|free| Some((free, self.places.get_mut(usize::from(free))?)))
        else {
            PduBuf::new(request)?;
            return Err(SessionError::Full { places: N });
        };
        // A request that cannot be written leaves the reply that is there.
        kept.pdu.put(request)?;
        let ticket = Ticket { number: self.statistics.requests + 1, place };
        (kept.ticket, kept.unit) = (ticket, unit);
        (kept.quantity, kept.is_reply) = (request.quantity_read(), false);
        self.statistics.requests += 1;
        self.step(Duration::ZERO, ClientInput::Request { broadcast });
        Ok(ticket)
    }

    /// The reply to a request: from its [`ClientEvent::Replied`] on, until another request takes its place.
    #[inline]
    pub fn reply(&self, ticket: Ticket) -> Option<Reply<'_>> {
        let place = self.places.get(usize::from(ticket.place))?;
        if place.ticket != ticket || !place.is_reply {
            return None;
        }
        Some(Reply::decode(place.pdu.as_bytes()).ok()?.with_bits(place.quantity))
    }

    /// How many requests are in flight.
    pub fn in_flight(&self) -> usize {
        self.machine.in_flight()
    }

    /// The bytes of a reply that is not whole. Where there are some after its request has timed out, on TCP, the server has cut it
    /// off, or will go on with it at any time: best connect again.
    pub const fn pending(&self) -> usize {
        self.decoder.pending()
    }

    /// The state of the machine.
    pub const fn machine(&self) -> &ClientMachine<N> {
        &self.machine
    }

    /// The configuration.
    pub const fn config(&self) -> &ClientConfig {
        &self.config
    }

    #[inline(always)] // as `ClientMachine::on`
    fn step(&mut self, now: Duration, input: ClientInput) -> ClientAction {
        match self.machine.on(now, input, &self.config) {
            Ok(action) => action,
            Err(unexpected) => {
                self.unexpected(unexpected);
                ClientAction::Nothing
            }
        }
    }

    #[cold]
    fn unexpected(&mut self, unexpected: Unexpected) {
        self.statistics.unexpected += 1;
        self.events.push_notice(ClientEvent::Unexpected(unexpected));
    }

    /// Gives the machine every frame that the decoder has.
    fn decode(&mut self, now: Duration) {
        while let Some(found) = self.decoder.advance() {
            match found {
                Ok(range) => self.frame(now, range),
                // More of the same was reported already.
                Err(DecodeError::Noise { .. }) => {}
                Err(error) => {
                    self.statistics.corrupt += 1;
                    self.events.push_notice(ClientEvent::Corrupt(error));
                }
            }
        }
    }

    fn frame(&mut self, now: Duration, range: Range<usize>) {
        let Some(frame) = self.decoder.frame(range.clone()) else { return };
        let transaction = frame.transaction.unwrap_or(0);
        let expects = self.machine.expects(transaction, &self.config);
        let place = expects.and_then(|place| self.places.get(usize::from(place)));
        let misfit = place.and_then(|place| place.misfit(&frame, self.config.any_unit));
        let input = ClientInput::Reply { transaction, fits: misfit.is_none() };
        match self.machine.on(now, input, &self.config) {
            Ok(ClientAction::Replied { place }) => {
                let Some(place) = self.places.get_mut(usize::from(place)) else { return };
                place.keep_reply(frame.pdu);
                self.statistics.replies += 1;
                let ticket = place.ticket;
                let unit = frame.unit;
                self.report(ClientEvent::Replied { ticket, unit });
            }
            Ok(ClientAction::Refused { place }) => {
                let failure = match misfit {
                    Some(Misfit::Malformed(error)) => Failure::Malformed(error),
                    Some(Misfit::Mismatch(mismatch)) => Failure::Refused(mismatch),
                    None => return,
                };
                self.fail(place, failure);
            }
            Ok(ClientAction::Stray { late }) => self.stray(range, late, misfit),
            Ok(_) => {}
            Err(unexpected) => self.unexpected(unexpected),
        }
    }

    #[cold]
    fn stray(&mut self, range: Range<usize>, late: Option<u8>, misfit: Option<Misfit>) {
        let Some(frame) = self.decoder.frame(range) else { return };
        self.statistics.strays += 1;
        self.events.push_notice(ClientEvent::Stray {
            transaction: frame.transaction,
            unit: frame.unit,
            function: frame.pdu.first().copied().unwrap_or_default() & 0x7F,
            late: late.and_then(|place| self.ticket(place)),
            mismatch: match misfit {
                Some(Misfit::Mismatch(mismatch)) => Some(mismatch),
                Some(Misfit::Malformed(_)) | None => None,
            },
        });
    }

    fn reset(&mut self, action: ClientAction) {
        let ClientAction::Reset { lost, not_sent } = action else { return };
        self.decoder.clear();
        lost.iter().for_each(|place| self.fail(place, Failure::Disconnected));
        not_sent.iter().for_each(|place| self.fail(place, Failure::NotSent));
    }

    fn fail(&mut self, place: u8, failure: Failure) {
        self.statistics.failures += 1;
        if let Some(ticket) = self.ticket(place) {
            self.report(ClientEvent::Failed { ticket, failure });
        }
    }

    /// There is room for every place's outcome.
    fn report(&mut self, outcome: ClientEvent) {
        let _ = self.events.push_outcome(outcome);
    }

    fn ticket(&self, place: u8) -> Option<Ticket> {
        self.places.get(usize::from(place)).map(|place| place.ticket)
    }
}

impl<const N: usize, F: Framings> Session for Client<N, F> {
    type Event = ClientEvent;
    type Statistics = ClientStatistics;

    const MAX_INPUT: usize = 65536;
    const MAX_TRANSMIT: usize = Frame::MAX_LEN;

    fn handle_connected(&mut self, now: Duration) {
        let action = self.step(now, ClientInput::Connected);
        self.reset(action);
    }

    fn handle_disconnected(&mut self, now: Duration) {
        let action = self.step(now, ClientInput::Disconnected);
        self.reset(action);
    }

    fn handle_input(&mut self, now: Duration, mut bytes: &[u8]) {
        if bytes.is_empty() {
            return;
        }
        match self.machine.on(now, ClientInput::Received, &self.config) {
            Ok(ClientAction::Cut) => self.decoder.finish(),
            Ok(_) => {}
            Err(unexpected) => return self.unexpected(unexpected),
        }
        let was_corrupt = self.decoder.corruption().is_some();
        while !bytes.is_empty() {
            let taken = self.decoder.push(bytes);
            bytes = bytes.get(taken..).unwrap_or_default();
            self.decode(now);
        }
        // On TCP the server is out of step: its next valid frame may never come.
        if let (false, Framing::Tcp, Some(error)) =
            (was_corrupt, self.config.framing, self.decoder.corruption())
        {
            self.events.push_notice(ClientEvent::OutOfStep(error));
        }
    }

    fn handle_timeout(&mut self, now: Duration) {
        loop {
            match self.step(now, ClientInput::Timer) {
                ClientAction::Cut => {
                    self.decoder.finish();
                    self.decode(now);
                }
                ClientAction::TimedOut(places) => {
                    places.iter().for_each(|place| self.fail(place, Failure::TimedOut));
                }
                _ => return,
            }
        }
    }

    fn poll_event(&mut self) -> Option<ClientEvent> {
        let event = self.events.pop()?;
        if let Some(ticket) = event.outcome_of() {
            self.step(Duration::ZERO, ClientInput::Taken { place: ticket.place });
        }
        Some(event)
    }

    fn poll_transmit(&mut self, now: Duration, out: &mut [u8]) -> Option<usize> {
        let out = out.get_mut(..Self::MAX_TRANSMIT)?;
        let (place, transaction) = match self.step(now, ClientInput::Transmit) {
            ClientAction::Send { place, transaction } => (place, transaction),
            ClientAction::Announce { place } => {
                let ticket = self.ticket(place)?;
                self.report(ClientEvent::Announced { ticket });
                (place, 0)
            }
            _ => return None,
        };
        let place = self.places.get(usize::from(place))?;
        let transaction = self.decoder.has_transactions().then_some(transaction);
        Frame { transaction, unit: place.unit, pdu: place.pdu.as_bytes() }.encode(out).ok()
    }

    fn poll_timeout(&self) -> Option<Duration> {
        self.machine.deadline()
    }

    fn statistics(&self) -> ClientStatistics {
        ClientStatistics { dropped_notices: self.events.dropped_notices(), ..self.statistics }
    }
}

impl Place {
    /// Why a frame cannot be the reply to the request in this place.
    fn misfit(&self, frame: &Frame<&[u8]>, any_unit: bool) -> Option<Misfit> {
        if self.unit != frame.unit && !any_unit {
            return Some(Misfit::Mismatch(Mismatch::Unit { expected: self.unit, found: frame.unit }));
        }
        // The read that is repeated in every cycle: what it asked for is known without its request.
        let is_read = self.pdu.as_bytes().first() == Some(&function::READ_HOLDING_REGISTERS);
        match Reply::decode(frame.pdu) {
            Ok(Reply::HoldingRegisters(words)) if is_read && words.len() == usize::from(self.quantity) => {
                None
            }
            Ok(reply) => self.answered(&reply),
            Err(error) => Some(Misfit::Malformed(error)),
        }
    }

    #[inline(never)]
    fn answered(&self, reply: &Reply<'_>) -> Option<Misfit> {
        match self.pdu.request() {
            Ok(request) => reply.answers(&request).err().map(Misfit::Mismatch),
            Err(error) => Some(Misfit::Malformed(error)),
        }
    }

    /// The reply takes the place of its request.
    fn keep_reply(&mut self, pdu: &[u8]) {
        self.pdu.hold(pdu);
        self.is_reply = true;
    }
}
