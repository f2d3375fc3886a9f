//! The client's end ("master").

mod config;
mod event;
mod input;
pub mod machine;
mod request_state;
mod slot;
mod slot_set;

use core::ops::Range;
use core::time::Duration;

use robot_session::Encode as _;
use robot_session::end::{Core, Echo, End, EventQueue, QueueSpace};

pub use config::ClientConfig;
#[doc(hidden)]
pub use config::Rule;
pub use event::{ClientEvent, ClientStatistics, Failure, Ticket};
use machine::{Action, ClientMachine, DueRequest, Input, ReplyMatch, RequestState, SlotSet, Stage};
use slot::{MismatchReason, ReplyPrefix, RequestSlot};

use crate::decoder::Decoder;
use crate::error::{ConfigError, DecodeError, Mismatch, SessionError};
use crate::frame::{Frame, Side};
use crate::message::{PduBuf, Reply, Request};

/// The client's end of one connection or serial line, with `N` request slots, 16 at most.
///
/// A [`Session`](robot_session::Session) with the methods and the order of calls of the trait. Call
/// [`request`](Self::request) at any time; requests are sent in the order in which they were made, and wait for a connection
/// if there is none at that time.
///
/// Every request ends in exactly one [`ClientEvent::Replied`], [`ClientEvent::Announced`] or [`ClientEvent::Failed`], and is
/// sent once at most. Its slot is occupied until that event was polled, so no event is ever lost: a full client refuses
/// requests. The reply is stored in the slot of its request: [`reply`](Self::reply) returns it until the next request uses
/// the slot.
///
/// A reply that comes after its request has timed out is dropped and reported as [`ClientEvent::Stray`]. On TCP it is never
/// taken for the reply to another request; otherwise not within [`ClientConfig::settle`].
///
/// All bytes are taken. Corrupt bytes cost the frames that they touch and are reported. A reply after them is accepted if it
/// fits, except for an exception in RTU frames: it may be data of the damaged reply.
#[derive(Debug, Clone)]
pub struct Client<const N: usize = 8> {
    core: Core<ClientMachine<N>, Decoder, EventQueue<ClientEvent, EVENTS>, ClientStatistics>,
    slots: [RequestSlot; N],
    echo: Echo<{ Frame::MAX_LEN }>,
    /// Whether the bytes before those that are read now ended within corruption.
    was_corrupt: bool,
    /// Whether the bytes that were read last may be the beginning of a reply.
    waits_for_rest: bool,
}

/// The length of the event queue: an outcome for every slot fits.
const EVENTS: usize = 16;

impl<const N: usize> Client<N> {
    /// Creates a client without a connection and without requests.
    ///
    /// # Errors
    /// No request can be in flight, or more than there are slots; the timeout is zero; the configuration sets `echo` over
    /// TCP.
    pub fn new(config: ClientConfig) -> Result<Self, ConfigError> {
        const { assert!(N >= 1 && N <= EVENTS, "a client has 1 to 16 places") };
        let most = if config.framing.has_transactions() { N } else { 1 };
        if !(1..=most).contains(&config.in_flight) {
            return Err(ConfigError::InFlight { found: config.in_flight, most });
        }
        if config.timeout.is_zero() {
            return Err(ConfigError::Timeout);
        }
        if config.echo && config.framing.has_transactions() {
            return Err(ConfigError::Echo);
        }
        Ok(Self {
            core: Core::new(config, ClientMachine::NEW, Decoder::new(config.framing, Side::Server)),
            slots: [RequestSlot::EMPTY; N],
            echo: Echo::new(config.echo),
            was_corrupt: false,
            waits_for_rest: false,
        })
    }

