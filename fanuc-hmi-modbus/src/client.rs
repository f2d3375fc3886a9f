//! The client's end ("master").

use core::time::Duration;

use crate::decoder::{Decoder, Framing};
use crate::error::{DecodeError, Mismatch, SessionError};
use crate::frame::{Frame, Side};
use crate::message::{PduBuf, Reply, Request};
use crate::state::{self, State};
use crate::timing;

/// How a client speaks to its servers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct Config {
    /// The transport.
    pub framing: Framing,
    /// How long a reply may take after its request was handed out. One second.
    pub timeout: Duration,
    /// How many requests may be out at once on TCP. 1, which every server bears: how many a FANUC controller takes is nowhere
    /// said. Off TCP it is always 1.
    pub in_flight: usize,
    /// Whether a reply from another unit than was asked is taken, as some gateways answer. Off.
    pub any_unit: bool,
    /// Whether unit 0 is a broadcast that nobody answers. On for serial lines; off on TCP, where 0 is often the server itself.
    pub broadcast: bool,
    /// How long the units of a serial line get to carry out a broadcast. 100 ms.
    pub turnaround: Duration,
    /// How long to wait, off TCP, for a late reply before the next request is sent: without a transaction in it, it would pass
    /// for the reply to that. 100 ms.
    pub settle: Duration,
}

impl Config {
    /// Modbus TCP.
    pub const fn tcp() -> Self {
        Self {
            framing: Framing::Tcp,
            timeout: Duration::from_secs(1),
            in_flight: 1,
            any_unit: false,
            broadcast: false,
            turnaround: Duration::from_millis(100),
            settle: Duration::from_millis(100),
        }
    }

    /// RTU on a serial line.
    pub const fn rtu(baud: u32) -> Self {
        Self { framing: Framing::Rtu { silence: timing::silence(baud) }, broadcast: true, ..Self::tcp() }
    }

    /// RTU frames through a TCP connection.
    pub const fn rtu_over_tcp() -> Self {
        Self { framing: Framing::RTU_OVER_TCP, broadcast: true, ..Self::tcp() }
    }
}

/// Names a request until its event: never given twice within 2³² requests.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Ticket(u32);

/// What a client learns.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Event<'a> {
    /// A reply that fits its request, or the exception that refuses it. Of the bits of functions 1 and 2, as many as were asked
    /// for.
    Reply {
        /// The request.
        ticket: Ticket,
        /// Who answers.
        unit: u8,
        /// What.
        reply: Reply<'a>,
    },
    /// A broadcast was sent. Nobody will answer.
    Announced {
        /// The request.
        ticket: Ticket,
    },
    /// There is no usable reply.
    Failed {
        /// The request.
        ticket: Ticket,
        /// Why.
        failure: Failure,
    },
    /// A reply that nobody waits for was dropped.
    Stray {
        /// Its transaction on TCP.
        transaction: Option<u16>,
        /// Who sent it.
        unit: u8,
        /// Its function code, without the bit that marks an exception.
        function: u8,
        /// The request that timed out and that it belongs to, as far as that can be told.
        late: Option<Ticket>,
        /// Off TCP: why it is not the reply that is waited for.
        mismatch: Option<Mismatch>,
    },
    /// The stream is damaged. On TCP the server is out of step: best reconnect.
    Damaged(DecodeError),
}

/// Why a request has no usable reply.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Failure {
    /// The reply did not come in time. Whether the request was carried out is unknown.
    #[error("no reply came in time; whether the request was carried out is unknown")]
    TimedOut,
    /// The connection broke while the request was out. Whether it was carried out is unknown.
    #[error("the connection broke; whether the request was carried out is unknown")]
    Disconnected,
    /// The connection broke before the request was sent.
    #[error("the connection broke before the request was sent")]
    NotSent,
    /// The reply with the transaction of the request cannot be its answer.
    #[error("the reply does not answer the request: {0}")]
    Refused(Mismatch),
    /// The reply is malformed.
    #[error("the reply is malformed: {0}")]
    Malformed(DecodeError),
}

