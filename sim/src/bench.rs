//! A session and a device on one virtual clock, with no thread: an hour passes in milliseconds.

use core::time::Duration;
use std::collections::VecDeque;

use robot_session::Session;

use crate::device::{Device, ExecutedWork};
use crate::faults::Faults;
use crate::simulator::{Simulator, SimulatorReport};

/// The default time without a connection after one has ended.
const RECONNECT: Duration = Duration::from_millis(100);
/// The default time of a byte on its way.
const LATENCY: Duration = Duration::from_millis(1);

/// The connection between the two ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Wire {
    /// The time of a byte on its way. Default: 1 ms.
    pub latency: Duration,
    /// The rate of a serial line, 10 bits a byte; `None`, the default: bytes follow each other at once.
    pub baud: Option<u32>,
    /// The time without a connection after one has ended. Default: 100 ms.
    pub reconnect: Duration,
}

impl Default for Wire {
    fn default() -> Self {
        Self { latency: LATENCY, baud: None, reconnect: RECONNECT }
    }
}

/// A session of yours, and a device that it talks to.
///
/// Time passes in [`run_for`](Self::run_for), [`run_until`](Self::run_until) and [`next_event`](Self::next_event) alone,
/// from deadline to deadline. The two are connected automatically, first at once and again after a connection has ended; a
/// device that is a client requests each connection.
#[derive(Debug)]
pub struct Bench<S: Session, D: Device> {
    /// The connection between the two ends.
    pub wire: Wire,
    session: S,
    simulator: Simulator<D>,
    now: Duration,
    link: Link,
    /// Whether the device has requested a connection.
    is_wanted: bool,
    to_device: DelayLine<Vec<u8>>,
    to_session: DelayLine<Arrival>,
    events: VecDeque<S::Event>,
    told: Vec<(Duration, SimulatorReport<D::Event>)>,
    executed: Vec<ExecutedWork<D::Work>>,
    buffer: Vec<u8>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Link {
    /// There is no connection until the device requests one.
    Down,
    /// There is one from then on, if the device accepts it.
    At(Duration),
    Up,
    /// The device has ended it, and the session has not seen that yet.
    Ending,
}

#[derive(Debug)]
enum Arrival {
    Bytes(Vec<u8>),
    End,
}

/// Items in flight, with the times of their arrival.
#[derive(Debug)]
struct DelayLine<T> {
    queue: VecDeque<(Duration, T)>,
    free_at: Duration,
}

impl<T> DelayLine<T> {
    const EMPTY: Self = Self { queue: VecDeque::new(), free_at: Duration::ZERO };

    fn put(&mut self, now: Duration, wire: &Wire, length: usize, item: T) {
        let bits = length as f64 * 10.0;
        let time = wire.baud.map_or(Duration::ZERO, |baud| Duration::from_secs_f64(bits / f64::from(baud)));
        self.free_at = self.free_at.max(now).saturating_add(time);
        self.queue.push_back((self.free_at.saturating_add(wire.latency), item));
    }

    fn due(&self, now: Duration) -> bool {
        self.next().is_some_and(|at| at <= now)
    }

    fn next(&self) -> Option<Duration> {
        self.queue.front().map(|(at, _)| *at)
    }
}

impl<S: Session, D: Device> Bench<S, D> {
    /// Creates a bench of the two, at the time 0.
    pub fn new(session: S, simulator: Simulator<D>) -> Self {
        Self {
            wire: Wire::default(),
            session,
            simulator,
            now: Duration::ZERO,
            is_wanted: false,
            link: if D::IS_CLIENT { Link::Down } else { Link::At(Duration::ZERO) },
            to_device: DelayLine::EMPTY,
            to_session: DelayLine::EMPTY,
            events: VecDeque::new(),
            told: Vec::new(),
            executed: Vec::new(),
            buffer: vec![0; S::MAX_TRANSMIT.max(D::Session::MAX_TRANSMIT)],
        }
    }

    /// Returns the time.
    pub fn now(&self) -> Duration {
        self.now
    }

    /// Returns your session.
    pub fn session(&self) -> &S {
        &self.session
    }

    /// Returns your session, to call it.
    pub fn session_mut(&mut self) -> &mut S {
        &mut self.session
    }

    /// Returns the device.
    pub fn device(&self) -> &D {
        self.simulator.device()
    }

    /// Returns the device, to change its behaviour.
    pub fn device_mut(&mut self) -> &mut D {
        self.simulator.device_mut()
    }

    /// Returns the faults of the device.
    pub fn faults(&self) -> &Faults {
        self.simulator.faults()
    }

    /// Returns the executed work, in sequence.
    pub fn executed(&self) -> &[ExecutedWork<D::Work>] {
        &self.executed
    }

    /// Returns the device's reports, with their times.
    pub fn told(&self) -> &[(Duration, SimulatorReport<D::Event>)] {
        &self.told
    }

    /// Ends the connection, as a session may request.
    pub fn disconnect(&mut self) {
        if matches!(self.link, Link::Up | Link::Ending) {
            self.session.handle_disconnected(self.now);
            if self.link == Link::Up {
                self.simulator.handle_disconnected(self.now);
            }
            self.down();
        }
    }

    /// Returns the next event of the session; `None` if there is none `within` this time, which has then passed.
    pub fn next_event(&mut self, within: Duration) -> Option<S::Event> {
        self.run_until(within, |bench| !bench.events.is_empty());
        self.events.pop_front()
    }

