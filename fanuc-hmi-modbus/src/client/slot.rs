//! The bytes of a request, and the check whether a frame can be its reply.

use super::event::Ticket;
use super::machine::ReplyMatch;
use crate::error::{DecodeError, Mismatch};
use crate::frame::{Frame, RtuLen, Side};
use crate::message::function::{self, Row};
use crate::message::{PduBuf, Reply, Request};

/// The bytes of a request, and then of its reply.
#[derive(Debug, Clone, Copy)]
pub(super) struct RequestSlot {
    pub(super) ticket: Ticket,
    pub(super) unit: u8,
    /// The number of bits or registers that the request reads.
    pub(super) quantity: u16,
    pub(super) is_reply: bool,
    /// Whether the reply can equal the request.
    pub(super) is_mirrored: bool,
    pub(super) pdu: PduBuf,
}

/// The request whose reply shows that a device answers: the reply has 2 bytes of data, and so begins in another way than the
/// request.
const PROBE: Request<'static> = Request::ReadHoldingRegisters { address: 0, quantity: 1 };

/// The part of a reply that some bytes begin.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ReplyPrefix {
    /// The beginning of the reply.
    Part,
    /// The whole reply.
    Whole,
    /// Another request.
    Other,
}

/// The reason that a frame cannot be the reply to a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum MismatchReason {
    Mismatch(Mismatch),
    Malformed(DecodeError),
}

impl RequestSlot {
    pub(super) const EMPTY: Self = Self {
        ticket: Ticket { number: 0, slot: 0 },
        unit: 0,
        quantity: 0,
        is_reply: false,
        is_mirrored: false,
        pdu: PduBuf::EMPTY,
    };

    /// Returns the read before the request in this slot.
    #[cold]
    pub(super) fn probe(&self) -> Self {
        let pdu = PduBuf::new(&PROBE).unwrap_or(PduBuf::EMPTY);
        Self { unit: self.unit, quantity: PROBE.quantity_read(), pdu, ..Self::EMPTY }
    }

    /// Returns whether a frame can be the reply to the request in this slot.
    #[inline(always)]
    pub(super) fn fit(&self, frame: &Frame<&[u8]>, any_unit: bool) -> Result<ReplyMatch, MismatchReason> {
        if self.unit != frame.unit && !any_unit {
            return Err(MismatchReason::Mismatch(Mismatch::Unit { expected: self.unit, found: frame.unit }));
        }
        let reply = Reply::decode(frame.pdu).map_err(MismatchReason::Malformed)?;
        match reply {
            // The requested quantity is known without the request, and a reply of registers is not equal to it.
            Reply::HoldingRegisters(words)
            | Reply::InputRegisters(words)
            | Reply::ReadWriteRegisters(words)
                if self.pdu.function() == reply.function() && words.len() == usize::from(self.quantity) =>
            {
                Ok(ReplyMatch::Full)
            }
            reply => self.answered(frame, &reply),
        }
    }

    #[inline(never)]
    fn answered(&self, frame: &Frame<&[u8]>, reply: &Reply<'_>) -> Result<ReplyMatch, MismatchReason> {
        let request = self.pdu.request().map_err(MismatchReason::Malformed)?;
        reply.answers(&request).map_err(MismatchReason::Mismatch)?;
        Ok(match reply {
            Reply::Exception { .. } => ReplyMatch::Exception,
            _ if frame.unit == self.unit && frame.pdu == self.pdu.as_bytes() => ReplyMatch::Equal,
            _ => ReplyMatch::Full,
        })
    }

    /// Returns whether an RTU frame with the reply to the request in this slot begins with these bytes.
    pub(super) fn begins_reply(&self, bytes: &[u8], any_unit: bool) -> ReplyPrefix {
        let asked = self.pdu.function();
        let is_unit = |unit: &u8| any_unit || *unit == self.unit;
        let is_function = |code: &u8| code & !function::EXCEPTION == asked;
        if !bytes.first().is_none_or(is_unit) || !bytes.get(1).is_none_or(is_function) {
            return ReplyPrefix::Other;
        }
        let is_whole = || Frame::decode_rtu_whole(bytes).is_ok();
        match RtuLen::of(bytes, Side::Server) {
            RtuLen::Known(length) if !self.has_asked_count(bytes) || length < bytes.len() => {
                ReplyPrefix::Other
            }
            RtuLen::Known(length) if length > bytes.len() => ReplyPrefix::Part,
            RtuLen::Known(_) if !is_whole() => ReplyPrefix::Other,
            RtuLen::Silence if !is_whole() => ReplyPrefix::Part,
            RtuLen::AtLeast(_) => ReplyPrefix::Part,
            RtuLen::Known(_) | RtuLen::Silence => ReplyPrefix::Whole,
        }
    }

    /// Returns whether the reply to a read, as far as it has come, has the requested byte count.
    fn has_asked_count(&self, reply: &[u8]) -> bool {
        match *reply {
            [_, code, count, ..] if code == self.pdu.function() && self.quantity > 0 => {
                u16::from(count) == Row::of(code).bytes(self.quantity)
            }
            _ => true,
        }
    }

    /// Replaces the request by its reply.
    pub(super) fn keep_reply(&mut self, pdu: &[u8]) {
        self.pdu.hold(pdu);
        self.is_reply = true;
    }
}
