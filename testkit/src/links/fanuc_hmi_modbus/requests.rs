//! The requests of the client's user, and the replies that may still come.

use fanuc_hmi_modbus::client::machine::{ReplyMatch, SlotSet};

use super::pieces::{DecoderContents, Follows, Frame, PROBE, Piece, Shape};

pub(super) const ENDED_TWICE: &str = "each request has one outcome";
pub(super) const SENT: &str = "not sent was not sent, everything else was; nothing is sent twice";

/// The model's knowledge of the requests.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Knowledge {
    /// In each slot.
    pub(super) jobs: [Option<Job>; 2],
    /// The places whose outcome is not polled yet, oldest first.
    pub(super) outcomes: Vec<u8>,
    /// Replies that may still come to requests that have ended.
    pub(super) stale: Vec<Stale>,
    pub(super) is_up: bool,
    /// Bytes have come since the last tick.
    pub(super) is_arriving: bool,
    /// The bytes that arrive now, whether their end is still to be handled, and whether they come after a silence.
    pub(super) arriving: Vec<Piece>,
    pub(super) ends: bool,
    pub(super) is_first: bool,
    /// The client's decoder, whether it holds the beginning of the reply in flight, and the frame that the client judges now.
    pub(super) held: DecoderContents,
    pub(super) awaits: bool,
    pub(super) judged: Option<(Frame, ReplyMatch)>,
    /// The slot of the request before which a read is in flight, and the time left for its reply.
    pub(super) probing: Option<(u8, Option<u8>)>,
    /// A reply has come on this connection that the line cannot have returned.
    pub(super) is_proven: bool,
    /// Ticks for which the units execute a broadcast.
    pub(super) deaf: u8,
    pub(super) wrong: Option<&'static str>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct Job {
    pub(super) kind: Kind,
    pub(super) transaction: u16,
    pub(super) was_sent: bool,
    /// The time left for its reply; `None` if none can come. Off TCP a reply whose time is over has arrived: a driver reads
    /// it before it handles a timeout.
    pub(super) reply: Option<u8>,
    /// The read before it has ended.
    pub(super) was_probed: bool,
    /// Whether it waited when a connection was lost.
    pub(super) is_stale: bool,
    pub(super) has_ended: bool,
}

/// The request of a job.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Kind {
    /// A read.
    Read,
    /// A write, which its reply equals.
    Write,
    /// A write to every unit.
    Broadcast,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) struct Stale {
    /// `None` if another client may have asked.
    pub(super) kind: Option<Kind>,
    pub(super) transaction: u16,
    pub(super) left: u8,
}

impl Knowledge {
    /// The beginning of a reply that the decoder holds last.
    pub(super) fn part(&self) -> Option<Frame> {
        if let Some(Piece::Part(frame)) = self.held.last() { Some(frame) } else { None }
    }

    pub(super) fn kind_of(&self, slot: u8) -> Option<Kind> {
        self.jobs[usize::from(slot)].map(|job| job.kind)
    }

    /// An outcome, with whether the request was sent. Returns whether it is the first one.
    pub(super) fn end(&mut self, slot: u8, was_sent: bool) -> bool {
        let job = self.jobs[usize::from(slot)].as_mut().filter(|job| !job.has_ended);
        let Some(job) = job else {
            self.wrong = Some(ENDED_TWICE);
            return false;
        };
        if job.was_sent != was_sent {
            self.wrong = Some(SENT);
        }
        job.has_ended = true;
        self.outcomes.push(slot);
        self.forget(slot);
        true
    }

    pub(super) fn end_all(&mut self, slots: SlotSet, was_sent: bool) {
        for slot in slots.iter() {
            self.end(slot, was_sent);
        }
    }

    /// The reply to the request in this place is a stale one from now on.
    pub(super) fn forget(&mut self, slot: u8) {
        let Some(job) = &mut self.jobs[usize::from(slot)] else { return };
        let (kind, transaction, reply) = (job.kind, job.transaction, job.reply.take());
        (job.transaction, job.was_probed, job.is_stale) = (0, false, false);
        self.grow_stale(Some(kind), transaction, reply);
        self.held.forget(slot);
    }

    /// A stale reply may come more than once.
    pub(super) fn grow_stale(&mut self, kind: Option<Kind>, transaction: u16, reply: Option<u8>) {
        let Some(left) = reply else { return };
        let is_alike = |stale: &&mut Stale| (stale.kind, stale.transaction) == (kind, transaction);
        match self.stale.iter_mut().find(is_alike) {
            Some(stale) => stale.left = stale.left.max(left),
            None => self.stale.push(Stale { kind, transaction, left }),
        }
        self.stale.sort_unstable();
    }

    /// The server answers a request once.
    pub(super) fn answer(&mut self, frame: Frame) {
        if let Some(Some(job)) = self.jobs.get_mut(usize::from(frame.id)) {
            job.reply = None;
        }
        if let (PROBE, Some((_, reply))) = (frame.id, &mut self.probing) {
            *reply = None;
        }
    }

    pub(super) fn replies(&mut self) -> impl Iterator<Item = &mut Option<u8>> {
        let jobs = self.jobs.iter_mut().flatten().map(|job| &mut job.reply);
        jobs.chain(self.probing.iter_mut().map(|(_, reply)| reply))
    }

    pub(super) fn age(&mut self) {
        self.replies().flatten().for_each(|left| *left = left.saturating_sub(1));
        self.stale.iter_mut().for_each(|stale| stale.left = stale.left.saturating_sub(1));
    }

    /// Drops the replies whose time is over: the bytes that have arrived were read.
    pub(super) fn read(&mut self) {
        self.replies().for_each(|reply| *reply = reply.filter(|left| *left > 0));
        self.stale.retain(|stale| stale.left > 0);
    }
}

impl Shape {
    /// Returns whether a frame can be the reply to the request in flight, if there is one.
    pub(super) fn fit(self, asked: Option<Kind>, follows: Follows) -> ReplyMatch {
        match (self, asked) {
            (_, None) | (Self::Read, Some(Kind::Read)) => ReplyMatch::Full,
            (Self::Write, Some(Kind::Write)) => ReplyMatch::Equal,
            (Self::ReadRefused, Some(Kind::Read)) | (Self::WriteRefused, Some(Kind::Write)) => {
                match follows {
                    Follows::More => ReplyMatch::Exception,
                    Follows::Nothing => ReplyMatch::OpenException,
                    Follows::Silence => ReplyMatch::Full,
                }
            }
            _ => ReplyMatch::Mismatch,
        }
    }
}
