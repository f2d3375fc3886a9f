//! One turn of a session's loop with a handler that may fail.

use std::ops::ControlFlow;
use std::time::Duration;

use anyhow::Result;
use robot_session::{Driver, EndReason, Session, Transport};

/// A connection that was there is gone.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct ConnectionLost(pub String);

/// Runs [`Driver::turn`] until `handler` fails. Returns false if the peer has closed the connection, or the port is gone.
///
/// # Errors
/// The transport's, and the handler's.
pub fn turn<S: Session, T: Transport>(
    driver: &mut Driver<T>,
    session: &mut S,
    wait: Option<Duration>,
    mut handler: impl FnMut(&mut S, S::Event) -> Result<()>,
) -> Result<bool> {
    let turn = driver.turn(session, wait, |session, event| match handler(session, event) {
        Ok(()) => ControlFlow::Continue(()),
        Err(error) => ControlFlow::Break(error),
    })?;
    match turn {
        ControlFlow::Continue(()) => Ok(true),
        ControlFlow::Break(EndReason::ByPeer) => Ok(false),
        ControlFlow::Break(EndReason::Stalled) => Err(ConnectionLost("the peer does not read".into()).into()),
        ControlFlow::Break(EndReason::ByHandler(error)) => Err(error),
    }
}
