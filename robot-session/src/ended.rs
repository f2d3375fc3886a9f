//! How a loop ends, and what is reported then.

use core::ops::ControlFlow;

use crate::session::Session;

/// How a loop ended that no error ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Ended<B> {
    /// The handler has ended it.
    ByHandler(B),
    /// The peer has closed the connection.
    ByPeer,
}

#[cfg(any(feature = "std", feature = "embedded-io-async"))]
/// Gives the events of the end to `handler`, all of them: what ended the loop first stays its end.
pub(crate) fn wind_down<S: Session, B, E>(
    session: &mut S,
    handler: &mut impl FnMut(&mut S, S::Event) -> ControlFlow<B>,
    ended: Result<Ended<B>, E>,
) -> Result<Ended<B>, E> {
    let mut value = None;
    while let Some(event) = session.poll_event() {
        let broke = handler(session, event).break_value();
        value = value.or(broke);
    }
    match (ended, value) {
        (Ok(Ended::ByPeer), Some(value)) => Ok(Ended::ByHandler(value)),
        (ended, _) => ended,
    }
}

/// Gives every event to `handler`.
pub(crate) fn report<S: Session, B>(
    session: &mut S,
    handler: &mut impl FnMut(&mut S, S::Event) -> ControlFlow<B>,
) -> ControlFlow<B> {
    while let Some(event) = session.poll_event() {
        handler(session, event)?;
    }
    ControlFlow::Continue(())
}
