//! The events of a session, and what was reported last of the other end.

use robot_session::{EventQueue, Unexpected};

use crate::phase::Phase;

/// The status of the other end: its order, how far it is, the job sent or queued last, and the last one executed.
pub(crate) type PeerStatus = (u16, Phase, Option<u16>, Option<u16>);

/// What both ends report.
pub(crate) trait Event: Copy {
    /// A connection is to be opened.
    const CONNECT: Option<Self>;
    /// It is to be closed.
    const DISCONNECT: Self;

    fn unexpected(unexpected: Unexpected) -> Self;

    fn peer_status(status: PeerStatus) -> Self;
}

/// The events of a session. A connection that is to be opened or closed is state, the last one only.
#[derive(Debug)]
pub(crate) struct Events<E> {
    pub(crate) queue: EventQueue<E, 32>,
    pub(crate) connect: bool,
    pub(crate) disconnect: bool,
    /// Bytes have come without a connection.
    pub(crate) stray: bool,
    peer: Option<PeerStatus>,
    progress: (u32, u32),
}

impl<E: Event> Events<E> {
    pub(crate) const fn new() -> Self {
        Self {
            queue: EventQueue::new(),
            connect: false,
            disconnect: false,
            stray: false,
            peer: None,
            progress: (0, 0),
        }
    }

    /// A connection begins or ends.
    pub(crate) fn connection_changed(&mut self) {
        (self.connect, self.disconnect, self.peer) = (false, false, None);
    }

    pub(crate) fn notice(&mut self, event: E) {
        self.queue.push_notice(event);
    }

    pub(crate) fn outcome(&mut self, event: E) {
        let pushed = self.queue.push_outcome(event);
        debug_assert!(pushed.is_ok(), "begun only with room for its outcomes");
    }

    pub(crate) fn peer_status(&mut self, status: PeerStatus) {
        if self.peer != Some(status) {
            self.peer = Some(status);
            self.notice(E::peer_status(status));
        }
    }

    /// Whether an order has come further than was reported.
    pub(crate) fn progresses(&mut self, progress: (u32, u32)) -> bool {
        core::mem::replace(&mut self.progress, progress) != progress
    }

    /// A new order is where none has come further.
    pub(crate) fn order_begins(&mut self) {
        self.progress = (0, 0);
    }

    pub(crate) fn pop(&mut self) -> Option<E> {
        if core::mem::take(&mut self.connect) && E::CONNECT.is_some() {
            return E::CONNECT;
        }
        if core::mem::take(&mut self.disconnect) {
            return Some(E::DISCONNECT);
        }
        if core::mem::take(&mut self.stray) {
            return Some(E::unexpected(Unexpected { state: "not connected", input: "bytes" }));
        }
        self.queue.pop()
    }
}
