//! How a loop ends, and what is reported then.

use core::ops::ControlFlow;
use core::time::Duration;

use crate::session::Session;

/// How a loop ended without an error.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Ended<B> {
    /// The handler has ended it.
    ByHandler(B),
    /// The peer has closed the connection.
    ByPeer,
    /// The peer has taken no byte of what is to be sent for [`STALL`]: it does not read. The connection is of no use any more.
    Stalled,
}

/// How long a peer may take no byte of what it is sent, unless a driver is given another time: 10 s. Where the receiver of a line may hold
/// the sender (RTS/CTS), give the driver a longer time than that.
pub const STALL: Duration = Duration::from_secs(10);

impl Ended<()> {
    /// How it ended, with the value that the handler broke with, if it did.
    #[cfg(any(feature = "std", feature = "embedded-io-async"))]
    pub(crate) fn or<B>(self, value: Option<B>) -> Ended<B> {
        match (value, self) {
            (Some(value), _) => Ended::ByHandler(value),
            (None, Self::Stalled) => Ended::Stalled,
            (None, Self::ByHandler(()) | Self::ByPeer) => Ended::ByPeer,
        }
    }
}

/// A session with a connection. Where this is dropped before the loop has ended, as with the future of a `drive`, the connection ends all
/// the same: what was in flight has an outcome, and the next connection begins with nothing of this one.
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

/// A handler that goes on with the events of the end, and keeps the first value that `handler` broke with.
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
