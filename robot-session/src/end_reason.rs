//! The ends of a driver's loop, and the events reported then.

use core::ops::ControlFlow;
use core::time::Duration;

use crate::session::Session;

/// The reason that a loop ended without an error.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum EndReason<B> {
    /// The handler has ended it.
    ByHandler(B),
    /// The peer has closed the connection.
    ByPeer,
    /// The peer has taken no byte for [`STALL`] while bytes were to be sent: it does not read. The connection is of no use
    /// any more.
    Stalled,
}

/// The longest time for which a peer may take no byte while bytes are to be sent, unless a driver is given another time: 10
/// s. If the receiver of a line may stop the sender (RTS/CTS), give the driver a longer time than that.
pub const STALL: Duration = Duration::from_secs(10);

impl EndReason<()> {
    /// Returns how the loop ended, with the value that the handler broke with, if it did.
    #[cfg(any(feature = "std", feature = "embedded-io-async"))]
    pub(crate) fn or<B>(self, value: Option<B>) -> EndReason<B> {
        match (value, self) {
            (Some(value), _) => EndReason::ByHandler(value),
            (None, Self::Stalled) => EndReason::Stalled,
            (None, Self::ByHandler(()) | Self::ByPeer) => EndReason::ByPeer,
        }
    }
}

/// A session with a connection. If this is dropped before the loop has ended, as with the future of a `drive`, the connection
/// still ends: requests in flight have an outcome, and the next connection begins without any state of this one.
#[cfg(any(feature = "tokio", feature = "embedded-io-async"))]
pub(crate) struct Connection<'a, S, N, H>
where
    S: Session,
    N: Fn() -> Duration,
    H: FnMut(&mut S, S::Event) -> ControlFlow<()>,
{
    pub(crate) session: &'a mut S,
    pub(crate) handler: H,
    now: N,
}

#[cfg(any(feature = "tokio", feature = "embedded-io-async"))]
impl<'a, S, N, H> Connection<'a, S, N, H>
where
    S: Session,
    N: Fn() -> Duration,
    H: FnMut(&mut S, S::Event) -> ControlFlow<()>,
{
    pub(crate) fn begin(session: &'a mut S, now: N, handler: H) -> Self {
        session.handle_connected(now());
        Self { session, handler, now }
    }
}

#[cfg(any(feature = "tokio", feature = "embedded-io-async"))]
impl<S, N, H> Drop for Connection<'_, S, N, H>
where
    S: Session,
    N: Fn() -> Duration,
    H: FnMut(&mut S, S::Event) -> ControlFlow<()>,
{
    fn drop(&mut self) {
        self.session.handle_disconnected((self.now)());
        report_all(self.session, &mut self.handler);
    }
}

/// Gives every event to `handler`, until it breaks.
pub(crate) fn report<S: Session, B>(
    session: &mut S,
    handler: &mut impl FnMut(&mut S, S::Event) -> ControlFlow<B>,
) -> ControlFlow<B> {
    while let Some(event) = session.poll_event() {
        handler(session, event)?;
    }
    ControlFlow::Continue(())
}

/// Gives every event of the end to `handler`.
#[cfg(any(feature = "std", feature = "embedded-io-async"))]
pub(crate) fn report_all<S: Session>(
    session: &mut S,
    handler: &mut impl FnMut(&mut S, S::Event) -> ControlFlow<()>,
) {
    while report(session, handler).is_break() {}
}

/// Returns a handler that continues with the remaining events of the connection, and stores the first value with which
/// `handler` broke.
#[cfg(any(feature = "std", feature = "embedded-io-async"))]
pub(crate) fn keep_first<S: Session, B>(
    value: &mut Option<B>,
    mut handler: impl FnMut(&mut S, S::Event) -> ControlFlow<B>,
) -> impl FnMut(&mut S, S::Event) -> ControlFlow<()> {
    move |session, event| {
        handler(session, event).map_break(|first| {
            value.get_or_insert(first);
        })
    }
}