    /// Makes a request to a unit.
    ///
    /// # Errors
    /// The specification does not allow the request, every slot is occupied, or a broadcast would read.
    pub fn request(&mut self, unit: u8, request: &Request<'_>) -> Result<Ticket, SessionError> {
        let broadcast = self.core.config.is_broadcast(unit);
        if broadcast && request.reads() {
            return Err(SessionError::BroadcastRead { function: request.function() });
        }
        let free = self.core.machine.free_slot();
        let Some((slot, kept)) = free.and_then(|free| Some((free, self.slots.get_mut(usize::from(free))?)))
        else {
            PduBuf::new(request)?;
            return Err(SessionError::Full { places: N });
        };
        // A request that cannot be written leaves the previous reply unchanged.
        kept.pdu.put(request)?;
        let ticket = Ticket { number: self.core.statistics.requests + 1, slot };
        (kept.ticket, kept.unit) = (ticket, unit);
        let mirrored = request.is_mirrored();
        (kept.quantity, kept.is_reply, kept.is_mirrored) = (request.quantity_read(), false, mirrored);
        self.core.statistics.requests += 1;
        self.tell(Input::Request { broadcast, mirrored });
        Ok(ticket)
    }

    /// Returns the reply to a request: from its [`ClientEvent::Replied`] on, until another request uses its slot.
    #[inline]
    pub fn reply(&self, ticket: Ticket) -> Option<Reply<'_>> {
        let slot = self.slots.get(usize::from(ticket.slot))?;
        if slot.ticket != ticket || !slot.is_reply {
            return None;
        }
        Some(Reply::decode(slot.pdu.as_bytes()).ok()?.with_bits(slot.quantity))
    }

    /// Returns the number of requests in flight.
    pub fn in_flight(&self) -> usize {
        self.core.machine.in_flight()
    }

    /// Returns the number of bytes of a partial reply. If there are any after the timeout of its request, on TCP, the server
    /// has truncated it, or may continue it at any time: reconnect.
    pub const fn pending(&self) -> usize {
        self.core.decoder.pending_reply()
    }

    /// Gives the machine an input that changes only its state.
    #[inline(always)] // as `ClientMachine::on`
    fn tell(&mut self, input: Input) {
        if let Err(unexpected) = self.core.on(Duration::ZERO, input) {
            self.refuse(unexpected);
        }
    }

    /// Returns whether a frame can be the reply to the request that it seems to belong to; if there is no such request, it
    /// fits.
    #[inline(always)]
    fn fit(&self, frame: &Frame<&[u8]>) -> Result<ReplyMatch, MismatchReason> {
        match self.core.machine.expects(frame.transaction.unwrap_or(0), &self.core.config) {
            Some(RequestState { slot, stage: Stage::Probing { .. } }) => self.fit_probe(*slot, frame),
            Some(RequestState { slot, .. }) => self.fit_of(*slot, frame),
            None => Ok(ReplyMatch::Full),
        }
    }

    /// Returns whether a frame can be the reply to the read before the request in this slot.
    #[cold]
    fn fit_probe(&self, slot: u8, frame: &Frame<&[u8]>) -> Result<ReplyMatch, MismatchReason> {
        let probe = self.slots.get(usize::from(slot)).map(RequestSlot::probe);
        probe.map_or(Ok(ReplyMatch::Full), |probe| probe.fit(frame, self.core.config.any_unit))
    }

    /// Returns whether a frame can be the reply to the request in this slot.
    #[inline(always)]
    fn fit_of(&self, slot: u8, frame: &Frame<&[u8]>) -> Result<ReplyMatch, MismatchReason> {
        match self.slots.get(usize::from(slot)) {
            Some(slot) => slot.fit(frame, self.core.config.any_unit),
            None => Ok(ReplyMatch::Full),
        }
    }

    /// Returns whether the waiting bytes may be the beginning of the reply to the request in flight: from the first of them,
    /// or from a later one after noise, unless the whole reply is there.
    #[cold]
    fn holds_partial(&self) -> bool {
        let Self { core, slots, .. } = self;
        let Some(RequestState { slot, stage }) = core.machine.expects(0, &core.config) else { return false };
        let Some(slot) = slots.get(usize::from(*slot)) else { return false };
        let probe = matches!(stage, Stage::Probing { .. }).then(|| slot.probe());
        let slot = probe.as_ref().unwrap_or(slot);
        let held = core.decoder.held();
        let begins = (0..held.len())
            .map(|at| slot.begins_reply(held.get(at..).unwrap_or_default(), core.config.any_unit));
        let mut later = false;
        for (at, begins) in begins.enumerate() {
            match begins {
                ReplyPrefix::Part if at == 0 => return true,
                ReplyPrefix::Part => later = true,
                ReplyPrefix::Whole => return false,
                ReplyPrefix::Other => {}
            }
        }
        later
    }

    #[cold]
    fn stray(&mut self, late: Option<u8>, frame: Option<Range<usize>>) {
        let Some(frame) = frame.and_then(|range| self.core.decoder.frame(range)) else { return };
        let misfit = self.fit(&frame).err();
        self.core.statistics.strays += 1;
        self.core.events.push_notice(ClientEvent::Stray {
            transaction: frame.transaction,
            expected: frame.transaction.and_then(|_| self.core.machine.awaited()),
            unit: frame.unit,
            function: frame.pdu.first().copied().unwrap_or_default() & 0x7F,
            late: late.and_then(|slot| self.ticket(slot)),
            mismatch: match misfit {
                Some(MismatchReason::Mismatch(mismatch)) => Some(mismatch),
                Some(MismatchReason::Malformed(_)) | None => None,
            },
        });
    }

    #[inline(always)]
    fn replied(&mut self, slot: u8, frame: Option<Range<usize>>) {
        let Some(frame) = frame.and_then(|range| self.core.decoder.frame(range)) else { return };
        let Some(slot) = self.slots.get_mut(usize::from(slot)) else { return };
        slot.keep_reply(frame.pdu);
        self.core.statistics.replies += 1;
        let (ticket, unit) = (slot.ticket, frame.unit);
        self.core.push_outcome(ClientEvent::Replied { ticket, unit });
    }

    /// Reports the failure of a request that has ended; its slot still has the request.
    #[cold]
    fn refused(&mut self, slot: u8, frame: Option<Range<usize>>) {
        let Some(range) = frame else { return };
        let wrong_length = self.core.decoder.exception_error(&range);
        let Some(frame) = self.core.decoder.frame(range) else { return };
        let misfit = match self.fit_of(slot, &frame).err() {
            misfit @ Some(MismatchReason::Mismatch(Mismatch::Unit { .. })) => misfit,
            misfit => wrong_length.map(MismatchReason::Malformed).or(misfit),
        };
        match misfit {
            Some(MismatchReason::Malformed(error)) => self.fail(slot, Failure::Malformed(error)),
            Some(MismatchReason::Mismatch(mismatch)) => self.fail(slot, Failure::Refused(mismatch)),
            None => {}
        }
    }

    #[cold]
    fn fail_all(&mut self, slots: SlotSet, failure: Failure) {
        slots.iter().for_each(|slot| self.fail(slot, failure));
    }

    #[cold]
    fn corrupt(&mut self, error: DecodeError) {
        self.tell(Input::Corrupt);
        // Further bytes of the same corruption were reported already.
        if matches!(error, DecodeError::Noise { .. }) {
            return;
        }
        self.core.statistics.corrupt += 1;
        self.core.events.push_notice(ClientEvent::Corrupt(error));
    }

    #[cold]
    fn fail(&mut self, slot: u8, failure: Failure) {
        self.core.statistics.failures += 1;
        if let Some(ticket) = self.ticket(slot) {
            self.core.push_outcome(ClientEvent::Failed { ticket, failure });
        }
    }

    fn ticket(&self, slot: u8) -> Option<Ticket> {
        self.slots.get(usize::from(slot)).map(|slot| slot.ticket)
    }
}

