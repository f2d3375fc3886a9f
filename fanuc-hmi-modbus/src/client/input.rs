//! What happens to a client, and what it does.

use super::places::Places;

/// What happens to a client.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Input {
    /// A connection was made.
    Connected,
    /// The connection is lost.
    Disconnected,
    /// Time has passed. Given after what has arrived was read; one thing that came due is done with each.
    Timeout,
    /// The caller makes a request.
    Request {
        /// To all units.
        broadcast: bool,
        /// Its reply can equal it.
        mirrored: bool,
    },
    /// The caller has taken the outcome of the request in this place.
    Taken {
        /// The place.
        place: u8,
    },
    /// Bytes have arrived. Given before they are decoded.
    Received,
    /// They are decoded, and the bytes that are left may be the beginning of the reply to the request in flight.
    Partial,
    /// They held a well-formed frame.
    Reply {
        /// Its transaction; 0 where frames have none.
        transaction: u16,
        /// Whether it can be the reply to the request that [`ClientMachine::expects`](super::machine::ClientMachine::expects) names.
        fit: Fit,
    },
    /// They held something that is no frame.
    Corrupt,
    /// The request that was due is sent.
    Sent(Due),
}

/// Whether a frame can be the reply to a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Fit {
    /// It answers what was asked, and cannot be data of another reply: it is longer than such data, or a silence follows it.
    Whole,
    /// It answers what was asked, and equals it: a line that returns what is sent gives the same.
    Equal,
    /// It is an exception, short enough to be data of another reply, and followed by other bytes without a silence.
    Exception,
    /// It is an exception, short enough to be data of another reply, and nothing has come after it yet: neither bytes nor a silence.
    OpenException,
    /// It cannot be the reply.
    Misfit,
}

/// The request that a client sends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Due {
    /// Its place.
    pub place: u8,
    /// Its transaction; 0 where frames have none.
    pub transaction: u16,
    /// Not the request is sent, but the read before it whose reply shows that a device answers on the line.
    pub probe: bool,
}

/// What a client does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Action {
    /// Nothing.
    Nothing,
    /// It keeps a new request in this place.
    Keep {
        /// The place.
        place: u8,
    },
    /// The request that was sent waits for its reply.
    Sent,
    /// It reports that the request of this place was sent to all units.
    Announced {
        /// The place.
        place: u8,
    },
    /// It reports the reply, which is kept in this place.
    Replied {
        /// The place.
        place: u8,
    },
    /// It reports that the reply with the request's transaction is none.
    Refused {
        /// The place.
        place: u8,
    },
    /// It reports a reply that no request in flight has.
    Stray {
        /// The place of the request that timed out before.
        late: Option<u8>,
    },
    /// It reports requests that have timed out.
    TimedOut {
        /// Without a reply.
        silent: Places,
        /// With a frame that equals the request, which the line may have returned.
        returned: Places,
    },
    /// It reports requests that were in flight and others that were not sent.
    Reset {
        /// In flight: whether they were carried out is unknown.
        lost: Places,
        /// Not sent.
        not_sent: Places,
    },
    /// What the decoder holds will not be continued.
    Cut,
    /// The frame stays in the decoder: more bytes, or a silence, show what it is.
    Hold,
}

robot_session::inputs!(
    Input: Request { broadcast: true } as "Request(broadcast)",
    Request { mirrored: true } as "Request(mirrored)",
    Request { mirrored: false } as "Request",
    Taken,
    Received,
    Partial,
    Reply { fit: Fit::Whole } as "Reply",
    Reply { fit: Fit::Equal } as "Reply(equal)",
    Reply { fit: Fit::Exception } as "Reply(exception)",
    Reply { fit: Fit::OpenException } as "Reply(open exception)",
    Reply { fit: Fit::Misfit } as "Reply(misfit)",
    Corrupt,
    Sent,
);
