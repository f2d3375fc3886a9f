//! A client of another maker and keeps the source's rules: FM-2, FM-4, FM-10 and FM-43.
//!
//! Through TCP it has any number of open requests; elsewhere it waits for its reply, or until no reply can arrive any more.

use core::time::Duration;

use fanuc_hmi_modbus::{Frame, Reply, Request, Side};
use robot_session::Encode as _;

use super::bank::{Asked, held, is_held};
use super::{Cell, MS, SETTLE, UNIT, Way};
use crate::link::{Delivery, End};
use crate::soak::Reported;
use robot_session::contract::Rng;

pub(super) struct AnyClient {
    pub(super) open: Vec<Open>,
    /// The largest number of open requests.
    most: usize,
    transaction: u16,
    held: Vec<u8>,
    /// The time at which it has received something.
    heard: Duration,
    silence: Duration,
    /// The time before which it sends nothing.
    quiet_until: Duration,
}

pub(super) struct Open {
    pub(super) job: usize,
    transaction: Option<u16>,
    gives_up_at: Duration,
}

impl AnyClient {
    pub(super) fn new(way: Way, silence: Duration, quiet_until: Duration, rng: &mut Rng) -> Self {
        let most = if way == Way::Tcp { 1 + rng.below(8) } else { 1 };
        let transaction = rng.next_u64() as u16;
        Self {
            open: Vec::new(),
            most,
            transaction,
            held: Vec::new(),
            heard: quiet_until,
            silence,
            quiet_until,
        }
    }

    pub(super) fn next(&self) -> Option<Duration> {
        let quiet = Some(self.quiet_until).filter(|_| self.open.is_empty());
        let frame = Some(self.heard + self.silence).filter(|_| !self.held.is_empty());
        self.open.iter().map(|open| open.gives_up_at).chain(quiet).chain(frame).min()
    }

    /// Removes and returns the next reply in the buffer.
    fn take(&mut self, way: Way) -> Option<Vec<u8>> {
        let length = match way {
            Way::Tcp => Frame::decode_tcp(&self.held).expect("TCP corrupts nothing")?.1,
            Way::RtuOverTcp => Frame::decode_rtu(&self.held, Side::Server).ok()??.1,
            // The bytes between two silences are a single frame, or are dropped.
            Way::Rtu => {
                let held = core::mem::take(&mut self.held);
                let length = Frame::decode_rtu(&held, Side::Server).ok()??.1;
                return (length == held.len()).then_some(held);
            }
        };
        Some(self.held.drain(..length).collect())
    }
}

impl Cell {
    /// Sends a request; returns whether there was a free slot for it.
    pub(super) fn send(&mut self, unit: u8, request: &Request<'_>, rng: &mut Rng) -> bool {
        let Some(other) = &mut self.other else { return false };
        if other.open.len() >= other.most || self.now < other.quiet_until || self.lost[0] {
            return false;
        }
        other.transaction = other.transaction.wrapping_add(1 + rng.below(3) as u16);
        let transaction = (self.way == Way::Tcp).then_some(other.transaction);
        let mut out = [0; Frame::MAX_LEN];
        let length =
            Frame { transaction, unit, pdu: *request }.encode(&mut out).expect("a buffer of a frame");
        let job = self.ledger.send(self.wire.mark());
        let longest = if self.way == Way::Tcp { 5000 * MS } else { SETTLE };
        let patience = if self.way == Way::Tcp { rng.log_uniform(500 * MS, longest) } else { longest };
        if unit == 0 {
            self.ledger.report(job, Reported::Unknown, self.wire.mark());
            other.quiet_until = self.now + 500 * MS;
        } else {
            other.open.push(Open { job, transaction, gives_up_at: self.now + patience });
        }
        if self.way == Way::Rtu {
            other.held.clear();
        }
        self.wire.send(End::A, self.now, &out[..length]);
        true
    }

    /// Runs the other client in place of the project's own.
    pub(super) fn listen(&mut self, other: &mut AnyClient) {
        while let Some(delivery) = self.wire.receive(End::A, self.now) {
            let Delivery::Bytes(bytes) = delivery else { continue };
            self.end_of_frame(other);
            other.held.extend(bytes);
            other.heard = self.now;
            while self.way != Way::Rtu
                && let Some(bytes) = other.take(self.way)
            {
                self.judge(other, &bytes);
            }
        }
        self.end_of_frame(other);
        self.lost[0] |= !self.wire.is_connected() && self.wire.next_delivery().is_none();
        let (now, healed) = (self.now, self.healed);
        for open in other.open.extract_if(.., |open| open.gives_up_at <= now) {
            self.stuck |= healed;
            self.ledger.report(open.job, Reported::Unknown, self.wire.mark());
        }
    }

    /// Called when a frame ends, on a serial line with a silence.
    fn end_of_frame(&mut self, other: &mut AnyClient) {
        if self.way == Way::Rtu
            && self.now >= other.heard + other.silence
            && let Some(bytes) = other.take(self.way)
        {
            self.judge(other, &bytes);
        }
    }

    fn judge(&mut self, other: &mut AnyClient, bytes: &[u8]) {
        let frame = match self.way {
            Way::Tcp => Frame::decode_tcp(bytes).ok().flatten().map(|(frame, _)| frame),
            Way::Rtu | Way::RtuOverTcp => {
                Frame::decode_rtu(bytes, Side::Server).ok().flatten().map(|(frame, _)| frame)
            }
        };
        let Some(frame) = frame.filter(|frame| frame.unit == UNIT) else { return };
        let place = other.open.iter().position(|open| open.transaction == frame.transaction);
        let Some(place) = place else {
            // To a request that it has given up.
            return;
        };
        let job = other.open.remove(place).job;
        let reply = frame.reply().expect("a reply").pdu;
        self.log.line(self.now, format_args!("  client: job {job}: {reply:?}"));
        let is_right = match (&self.asked[job], &reply) {
            // As many as fill the last byte.
            (Asked::Coils(address, count), Reply::Coils(bits)) => {
                let mut bits = bits.iter().take(*count).enumerate();
                bits.all(|(i, bit)| bit == (held(*address, i) & 4 != 0))
            }
            (asked, reply) => is_held(asked, reply),
        };
        if is_right {
            self.ledger.execute(job);
        }
        let refused = matches!(reply, Reply::Exception { .. });
        self.ledger.report(job, if refused { Reported::NotDone } else { Reported::Done }, self.wire.mark());
    }

    /// Called when the connection of the other client is gone, or the client is restarted.
    pub(super) fn forget(&mut self) {
        let Some(other) = &mut self.other else { return };
        other.held.clear();
        for open in other.open.drain(..) {
            self.ledger.report(open.job, Reported::Unknown, self.wire.mark());
        }
    }
}