/// The client's end of one connection or serial line, with `N` places for requests.
///
/// 1. [`request`](Self::request) at any time; 2. [`poll_transmit`](Self::poll_transmit) and send what it writes, until it gives
///    `None`; 3. [`handle_input`](Self::handle_input) what arrived, or [`handle_timeout`](Self::handle_timeout) when
///    [`poll_timeout`](Self::poll_timeout) has come, or [`handle_disconnect`](Self::handle_disconnect) when the connection is
///    gone; 4. [`poll_event`](Self::poll_event) until it gives `None`, then 2 again.
///
/// Every request ends in exactly one [`Event::Reply`], [`Event::Announced`] or [`Event::Failed`]. Its place is taken until that
/// was polled, so no event is ever lost: a full session refuses requests, and nothing is sent twice by itself. A reply that comes
/// after its time is dropped and told as [`Event::Stray`]; it never passes for another one's on TCP, and off TCP as far as
/// [`Config::settle`] reaches.
///
/// Bytes always advance: damage is told once and costs the frames that it touches. The buffer holds [`Decoder::CAPACITY`] bytes;
/// `handle_input` takes no more than fits.
#[derive(Debug, Clone)]
pub struct Client<const N: usize = 8> {
    config: Config,
    decoder: Decoder,
    slots: [Slot; N],
    next_ticket: u32,
    next_transaction: u16,
    last_input: Duration,
    /// Nothing is sent before.
    quiet_until: Duration,
    told: bool,
}

#[derive(Debug, Clone, Copy)]
struct Slot {
    state: State,
    ticket: Ticket,
    transaction: u16,
    unit: u8,
    deadline: Duration,
    pdu: PduBuf,
}

impl Slot {
    fn apply(&mut self, event: state::Event) {
        if let Some(next) = state::next(self.state, event) {
            self.state = next;
        }
    }

    fn waits(&self) -> bool {
        matches!(self.state, State::Sent | State::TimedOut)
    }
}

/// What becomes of a frame.
enum Verdict {
    Reply(usize),
    Failed(usize, Failure),
    Stray(Option<Mismatch>),
}

impl<const N: usize> Client<N> {
    /// The room that [`poll_transmit`](Self::poll_transmit) needs.
    pub const MAX_TRANSMIT: usize = Frame::MAX_LEN;

    /// A client without requests.
    pub const fn new(config: Config) -> Self {
        let slot = Slot {
            state: State::Free,
            ticket: Ticket(0),
            transaction: 0,
            unit: 0,
            deadline: Duration::ZERO,
            pdu: PduBuf::EMPTY,
        };
        Self {
            config,
            decoder: Decoder::new(config.framing, Side::Server),
            slots: [slot; N],
            next_ticket: 1,
            next_transaction: 1,
            last_input: Duration::ZERO,
            quiet_until: Duration::ZERO,
            told: false,
        }
    }

    /// Queues a request to a unit. Requests go out in the order in which they were made.
    ///
    /// # Errors
    /// When the specification does not allow the request, every place is taken, or a broadcast would read.
    pub fn request(&mut self, unit: u8, request: &Request<'_>) -> Result<Ticket, SessionError> {
        if self.is_broadcast(unit) && request.reads() {
            return Err(SessionError::BroadcastRead { function: request.function() });
        }
        let pdu = PduBuf::new(request)?;
        let transaction = self.unused_transaction();
        let (ticket, deadline) = (Ticket(self.next_ticket), Duration::ZERO);
        let slot = self.free_slot().ok_or(SessionError::Full { places: N })?;
        slot.apply(state::Event::Request);
        *slot = Slot { state: slot.state, ticket, transaction, unit, deadline, pdu };
        self.next_ticket = self.next_ticket.wrapping_add(1);
        self.next_transaction = transaction.wrapping_add(1);
        Ok(ticket)
    }

    /// Takes bytes from the server, and says how many: fewer than given until [`poll_event`](Self::poll_event) has made room.
    pub fn handle_input(&mut self, now: Duration, bytes: &[u8]) -> usize {
        self.see_silence(now);
        let taken = self.decoder.push(bytes);
        if taken > 0 {
            self.last_input = now;
        }
        taken
    }

    /// Ends the requests whose time is over, and sees whether the line has fallen silent.
    pub fn handle_timeout(&mut self, now: Duration) {
        self.see_silence(now);
        for slot in &mut self.slots {
            if slot.state == State::Sent && now >= slot.deadline {
                slot.apply(state::Event::Deadline);
                if !self.config.framing.has_transactions() {
                    self.quiet_until = self.quiet_until.max(now + self.config.settle);
                }
            }
        }
    }

