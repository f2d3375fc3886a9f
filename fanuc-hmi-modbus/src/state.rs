//! The life of one request of a client: every transition, without bytes.

/// Where a place for a request stands.
///
/// ```text
///               request            transmit            reply
///      Free --------------> Queued ----------> Sent ----------> Free
///                            |  |               |  |
///                   announce |  | disconnect    |  | deadline
///                            v  v    disconnect |  v        reply
///                    Announced  NotSent   Lost <+- TimedOut ------> Free
///                            |  |          |         | report
///                     report v  v report   v report  v  reply, disconnect
///                            Free         Free     Expired --------> Free
///                                                    | request
///                                                    +-------------> Queued
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum State {
    /// Empty.
    Free,
    /// A request waits to be sent.
    Queued,
    /// It was sent, and waits for its reply.
    Sent,
    /// A broadcast was sent: to be told.
    Announced,
    /// The reply did not come in time: to be told. It is still taken if it comes before that, on the same connection.
    TimedOut,
    /// The connection broke while the request was out: to be told. Whether it was carried out is unknown.
    Lost,
    /// The connection broke before the request was sent: to be told.
    NotSent,
    /// Told that it timed out. The transaction is kept, so that a late reply is known as one; the place may be used again.
    Expired,
}

impl State {
    /// Every state.
    pub const ALL: [Self; 8] = [
        Self::Free,
        Self::Queued,
        Self::Sent,
        Self::Announced,
        Self::TimedOut,
        Self::Lost,
        Self::NotSent,
        Self::Expired,
    ];
}

/// What happens to a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Event {
    /// The caller makes a request.
    Request,
    /// It goes out, to one unit.
    Transmit,
    /// It goes out, to all.
    Announce,
    /// Its reply comes, whatever it says.
    Reply,
    /// The time for its reply is over.
    Deadline,
    /// The connection breaks.
    Disconnect,
    /// The caller is told how it ended.
    Report,
}

impl Event {
    /// Every event.
    pub const ALL: [Self; 7] = [
        Self::Request,
        Self::Transmit,
        Self::Announce,
        Self::Reply,
        Self::Deadline,
        Self::Disconnect,
        Self::Report,
    ];
}

/// The state after an event; `None` where the event means nothing.
pub const fn next(state: State, event: Event) -> Option<State> {
    use Event as E;
    use State as S;
    match (state, event) {
        (S::Free | S::Expired, E::Request) => Some(S::Queued),
        (S::Queued, E::Transmit) => Some(S::Sent),
        (S::Queued, E::Announce) => Some(S::Announced),
        (S::Queued, E::Disconnect) => Some(S::NotSent),
        (S::Sent | S::TimedOut | S::Expired, E::Reply) => Some(S::Free),
        (S::Sent, E::Deadline) => Some(S::TimedOut),
        (S::Sent | S::TimedOut, E::Disconnect) => Some(S::Lost),
        (S::TimedOut, E::Report) => Some(S::Expired),
        (S::Announced | S::Lost | S::NotSent, E::Report) => Some(S::Free),
        (S::Expired, E::Disconnect) => Some(S::Free),
        (S::Free, E::Transmit | E::Announce | E::Reply | E::Deadline | E::Disconnect | E::Report)
        | (S::Queued, E::Request | E::Reply | E::Deadline | E::Report)
        | (S::Sent, E::Request | E::Transmit | E::Announce | E::Report)
        | (S::TimedOut, E::Request | E::Transmit | E::Announce | E::Deadline)
        | (
            S::Announced | S::Lost | S::NotSent,
            E::Request | E::Transmit | E::Announce | E::Reply | E::Deadline | E::Disconnect,
        )
        | (S::Expired, E::Transmit | E::Announce | E::Deadline | E::Report) => None,
    }
}
