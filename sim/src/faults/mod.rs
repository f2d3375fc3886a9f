//! Faults, injected by a call or by a script.

mod bytes;
mod proxy;

use core::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use core::time::Duration;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

pub use self::bytes::ByteFaults;
pub use self::proxy::{FaultyProxy, NetworkFaults};

/// A fault of a message, of the connection or of the device.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Fault {
    /// The message is lost; the connection continues.
    Drop,
    /// The message, and all later ones, are delayed by this time.
    Delay(Duration),
    /// A bit of the message is turned over.
    Corrupt,
    /// Half of the message is carried, then the connection ends.
    Cut,
    /// The connection ends instead of the message.
    Close,
    /// The message comes twice, one directly after the other.
    Twice,
    /// The device neither reads nor sends for this time, beginning with the message. Execution continues.
    Freeze(Duration),
    /// The device loses power, and restarts after this time. The message is lost, and the connection ends.
    Restart(Duration),
    /// The device loses its unexecuted work. The message is carried, and the connection continues.
    Forget,
}

/// The time of a fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum FaultTime {
    /// To the answer of this number, from 1, or to the first one after it.
    Answer(u64),
    /// To every this many answers.
    EveryAnswer(u64),
    Request(u64),
    EveryRequest(u64),
    At(Duration),
}

/// Faults, with their times: counts begin with 1, and times with the first use of the device.
///
/// A message is the bytes that the device sends at once, or receives at once. One fault happens to a message: another
/// one that was due for it happens to the next message.
#[derive(Debug, Clone, Default)]
pub struct Script {
    incidents: Vec<(FaultTime, Fault)>,
    seed: u64,
}

impl Script {
    /// Returns a script without faults.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Sets the seed, which determines the bits that are inverted.
    #[must_use]
    pub fn seed(mut self, seed: u64) -> Self {
        self.seed = seed;
        self
    }

    /// Adds a fault of the `count`-th message that the device sends.
    #[must_use]
    pub fn answer(self, count: u64, fault: Fault) -> Self {
        self.with(FaultTime::Answer(count), fault)
    }

    /// Adds a fault of every `count`-th message that the device sends.
    #[must_use]
    pub fn every_answer(self, count: u64, fault: Fault) -> Self {
        self.with(FaultTime::EveryAnswer(count), fault)
    }

    /// Adds a fault of the `count`-th message that the device receives.
    #[must_use]
    pub fn request(self, count: u64, fault: Fault) -> Self {
        self.with(FaultTime::Request(count), fault)
    }

    /// Adds a fault of every `count`-th message that the device receives.
    #[must_use]
    pub fn every_request(self, count: u64, fault: Fault) -> Self {
        self.with(FaultTime::EveryRequest(count), fault)
    }

    /// Adds a fault at this time; a fault that needs a message happens to the next one that the device sends.
    #[must_use]
    pub fn at(self, time: Duration, fault: Fault) -> Self {
        self.with(FaultTime::At(time), fault)
    }

    fn with(mut self, when: FaultTime, fault: Fault) -> Self {
        self.incidents.push((when, fault));
        self
    }
}

/// The faults of a device, which any thread can inject.
#[derive(Debug, Clone, Default)]
pub struct Faults(Arc<Shared>);

#[derive(Debug, Default)]
struct Shared {
    /// Whether a fault without a message is set; checked all the time.
    waits: AtomicBool,
    /// The number of faults that have happened to the whole device.
    whole: AtomicUsize,
    state: Mutex<State>,
}

#[derive(Debug)]
struct State {
    incidents: Vec<(FaultTime, Fault)>,
    answers: u64,
    requests: u64,
    happened: Vec<(Duration, Fault)>,
    /// The faults that have happened to the whole device, with the connection on which each happened first.
    whole: Vec<(usize, Duration, Fault)>,
    /// The number of connections.
    connections: usize,
    random: fastrand::Rng,
}

impl Default for State {
    fn default() -> Self {
        let random = fastrand::Rng::with_seed(0);
        let (incidents, happened, whole) = (Vec::new(), Vec::new(), Vec::new());
        Self { incidents, answers: 0, requests: 0, happened, whole, connections: 0, random }
    }
}

impl Faults {
    /// Adds the faults of a script to those requested before.
    pub fn follow(&self, script: Script) {
        let mut state = self.lock();
        state.random = fastrand::Rng::with_seed(script.seed);
        state.incidents.extend(script.incidents);
        self.0.waits.store(true, Ordering::Release);
    }

    /// Removes all faults that have not happened yet.
    pub fn clear(&self) {
        self.lock().incidents.clear();
    }

    /// Adds a fault of the next message that the device sends.
    pub fn next_answer(&self, fault: Fault) {
        self.lock().incidents.push((FaultTime::Answer(0), fault));
    }

    /// Adds a fault of the next message that the device receives.
    pub fn next_request(&self, fault: Fault) {
        self.lock().incidents.push((FaultTime::Request(0), fault));
    }

    /// Drops the next message of the device.
    pub fn drop_next(&self) {
        self.next_answer(Fault::Drop);
    }

    /// Delays the next message of the device by this time.
    pub fn delay_next(&self, by: Duration) {
        self.next_answer(Fault::Delay(by));
    }

    /// Inverts a bit of the next message of the device.
    pub fn corrupt_next(&self) {
        self.next_answer(Fault::Corrupt);
    }

