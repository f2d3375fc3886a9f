//! The order of calls after any `handle_…`, as a function.

use core::ops::ControlFlow;
use core::time::Duration;

use crate::session::Session;

/// What [`settle`] gives to its caller.
#[derive(Debug)]
pub enum Output<'a, E> {
    /// Something has happened.
    Event(E),
    /// These bytes are to be sent.
    Transmit(&'a [u8]),
}

/// Takes events, then what is to be sent, until there is neither, or until `each` breaks. `buffer` has at least
/// [`MAX_TRANSMIT`](Session::MAX_TRANSMIT) bytes.
pub fn settle<S: Session, B>(
    session: &mut S,
    now: Duration,
    buffer: &mut [u8],
    mut each: impl FnMut(&mut S, Output<'_, S::Event>) -> ControlFlow<B>,
) -> ControlFlow<B> {
    loop {
        let mut idle = true;
        while let Some(event) = session.poll_event() {
            each(session, Output::Event(event))?;
            idle = false;
        }
        while let Some(length) = session.poll_transmit(now, buffer) {
            each(session, Output::Transmit(buffer.get(..length).unwrap_or_default()))?;
            idle = false;
        }
        // Also where nothing is to be sent, something may have expired.
        if idle {
            match session.poll_event() {
                None => return ControlFlow::Continue(()),
                Some(event) => each(session, Output::Event(event))?,
            }
        }
    }
}
