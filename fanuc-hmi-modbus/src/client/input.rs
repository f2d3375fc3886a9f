//! The inputs and actions of a client's machine.

use super::slot_set::SlotSet;

/// An input of a client's machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Input {
    /// The caller reports a new connection.
    Connected,
    /// The caller reports that the connection is lost.
    Disconnected,
    /// Time has passed. Given after the bytes that have arrived were read; each timeout handles one due deadline.
    Timeout,
    /// The caller makes a request.
    Request {
        /// Whether the request is for all units.
        broadcast: bool,
        /// Whether the reply can equal the request.
        mirrored: bool,
    },
    /// The caller has polled the outcome of the request in this slot.
    Taken {
        /// The index of the slot, from 0.
        slot: u8,
    },
    /// Bytes have arrived. Given before they are decoded.
    Received,
    /// The bytes are decoded, and the remaining ones may be the beginning of the reply to the request in flight.
    Partial,
    /// The bytes contained a well-formed frame.
    Reply {
        /// The transaction of the frame; 0 if frames have no transaction.
        transaction: u16,
        /// Whether the frame can be the reply to the request that
        /// [`ClientMachine::expects`](super::machine::ClientMachine::expects) returns.
        fit: ReplyMatch,
    },
    /// The bytes contained something that is not a frame.
    Corrupt,
    /// The request that was due is sent.
    Sent(DueRequest),
}

/// Whether a frame can be the reply to a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ReplyMatch {
    /// The frame answers the request, and cannot be data of another reply: it is longer than such data, or a silence follows
    /// it.
    Full,
    /// The frame answers the request, and equals it: a line that returns the bytes sent gives the same.
    Equal,
    /// The frame is an exception, short enough to be data of another reply, and followed by other bytes without a silence.
    Exception,
    /// The frame is an exception, short enough to be data of another reply, and nothing has come after it yet: neither bytes
    /// nor a silence.
    OpenException,
    /// The frame cannot be the reply.
    Mismatch,
}

/// The request that a client sends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct DueRequest {
    /// The slot of the request, from 0.
    pub slot: u8,
    /// The transaction of the request; 0 if frames have no transaction.
    pub transaction: u16,
    /// Whether the read before the request is sent, not the request: its reply shows that a device answers on the line.
    pub probe: bool,
}

/// An action of a client.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Action {
    /// The session has nothing to do.
    Nothing,
    /// Stores a new request in this slot.
    Keep {
        /// The index of the slot, from 0.
        slot: u8,
    },
    /// The request that was sent waits for its reply.
    Sent,
    /// Reports that the request in this slot was sent to all units.
    Announced {
        /// The index of the slot, from 0.
        slot: u8,
    },
    /// Reports the reply, which is stored in this slot.
    Replied {
        /// The index of the slot, from 0.
        slot: u8,
    },
    /// Reports that the frame with the request's transaction is not its reply.
    Refused {
        /// The index of the slot, from 0.
        slot: u8,
    },
    /// Reports a reply to no request in flight.
    Stray {
        /// The slot of the request that timed out before, from 0; `None` if no such request is known.
        late: Option<u8>,
    },
    /// Reports requests that have timed out.
    TimedOut {
        /// The requests without a reply.
        silent: SlotSet,
        /// The requests with a frame that equals the request, which the line may have returned.
        returned: SlotSet,
    },
    /// Reports requests that were in flight and others that were not sent.
    Reset {
        /// The requests in flight: whether they were executed is unknown.
        lost: SlotSet,
        /// The requests that were not sent.
        not_sent: SlotSet,
    },
    /// The bytes in the decoder will not be continued.
    Cut,
    /// The frame stays in the decoder: more bytes, or a silence, show its meaning.
    Hold,
}

robot_session::inputs!(
    Input: Request { broadcast: true } as "Request(broadcast)",
    Request { mirrored: true } as "Request(mirrored)",
    Request { mirrored: false } as "Request",
    Taken,
    Received,
    Partial,
    Reply { fit: ReplyMatch::Full } as "Reply",
    Reply { fit: ReplyMatch::Equal } as "Reply(equal)",
    Reply { fit: ReplyMatch::Exception } as "Reply(exception)",
    Reply { fit: ReplyMatch::OpenException } as "Reply(open exception)",
    Reply { fit: ReplyMatch::Mismatch } as "Reply(misfit)",
    Corrupt,
    Sent,
);