    /// Ends the connection in the middle of the next message of the device.
    pub fn cut_next(&self) {
        self.next_answer(Fault::Cut);
    }

    /// Repeats the next message of the device once.
    pub fn repeat_next(&self) {
        self.next_answer(Fault::Twice);
    }

    /// Freezes the device for this long: it neither reads nor sends.
    pub fn freeze(&self, time: Duration) {
        self.at_once(Fault::Freeze(time));
    }

    /// Switches the device off now, and on again after `off`.
    pub fn restart(&self, off: Duration) {
        self.at_once(Fault::Restart(off));
    }

    /// Discards the work that the device has not executed.
    pub fn forget(&self) {
        self.at_once(Fault::Forget);
    }

    /// Returns the number of messages that the device has received and sent so far, including those with a fault.
    #[must_use]
    pub fn messages(&self) -> (u64, u64) {
        let state = self.lock();
        (state.requests, state.answers)
    }

    /// Returns the faults that have happened, in sequence, with their times.
    #[must_use]
    pub fn happened(&self) -> Vec<(Duration, Fault)> {
        self.lock().happened.clone()
    }

    /// Causes a fault at once: a freeze, a restart, a loss of the unexecuted work, or the end of every connection of the
    /// device. A fault that needs a message happens to the next message that the device sends.
    pub fn at_once(&self, fault: Fault) {
        self.lock().incidents.push((FaultTime::At(Duration::ZERO), fault));
        self.0.waits.store(true, Ordering::Release);
    }

    /// Returns the fault of a message that the device sends now.
    pub(crate) fn answer(&self, now: Duration) -> Option<Fault> {
        let mut state = self.lock();
        state.answers += 1;
        let count = state.answers;
        state.take(now, |when| match when {
            FaultTime::Answer(at) => at <= count,
            FaultTime::EveryAnswer(every) => count.is_multiple_of(every),
            FaultTime::At(at) => at <= now,
            FaultTime::Request(_) | FaultTime::EveryRequest(_) => false,
        })
    }

    /// Returns the fault of a message that the device receives now.
    pub(crate) fn request(&self, now: Duration) -> Option<Fault> {
        let mut state = self.lock();
        state.requests += 1;
        let count = state.requests;
        state.take(now, |when| match when {
            FaultTime::Request(at) => at <= count,
            FaultTime::EveryRequest(every) => count.is_multiple_of(every),
            FaultTime::Answer(_) | FaultTime::EveryAnswer(_) | FaultTime::At(_) => false,
        })
    }

    /// Removes and returns the next fault that is due and does not need a message.
    pub(crate) fn due(&self, now: Duration) -> Option<Fault> {
        let mut state = self.lock();
        let place = state.incidents.iter().position(|(when, fault)| {
            matches!(*when, FaultTime::At(at) if at <= now) && !fault.needs_message()
        })?;
        let (_, fault) = state.incidents.remove(place);
        state.happened.push((now, fault));
        Some(fault)
    }

    /// Returns the time at which [`due`](Self::due) returns a fault.
    pub(crate) fn next(&self) -> Option<Duration> {
        if !self.0.waits.load(Ordering::Acquire) {
            return None;
        }
        let state = self.lock();
        let times = state.incidents.iter().filter_map(|(when, fault)| match when {
            FaultTime::At(at) if !fault.needs_message() => Some(*at),
            _ => None,
        });
        times.min()
    }

    /// Adds a connection of the device; returns its number, and the number of earlier faults of the whole device.
    pub(crate) fn connection(&self) -> (usize, usize) {
        let mut state = self.lock();
        state.connections += 1;
        (state.connections, state.whole.len())
    }

    /// Passes a fault of the whole device, found on this connection, to the device's other connections.
    pub(crate) fn spread(&self, connection: usize, now: Duration, fault: Fault) {
        let mut state = self.lock();
        state.whole.push((connection, now, fault));
        self.0.whole.store(state.whole.len(), Ordering::Release);
    }

    /// Returns the next fault that has happened to the whole device since, on another connection.
    pub(crate) fn elsewhere(&self, connection: usize, seen: &mut usize) -> Option<(Duration, Fault)> {
        while *seen < self.0.whole.load(Ordering::Acquire) {
            let next = self.lock().whole.get(*seen).copied();
            *seen += 1;
            if let Some((_, at, fault)) = next.filter(|(by, ..)| *by != connection) {
                return Some((at, fault));
            }
        }
        None
    }

    /// Turns a bit over.
    pub(crate) fn spoil(&self, bytes: &mut [u8]) {
        let mut state = self.lock();
        let (place, bit) = (state.random.usize(..bytes.len().max(1)), state.random.u8(..8));
        if let Some(byte) = bytes.get_mut(place) {
            *byte ^= 1 << bit;
        }
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.0.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    fn take(&mut self, now: Duration, is_due: impl Fn(FaultTime) -> bool) -> Option<Fault> {
        let place = self.incidents.iter().position(|(when, _)| is_due(*when))?;
        let (when, fault) = *self.incidents.get(place)?;
        if !matches!(when, FaultTime::EveryAnswer(_) | FaultTime::EveryRequest(_)) {
            self.incidents.remove(place);
        }
        self.happened.push((now, fault));
        Some(fault)
    }
}

impl Fault {
    fn needs_message(self) -> bool {
        matches!(self, Self::Drop | Self::Delay(_) | Self::Corrupt | Self::Twice)
    }
}
