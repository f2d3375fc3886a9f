//! The peer of the board: a session of the other end, and its caller's requests.

use core::time::Duration;

use robot_session::Session;

#[cfg_attr(feature = "alter", path = "peer/alter.rs")]
#[cfg_attr(feature = "ball", path = "peer/ball.rs")]
#[cfg_attr(feature = "kawasaki", path = "peer/kawasaki.rs")]
#[cfg_attr(feature = "laser", path = "peer/laser.rs")]
#[cfg_attr(feature = "mma", path = "peer/mma.rs")]
#[cfg_attr(feature = "modbus", path = "peer/modbus.rs")]
#[cfg_attr(feature = "telemetry", path = "peer/telemetry.rs")]
#[cfg_attr(feature = "viewer", path = "peer/viewer.rs")]
mod end;

pub(crate) use end::start;

/// A peer.
pub(crate) trait Peer: Send {
    /// Returns the time at which it acts by itself.
    fn deadline(&self) -> Option<Duration>;

    /// Reads these bytes, and writes to `out` if the line is free; returns the number of bytes written.
    fn turn(&mut self, now: Duration, bytes: &[u8], out: &mut [u8], is_free: bool) -> usize;
}

/// A session, and what its caller does in each turn: it returns when it has something to do again.
pub(crate) struct Caller<S> {
    session: S,
    asks: fn(&mut S, Duration) -> Option<Duration>,
    at: Option<Duration>,
}

impl<S: Session> Caller<S> {
    pub(crate) fn new(mut session: S, asks: fn(&mut S, Duration) -> Option<Duration>) -> Self {
        session.handle_connected(Duration::ZERO);
        Self { session, asks, at: Some(Duration::ZERO) }
    }
}

impl<S: Session + Send> Peer for Caller<S> {
    fn deadline(&self) -> Option<Duration> {
        self.session.poll_timeout().into_iter().chain(self.at).min()
    }

    fn turn(&mut self, now: Duration, bytes: &[u8], out: &mut [u8], is_free: bool) -> usize {
        let session = &mut self.session;
        if !bytes.is_empty() {
            session.handle_input(now, bytes);
        }
        session.handle_timeout(now);
        while session.poll_event().is_some() {}
        self.at = (self.asks)(session, now);
        let length = if is_free { session.poll_transmit(now, out) } else { None };
        while session.poll_event().is_some() {}
        length.unwrap_or(0)
    }
}
