//! A device for what all devices have in common: it and its peer log every call, with its time.

use core::convert::Infallible;
use core::time::Duration;
use std::collections::VecDeque;

use cellwire_sim::robot_session::Session;
use cellwire_sim::{Bench, Device, DeviceRecord, Simulator};

/// Either end: it sends texts at their times, and waits for one time.
#[derive(Debug, Clone, Default)]
pub(crate) struct Line {
    pub(crate) is_connected: bool,
    pub(crate) is_blocked: bool,
    pub(crate) wake: Option<Duration>,
    pub(crate) sends: VecDeque<(Duration, &'static str)>,
    pub(crate) log: Vec<String>,
    pub(crate) certificate: Vec<u8>,
}

impl Line {
    pub(crate) fn sending(sends: &[(Duration, &'static str)]) -> Self {
        Self { sends: sends.iter().copied().collect(), ..Self::default() }
    }

    /// Returns the last entry of the log.
    pub(crate) fn last(&self) -> &str {
        self.log.last().unwrap()
    }

    fn note(&mut self, now: Duration, what: &str) {
        self.log.push(format!("{now:?} {what}"));
    }
}

impl Session for Line {
    type Event = Infallible;
    type Statistics = ();
    const MAX_INPUT: usize = 8;
    const MAX_TRANSMIT: usize = 64;

    fn handle_connected(&mut self, now: Duration) {
        self.is_connected = true;
        self.note(now, "connected");
    }

    fn handle_disconnected(&mut self, now: Duration) {
        self.is_connected = false;
        self.note(now, "disconnected");
    }

    fn handle_input(&mut self, now: Duration, bytes: &[u8]) {
        self.note(now, &String::from_utf8_lossy(bytes));
    }

    fn handle_timeout(&mut self, now: Duration) {
        if self.wake.take_if(|at| *at <= now).is_some() {
            self.note(now, "wakes");
        }
    }

    fn wants_input(&self) -> bool {
        !self.is_blocked
    }

    fn poll_event(&mut self) -> Option<Infallible> {
        None
    }

    fn poll_transmit(&mut self, now: Duration, out: &mut [u8]) -> Option<usize> {
        let (_, text) = self.sends.front().copied().filter(|(at, _)| self.is_connected && *at <= now)?;
        self.sends.pop_front();
        out[..text.len()].copy_from_slice(text.as_bytes());
        Some(text.len())
    }

    fn poll_timeout(&self) -> Option<Duration> {
        let sends = self.sends.front().map(|(at, _)| *at).filter(|_| self.is_connected);
        [sends, self.wake].into_iter().flatten().min()
    }

    fn statistics(&self) {}
}

/// A gadget that executes one thing, at a time, and may want the end of the connection then.
#[derive(Debug, Clone, Default)]
pub(crate) struct Gadget {
    pub(crate) line: Line,
    pub(crate) work: Option<Duration>,
    pub(crate) closes: bool,
}

impl Device for Gadget {
    type Session = Line;
    type Event = Infallible;
    type Work = ();

    fn session(&self) -> &Line {
        &self.line
    }

    fn session_mut(&mut self) -> &mut Line {
        &mut self.line
    }

    fn take(&mut self, _: Duration, event: Infallible, _: &mut DeviceRecord<Infallible, ()>) {
        match event {}
    }

    fn advance(&mut self, now: Duration, notes: &mut DeviceRecord<Infallible, ()>) {
        if self.work.take_if(|at| *at <= now).is_some() {
            self.line.note(now, "executes");
            notes.executed(now, ());
            if self.closes {
                notes.close("done");
            }
        }
    }

    fn due(&self) -> Option<Duration> {
        self.work
    }

    fn restart(&mut self, now: Duration) {
        self.line.note(now, "restarts");
    }

    fn forget(&mut self, now: Duration) {
        self.line.note(now, "forgets");
    }

    fn another(&self) -> Option<Self> {
        Some(self.clone())
    }

    fn secured(&mut self, certificate: &[u8]) {
        self.line.certificate = certificate.into();
    }
}

/// Creates a bench of both on a wire without delay.
pub(crate) fn bench(host: Line, gadget: Gadget) -> Bench<Line, Gadget> {
    let mut bench = Bench::new(host, Simulator::new(gadget));
    bench.wire.latency = Duration::ZERO;
    bench
}