    /// The connection is gone. Requests that were out end as [`Failure::Disconnected`], those that were not as
    /// [`Failure::NotSent`]: nothing that waited goes out on the next connection unless the caller asks again.
    pub fn handle_disconnect(&mut self) {
        for slot in &mut self.slots {
            slot.apply(state::Event::Disconnect);
        }
        self.decoder.reset();
        self.told = false;
    }

    /// Writes the next request that may go out, and gives its length.
    ///
    /// `out` has room for [`MAX_TRANSMIT`](Self::MAX_TRANSMIT) bytes: with less, nothing is sent.
    pub fn poll_transmit(&mut self, now: Duration, out: &mut [u8]) -> Option<usize> {
        if now < self.ready_at() || !self.may_send() {
            return None;
        }
        let out = out.get_mut(..Self::MAX_TRANSMIT)?;
        let index = self.first_in(|state| state == State::Queued)?;
        let (config, slot) = (self.config, self.slots.get_mut(index)?);
        let transaction = config.framing.has_transactions().then_some(slot.transaction);
        let len = Frame { transaction, unit: slot.unit, pdu: slot.pdu.as_bytes() }.encode(out).ok()?;
        if config.broadcast && slot.unit == 0 {
            slot.apply(state::Event::Announce);
            self.quiet_until = now + config.turnaround;
        } else {
            slot.apply(state::Event::Transmit);
            slot.deadline = now + config.timeout;
        }
        Some(len)
    }