impl<const N: usize> End for Client<N> {
    type Machine = ClientMachine<N>;
    type Decoder = Decoder;
    type Events = EventQueue<ClientEvent, EVENTS>;
    type Statistics = ClientStatistics;
    /// The range of a frame in the decoder.
    type Payload = Range<usize>;

    const LINK: &'static str = "fanuc-hmi-modbus";
    const END: &'static str = "client";
    /// A reply for every slot, in any framing.
    const MAX_INPUT: usize = EVENTS * Frame::MAX_LEN;
    const MAX_TRANSMIT: usize = Frame::MAX_LEN;
    /// The outcome of every slot fits the event queue.
    const QUEUE_SPACE: QueueSpace = QueueSpace::NONE;

    robot_session::core!(ClientEvent::Unexpected);
    robot_session::echo!(ClientEvent::Echo);

    fn discards_after(&self) -> Option<Duration> {
        Some(self.core.config.timeout)
    }

    #[inline(always)]
    fn next_input(&mut self) -> Option<(Input, Option<Range<usize>>)> {
        loop {
            let range = match self.core.decoder.advance()? {
                Ok(range) => range,
                Err(error) => {
                    self.corrupt(error);
                    continue;
                }
            };
            let frame = self.core.decoder.frame(range.clone())?;
            let mut fit = self.fit(&frame).unwrap_or(ReplyMatch::Mismatch);
            if fit == ReplyMatch::Exception {
                if self.core.decoder.exception_error(&range).is_some() {
                    fit = ReplyMatch::Mismatch;
                } else if self.core.decoder.is_last(&range) && !self.waits_for_rest {
                    fit = ReplyMatch::Full;
                } else if self.core.decoder.is_open(&range) {
                    fit = ReplyMatch::OpenException;
                }
            }
            let transaction = frame.transaction.unwrap_or(0);
            return Some((Input::Reply { transaction, fit }, Some(range)));
        }
    }

