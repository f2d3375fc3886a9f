//! A device of the cell at its port.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use cellwire_sim::host::{HostedSession, Request};
use robot_session::Session;

use super::cell::{Cell, CellConnection};

/// One of the devices, for the host of its port: one central controller at a time, the newest.
pub(super) struct PortedDevice {
    which: CellConnection,
    cell: Arc<Mutex<Cell>>,
    /// The cell's clock is faster than the host's by this factor.
    speed: u32,
    /// The replies that are not sent.
    unsent: Vec<u8>,
    /// The connection is to be closed once the replies are sent.
    closes: bool,
}

impl PortedDevice {
    pub(super) fn new(which: CellConnection, cell: &Arc<Mutex<Cell>>, speed: u32) -> Self {
        Self { which, cell: Arc::clone(cell), speed, unsent: Vec::new(), closes: false }
    }

    fn cell(&self) -> MutexGuard<'_, Cell> {
        self.cell.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl HostedSession for PortedDevice {
    fn request((): &()) -> Option<Request> {
        Some(Request::Close("the central controller has ended the connection"))
    }
}

impl Session for PortedDevice {
    /// The connection is to be closed.
    type Event = ();
    type Statistics = ();
    const MAX_INPUT: usize = 256;
    const MAX_TRANSMIT: usize = 256;

    fn handle_connected(&mut self, now: Duration) {
        (self.unsent, self.closes) = (Vec::new(), false);
        self.cell().connect(self.which, now * self.speed);
    }

    fn handle_disconnected(&mut self, _: Duration) {}

    fn handle_input(&mut self, now: Duration, bytes: &[u8]) {
        let (replies, closes) = self.cell().receive(self.which, now * self.speed, bytes);
        self.unsent.extend(replies);
        self.closes |= closes;
    }

    fn handle_timeout(&mut self, _: Duration) {}

    fn wants_input(&self) -> bool {
        !self.closes
    }

    fn poll_event(&mut self) -> Option<()> {
        (self.unsent.is_empty() && core::mem::take(&mut self.closes)).then_some(())
    }

    fn poll_transmit(&mut self, _: Duration, out: &mut [u8]) -> Option<usize> {
        let length = self.unsent.len().min(out.len());
        out.get_mut(..length)?.copy_from_slice(self.unsent.get(..length)?);
        self.unsent.drain(..length);
        (length > 0).then_some(length)
    }

    fn poll_timeout(&self) -> Option<Duration> {
        None
    }

    fn statistics(&self) {}
}
