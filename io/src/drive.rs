//! One turn of a session's loop with a handler that may fail, and a transport whose bytes are kept.

use std::io;
use std::ops::ControlFlow;
use std::time::Duration;

use anyhow::Result;
use robot_session::{Driver, EndReason, ReceiveOutcome, SendOutcome, Session, Transport, Wait};

use crate::clock::Clock;
use crate::trace::{Trace, TraceDirection};

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

/// A transport whose bytes are kept for a trace.
#[derive(Debug)]
pub struct TracedTransport<'a, T> {
    transport: T,
    trace: &'a Trace,
    clock: Clock,
}

impl<'a, T: Transport> TracedTransport<'a, T> {
    /// Creates a driver of `transport`, whose session and trace have the time of `clock`.
    pub fn new(transport: T, trace: &'a Trace, clock: Clock) -> Self {
        Self { transport, trace, clock }
    }
}

impl<T: Transport> Transport for TracedTransport<'_, T> {
    fn now(&self) -> Duration {
        self.clock.now()
    }

    fn receive(&mut self, buffer: &mut [u8], wait: Wait<'_>) -> io::Result<ReceiveOutcome> {
        let received = self.transport.receive(buffer, wait)?;
        if let ReceiveOutcome::Bytes(length) = received {
            self.trace.add(
                self.clock.now(),
                TraceDirection::Received,
                buffer.get(..length).unwrap_or_default(),
            );
        }
        Ok(received)
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<SendOutcome> {
        let begun = self.clock.now();
        let sent = self.transport.send(bytes)?;
        let length = if let SendOutcome::Part(length) = sent { length } else { bytes.len() };
        self.trace.add(begun, TraceDirection::Sent, bytes.get(..length).unwrap_or_default());
        Ok(sent)
    }

    fn discard_after(&mut self, after: Duration) -> io::Result<()> {
        self.transport.discard_after(after)
    }

    fn wait_for_room(&mut self, wait: Wait<'_>) -> io::Result<()> {
        self.transport.wait_for_room(wait)
    }
}