    #[inline(always)] // where the input is known, few actions are left
    fn act(&mut self, now: Duration, action: Action, frame: Option<Range<usize>>) {
        match action {
            Action::Nothing | Action::Keep { .. } | Action::Sent => {}
            Action::Replied { slot } => self.replied(slot, frame),
            Action::Announced { slot } => {
                if let Some(ticket) = self.ticket(slot) {
                    self.core.push_outcome(ClientEvent::Announced { ticket });
                }
            }
            Action::Refused { slot } => self.refused(slot, frame),
            Action::Stray { late } => self.stray(late, frame),
            Action::TimedOut { silent, returned } => {
                self.fail_all(silent, Failure::TimedOut);
                self.fail_all(returned, Failure::Returned);
            }
            Action::Reset { lost, not_sent } => {
                self.fail_all(lost, Failure::Disconnected);
                self.fail_all(not_sent, Failure::NotSent);
            }
            Action::Cut => self.finish(now),
            Action::Hold => {
                if let Some(frame) = frame {
                    self.core.decoder.put_back(&frame);
                }
            }
        }
    }

    #[inline(always)]
    fn write(&mut self, _now: Duration, due: DueRequest, out: &mut [u8]) -> Option<(usize, Input)> {
        let out = out.get_mut(..Self::MAX_TRANSMIT)?;
        let slot = self.slots.get(usize::from(due.slot))?;
        let transaction = self.core.decoder.has_transactions().then_some(due.transaction);
        let probe = due.probe.then(|| slot.probe());
        let slot = probe.as_ref().unwrap_or(slot);
        let length = Frame { transaction, unit: slot.unit, pdu: slot.pdu.as_bytes() }.encode(out).ok()?;
        if transaction.is_none() {
            // A broadcast is not answered.
            let is_proof = !slot.is_mirrored || self.core.config.is_broadcast(slot.unit);
            self.echo.sent(out.get(..length).unwrap_or_default(), is_proof);
        }
        Some((length, Input::Sent(due)))
    }

    #[inline(always)]
    fn begin_input(&mut self, now: Duration) -> bool {
        self.was_corrupt = self.core.decoder.corruption().is_some();
        match self.core.on(now, Input::Received) {
            Ok(Action::Cut) => self.finish(now),
            Ok(_) => {}
            Err(unexpected) => {
                self.refuse(unexpected);
                return false;
            }
        }
        true
    }

    /// Handles the end of a read. On TCP the server is out of step: its next valid frame may never come. Otherwise the rest
    /// of a reply may still come.
    #[inline(always)]
    fn end_input(&mut self, now: Duration) {
        if !self.core.decoder.has_transactions() {
            self.waits_for_rest = self.core.decoder.pending() > 0 && self.holds_partial();
            if self.waits_for_rest {
                self.advance(now, Input::Partial, None);
            }
        }
        let has_transactions = self.core.decoder.has_transactions();
        if let (true, false, Some(error)) =
            (has_transactions, self.was_corrupt, self.core.decoder.corruption())
        {
            self.core.events.push_notice(ClientEvent::OutOfStep(error));
        }
    }

    #[inline]
    fn next_event(&mut self) -> Option<ClientEvent> {
        let event = self.core.events.pop()?;
        if let Some(ticket) = event.outcome_of() {
            self.tell(Input::Taken { slot: ticket.slot });
        }
        Some(event)
    }
}