    /// Removes and returns the events of the session that were not fetched.
    pub fn take_events(&mut self) -> impl Iterator<Item = S::Event> + use<'_, S, D> {
        self.events.drain(..)
    }

    /// Lets this time pass.
    pub fn run_for(&mut self, time: Duration) {
        self.run_until(time, |_| false);
    }

    /// Lets time pass until `is_so` returns true, but no longer than `within`; returns whether it did.
    pub fn run_until(&mut self, within: Duration, mut is_so: impl FnMut(&mut Self) -> bool) -> bool {
        let end = self.now.saturating_add(within);
        loop {
            self.work();
            if is_so(self) {
                self.work();
                return true;
            }
            // Handle the caller's calls before time passes; an overdue deadline does not stop it.
            self.work();
            let next = self.next().map_or(end, |at| at.max(self.now + Duration::from_micros(1)));
            if self.now >= end {
                return false;
            }
            self.now = next.min(end);
        }
    }

    fn next(&self) -> Option<Duration> {
        let link = match self.link {
            Link::At(at) => Some(at).filter(|at| *at > self.now),
            _ => None,
        };
        let to_device = self.to_device.next().filter(|_| self.simulator.wants_input());
        let to_session = self.to_session.next().filter(|_| self.session.wants_input());
        let sessions = [self.session.poll_timeout(), self.simulator.poll_timeout()];
        [link, to_device, to_session].into_iter().chain(sessions).flatten().min()
    }

    /// Does everything that is due now.
    fn work(&mut self) {
        self.session.handle_timeout(self.now);
        self.simulator.handle_timeout(self.now);
        loop {
            let mut idle = !self.connect();
            idle &= !self.deliver();
            while let Some(event) = self.session.poll_event() {
                self.events.push_back(event);
                idle = false;
            }
            while let Some(length) = self.session.poll_transmit(self.now, &mut self.buffer) {
                if self.link == Link::Up {
                    let bytes = self.buffer.get(..length).unwrap_or_default().to_vec();
                    self.to_device.put(self.now, &self.wire, length, bytes);
                }
                idle = false;
            }
            while let Some(length) = self.simulator.poll_transmit(self.now, &mut self.buffer) {
                if self.link == Link::Up {
                    let bytes = self.buffer.get(..length).unwrap_or_default().to_vec();
                    self.to_session.put(self.now, &self.wire, length, Arrival::Bytes(bytes));
                }
                idle = false;
            }
            while let Some(told) = self.simulator.poll_event() {
                match told {
                    SimulatorReport::Close(_) => {
                        self.simulator.handle_disconnected(self.now);
                        self.to_device = DelayLine::EMPTY;
                        self.to_session.put(self.now, &self.wire, 0, Arrival::End);
                        self.link = Link::Ending;
                    }
                    SimulatorReport::Connect => self.is_wanted = true,
                    _ => {}
                }
                self.told.push((self.now, told));
                idle = false;
            }
            self.executed.extend(core::iter::from_fn(|| self.simulator.poll_executed()));
            if idle {
                return;
            }
        }
    }

    fn connect(&mut self) -> bool {
        if self.link == Link::Down && core::mem::take(&mut self.is_wanted) {
            self.link = Link::At(self.now);
        }
        match self.link {
            Link::At(at) if at <= self.now && self.simulator.accepts(self.now) => {
                self.link = Link::Up;
                self.session.handle_connected(self.now);
                self.simulator.handle_connected(self.now);
                true
            }
            _ => false,
        }
    }

    fn deliver(&mut self) -> bool {
        let mut any = false;
        while self.to_device.due(self.now) && self.simulator.wants_input() {
            let Some((_, bytes)) = self.to_device.queue.pop_front() else { break };
            any = true;
            let (now, rest) = feed(&mut self.simulator, self.now, bytes);
            if let Some(rest) = rest {
                self.to_device.queue.push_front((now, rest));
            }
        }
        while self.to_session.due(self.now)
            && (self.session.wants_input()
                || matches!(self.to_session.queue.front(), Some((_, Arrival::End))))
        {
            let Some((_, arrival)) = self.to_session.queue.pop_front() else { break };
            any = true;
            match arrival {
                Arrival::Bytes(bytes) => {
                    let (now, rest) = feed(&mut self.session, self.now, bytes);
                    if let Some(rest) = rest {
                        self.to_session.queue.push_front((now, Arrival::Bytes(rest)));
                    }
                }
                Arrival::End => {
                    self.session.handle_disconnected(self.now);
                    self.down();
                }
            }
        }
        any
    }

    fn down(&mut self) {
        (self.to_device, self.to_session) = (DelayLine::EMPTY, DelayLine::EMPTY);
        self.link = if D::IS_CLIENT { Link::Down } else { Link::At(self.now + self.wire.reconnect) };
    }
}

/// Gives a session as much as it takes at once; the rest arrives at the same time.
fn feed<S: Session>(session: &mut S, now: Duration, mut bytes: Vec<u8>) -> (Duration, Option<Vec<u8>>) {
    let rest = bytes.split_off(bytes.len().min(S::MAX_INPUT));
    session.handle_input(now, &bytes);
    (now, Some(rest).filter(|rest| !rest.is_empty()))
}