    /// What has happened.
    pub fn poll_event(&mut self) -> Option<Event<'_>> {
        loop {
            match self.decoder.advance() {
                Some(Ok(range)) => {
                    self.told = false;
                    let frame = self.decoder.frame(range.clone())?;
                    match self.judge(frame) {
                        Verdict::Reply(index) => {
                            let slot = self.slots.get_mut(index)?;
                            slot.apply(state::Event::Reply);
                            let (slot, frame) = (self.slots.get(index)?, self.decoder.frame(range)?);
                            let reply = Reply::decode(frame.pdu).ok()?.for_request(&slot.pdu);
                            return Some(Event::Reply { ticket: slot.ticket, unit: frame.unit, reply });
                        }
                        Verdict::Failed(index, failure) => {
                            let slot = self.slots.get_mut(index)?;
                            slot.apply(state::Event::Reply);
                            return Some(Event::Failed { ticket: slot.ticket, failure });
                        }
                        Verdict::Stray(mismatch) => {
                            let (transaction, unit) = (frame.transaction, frame.unit);
                            let function = frame.pdu.first().copied().unwrap_or_default() & 0x7F;
                            let late = self.expired(transaction);
                            return Some(Event::Stray { transaction, unit, function, late, mismatch });
                        }
                    }
                }
                Some(Err(_)) if self.told => {}
                Some(Err(error)) => return Some(Event::Damaged(error)),
                None => break,
            }
        }
        if let (Some(error), Framing::Tcp, false) = (self.decoder.damage(), self.config.framing, self.told) {
            self.told = true;
            return Some(Event::Damaged(error));
        }
        self.report()
    }

    /// When to call [`handle_timeout`](Self::handle_timeout), then poll again.
    pub fn poll_timeout(&self) -> Option<Duration> {
        let silence = self.config.framing.silence().filter(|_| self.decoder.pending() > 0);
        let silence = silence.map(|silence| self.last_input + silence);
        let deadline =
            self.slots.iter().filter(|slot| slot.state == State::Sent).map(|slot| slot.deadline).min();
        let sends = self.may_send() && self.slots.iter().any(|slot| slot.state == State::Queued);
        let sends = sends.then(|| self.ready_at());
        [silence, deadline, sends].into_iter().flatten().min()
    }

    /// How many requests are out.
    pub fn in_flight(&self) -> usize {
        self.slots.iter().filter(|slot| slot.state == State::Sent).count()
    }

    /// Off TCP there is no transaction to tell replies apart by: one request at a time, and none before the caller has been told
    /// that the last one timed out.
    fn may_send(&self) -> bool {
        if self.config.framing.has_transactions() {
            self.in_flight() < self.config.in_flight.max(1)
        } else {
            !self.slots.iter().any(Slot::waits)
        }
    }

    fn is_broadcast(&self, unit: u8) -> bool {
        self.config.broadcast && unit == 0
    }

    fn ready_at(&self) -> Duration {
        let idle = self.config.framing.idle();
        if idle.is_zero() { self.quiet_until } else { self.quiet_until.max(self.last_input + idle) }
    }

    fn see_silence(&mut self, now: Duration) {
        if let Some(silence) = self.config.framing.silence()
            && self.decoder.pending() > 0
            && now >= self.last_input + silence
        {
            self.decoder.finish();
        }
    }

    fn judge(&self, frame: Frame<&[u8]>) -> Verdict {
        let mut waiting = self.slots.iter().enumerate().filter(|(_, slot)| slot.waits());
        let found = match frame.transaction {
            Some(transaction) => waiting.find(|(_, slot)| slot.transaction == transaction),
            None => waiting.min_by_key(|(_, slot)| slot.ticket),
        };
        let Some((index, slot)) = found else { return Verdict::Stray(None) };
        let mismatch = if slot.unit != frame.unit && !self.config.any_unit {
            Mismatch::Unit { expected: slot.unit, found: frame.unit }
        } else {
            let reply = match Reply::decode(frame.pdu) {
                Ok(reply) => reply,
                Err(error) => return Verdict::Failed(index, Failure::Malformed(error)),
            };
            match slot.pdu.request().map(|request| reply.answers(&request)) {
                Ok(Ok(())) => return Verdict::Reply(index),
                Ok(Err(mismatch)) => mismatch,
                Err(error) => return Verdict::Failed(index, Failure::Malformed(error)),
            }
        };
        match frame.transaction {
            Some(_) => Verdict::Failed(index, Failure::Refused(mismatch)),
            // Without a transaction it may be a late reply to an earlier request: the right one may still come.
            None => Verdict::Stray(Some(mismatch)),
        }
    }

    /// The request that a stray reply belongs to, which then expects no more.
    fn expired(&mut self, transaction: Option<u16>) -> Option<Ticket> {
        let expired = |slot: &&mut Slot| slot.state == State::Expired;
        let mut slots = self.slots.iter_mut().filter(expired);
        let slot = match transaction {
            Some(transaction) => slots.find(|slot| slot.transaction == transaction)?,
            None => slots.max_by_key(|slot| slot.ticket)?,
        };
        slot.apply(state::Event::Reply);
        Some(slot.ticket)
    }

    fn report(&mut self) -> Option<Event<'static>> {
        let ended =
            |state| matches!(state, State::TimedOut | State::Lost | State::NotSent | State::Announced);
        let index = self.first_in(ended)?;
        let slot = self.slots.get_mut(index)?;
        let ticket = slot.ticket;
        let failure = match slot.state {
            State::TimedOut => Failure::TimedOut,
            State::Lost => Failure::Disconnected,
            State::NotSent => Failure::NotSent,
            State::Announced | State::Free | State::Queued | State::Sent | State::Expired => {
                slot.apply(state::Event::Report);
                return Some(Event::Announced { ticket });
            }
        };
        slot.apply(state::Event::Report);
        Some(Event::Failed { ticket, failure })
    }

    /// The oldest request in such a state.
    fn first_in(&self, wanted: impl Fn(State) -> bool) -> Option<usize> {
        let age = |slot: &Slot| self.next_ticket.wrapping_sub(slot.ticket.0);
        let slots = self.slots.iter().enumerate().filter(|(_, slot)| wanted(slot.state));
        slots.max_by_key(|(_, slot)| age(slot)).map(|(index, _)| index)
    }

    /// An empty place, or that of the request that expired longest ago.
    fn free_slot(&mut self) -> Option<&mut Slot> {
        let index = match self.first_in(|state| state == State::Free) {
            Some(index) => index,
            None => self.first_in(|state| state == State::Expired)?,
        };
        self.slots.get_mut(index)
    }

    fn unused_transaction(&self) -> u16 {
        let mut transaction = self.next_transaction;
        while self.slots.iter().any(|slot| slot.state != State::Free && slot.transaction == transaction) {
            transaction = transaction.wrapping_add(1);
        }
        transaction
    }
}
