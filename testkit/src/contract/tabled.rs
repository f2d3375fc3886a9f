//! An end of the table as a session.

use core::time::Duration;

use cellwire_links::end::End;
use robot_session::Session;
use serde_json::Value;

/// A size that is at least the bytes that any end reads or writes at once.
const BUFFER_LEN: usize = 4096;

#[allow(missing_debug_implementations, reason = "not every end implements it")]
pub struct Tabled(pub(super) Box<dyn End>);

impl Session for Tabled {
    type Event = String;
    /// Of the counters of the end, the number of dropped notices.
    type Statistics = u64;

    const MAX_INPUT: usize = BUFFER_LEN;
    const MAX_TRANSMIT: usize = BUFFER_LEN;

    fn handle_connected(&mut self, now: Duration) {
        self.0.handle_connected(now);
    }

    fn handle_disconnected(&mut self, now: Duration) {
        self.0.handle_disconnected(now);
    }

    fn handle_input(&mut self, now: Duration, bytes: &[u8]) {
        self.0.handle_input(now, bytes);
    }

    fn handle_timeout(&mut self, now: Duration) {
        self.0.handle_timeout(now);
    }

    fn handle_transmitted(&mut self, now: Duration) {
        self.0.handle_transmitted(now);
    }

    fn wants_input(&self) -> bool {
        self.0.wants_input()
    }

    fn poll_event(&mut self) -> Option<String> {
        self.0.poll_event()
    }

    fn poll_transmit(&mut self, now: Duration, out: &mut [u8]) -> Option<usize> {
        assert!(self.0.max_transmit() <= BUFFER_LEN);
        let length = out.len().min(self.0.max_transmit());
        self.0.poll_transmit(now, &mut out[..length])
    }

    fn poll_timeout(&self) -> Option<Duration> {
        self.0.poll_timeout()
    }

    fn statistics(&self) -> u64 {
        let counters: Value = serde_json::from_str(&self.0.statistics()).unwrap();
        counters["dropped_notices"].as_u64().unwrap_or_default()
    }
}
