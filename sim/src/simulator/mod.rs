//! A device with its faults, as a session.

// A simulator holds its `Remote`, and the calls of a remote take the simulator.
mod remote;

use core::time::Duration;
use std::collections::VecDeque;

use robot_session::Session;

use crate::device::{Device, DeviceRecord, ExecutedWork};
use crate::faults::{Fault, Faults};

pub use remote::{IndexedWork, Remote};

/// A device with its faults: a [`Session`], which any driver runs.
///
/// It begins without a connection. At [`SimulatorReport::Close`] the caller closes the connection and calls
/// [`handle_disconnected`](Session::handle_disconnected); while the device is off, it [accepts](Self::accepts) no other.
#[derive(Debug)]
pub struct Simulator<D: Device> {
    device: D,
    faults: Faults,
    notes: DeviceRecord<D::Event, D::Work>,
    remote: Option<Remote<D>>,
    told: VecDeque<SimulatorReport<D::Event>>,
    /// The bytes to send later, with their times.
    outgoing: VecDeque<(Duration, Vec<u8>)>,
    /// The arrived bytes that are read later, with their times.
    incoming: VecDeque<(Duration, Vec<u8>)>,
    now: Duration,
    /// The time until which it neither reads nor sends.
    frozen: Duration,
    /// The time until which it has no power.
    off: Duration,
    connected: bool,
    /// The reason to close the connection.
    closing: Option<&'static str>,
    /// Whether the executed work is fetched.
    keeps: bool,
    /// The number of this connection of the device, and the number of faults of the whole device that it has applied.
    connection: usize,
    seen: usize,
    /// Nothing has happened to the device since it continued.
    is_settled: bool,
}

/// A report of a simulator.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum SimulatorReport<E> {
    /// An event of the device.
    Device(E),
    /// A scheduled fault was injected.
    Fault(Fault),
    /// The connection is to be closed, for this reason.
    Close(&'static str),
    /// The device is a client: a connection is to be made.
    Connect,
}

impl<D: Device> Simulator<D> {
    /// Creates a simulator of a device, without faults.
    pub fn new(device: D) -> Self {
        Self::with(device, Faults::default())
    }

    fn with(device: D, faults: Faults) -> Self {
        let (connection, seen) = faults.connection();
        Self {
            device,
            faults,
            connection,
            seen,
            notes: DeviceRecord::default(),
            remote: None,
            told: VecDeque::new(),
            outgoing: VecDeque::new(),
            incoming: VecDeque::new(),
            now: Duration::ZERO,
            frozen: Duration::ZERO,
            off: Duration::ZERO,
            connected: false,
            closing: None,
            keeps: true,
            is_settled: false,
        }
    }

    /// Returns the same device for one more connection, with the same faults; `None` if a new connection replaces the
    /// previous one.
    pub fn another(&self) -> Option<Self> {
        let Self { keeps, frozen, off, .. } = *self;
        let (device, remote) = (self.device.another()?, self.remote.clone());
        Some(Self { keeps, frozen, off, remote, ..Self::with(device, self.faults.clone()) })
    }

    /// Returns the simulator without a record of [executed commands](Self::poll_executed).
    #[must_use]
    pub fn keeping_nothing(mut self) -> Self {
        self.keeps = false;
        self
    }

    /// Returns a handle for other threads. From now on executed commands are stored for it; [other
    /// connections](Self::another) that are made later have the same handle.
    pub fn remote(&mut self) -> Remote<D> {
        self.remote.get_or_insert_with(|| Remote::new(self.faults.clone())).clone()
    }

    /// Returns the faults of the device.
    pub fn faults(&self) -> &Faults {
        &self.faults
    }

    /// Returns the device.
    pub fn device(&self) -> &D {
        &self.device
    }

    /// Returns the device, to change its behaviour.
    pub fn device_mut(&mut self) -> &mut D {
        self.is_settled = false;
        &mut self.device
    }

    /// Returns its session, for a call.
    fn session(&mut self) -> &mut D::Session {
        self.device_mut().session_mut()
    }

    /// Returns whether a connection can be made now.
    pub fn accepts(&self, now: Duration) -> bool {
        self.off <= now
    }

    /// Returns whether a fault, or the lack of a connection, keeps the device from reading. If the time of a transport
    /// passes only while it is read, the caller advances it then.
    pub fn is_held(&self) -> bool {
        let is_free = self.is_there() && self.incoming.is_empty() && self.outgoing.is_empty();
        !is_free && !self.wants_input()
    }

    /// Returns the oldest executed work that was not returned before.
    pub fn poll_executed(&mut self) -> Option<ExecutedWork<D::Work>> {
        self.notes.executed.pop_front()
    }

    /// Does the work that is due without a message.
    fn go_on(&mut self, now: Duration) {
        self.is_settled &= now <= self.now;
        self.now = self.now.max(now);
        loop {
            // The faults that were requested before this call are due.
            let call = self.remote.as_ref().and_then(Remote::next);
            while let Some(fault) = self.faults.due(self.now) {
                if matches!(fault, Fault::Cut | Fault::Close) {
                    self.faults.spread(self.connection, self.now, fault);
                }
                self.happen(fault);
            }
            while let Some((at, fault)) = self.faults.elsewhere(self.connection, &mut self.seen) {
                self.suffer(at, fault);
            }
            let Some(call) = call else { break };
            self.is_settled = false;
            call(self);
        }
        if self.off > self.now || core::mem::replace(&mut self.is_settled, true) {
            return;
        }
        let before = self.notes.executed.len();
        loop {
            self.device.advance(self.now, &mut self.notes);
            let Some(event) = self.device.session_mut().poll_event() else { break };
            self.device.take(self.now, event, &mut self.notes);
        }
        if let Some(remote) = &self.remote {
            remote.store(self.notes.executed.iter().skip(before));
        }
        if !self.keeps {
            self.notes.executed.clear();
        }
        self.told.extend(self.notes.events.drain(..).map(SimulatorReport::Device));
        if core::mem::take(&mut self.notes.connect) {
            self.told.push_back(SimulatorReport::Connect);
        }
    }

    /// Applies a fault's effects, except those on its message.
    fn happen(&mut self, fault: Fault) {
        self.told.push_back(SimulatorReport::Fault(fault));
        self.is_settled = false;
        match fault {
            Fault::Freeze(_) => {
                self.faults.spread(self.connection, self.now, fault);
                self.suffer(self.now, fault);
            }
            Fault::Forget => self.device.forget(self.now),
            Fault::Restart(_) => {
                self.faults.spread(self.connection, self.now, fault);
                self.device.restart(self.now);
                self.suffer(self.now, fault);
            }
            Fault::Cut | Fault::Close => self.suffer(self.now, fault),
            Fault::Drop | Fault::Delay(_) | Fault::Corrupt | Fault::Twice => {}
        }
    }

    /// Applies a fault of the whole device to this connection.
    fn suffer(&mut self, at: Duration, fault: Fault) {
        match fault {
            Fault::Freeze(time) => self.frozen = self.frozen.max(at.saturating_add(time)),
            Fault::Restart(time) => {
                self.off = self.off.max(at.saturating_add(time));
                self.notes.close = None;
                self.close("the power is gone");
            }
            Fault::Cut => self.close("the set fault: the connection ends in the middle of a message"),
            Fault::Close => self.close("the set fault: the connection ends before the reply"),
            _ => {}
        }
    }

    fn close(&mut self, why: &'static str) {
        self.outgoing.clear();
        self.incoming.clear();
        if self.connected && self.closing.is_none() {
            self.closing = Some(why);
            self.told.push_back(SimulatorReport::Close(why));
        }
    }

    /// Gives the device the bytes that are due to arrive.
    fn deliver(&mut self) {
        while self.reads() && self.incoming.front().is_some_and(|(at, _)| *at <= self.now) {
            let Some((_, bytes)) = self.incoming.pop_front() else { return };
            let now = self.now;
            self.session().handle_input(now, &bytes);
            self.go_on(self.now);
        }
    }

    /// Returns whether the device reads bytes.
    fn reads(&self) -> bool {
        self.is_there() && self.device.session().wants_input()
    }

    fn is_there(&self) -> bool {
        self.connected && self.closing.is_none() && self.frozen.max(self.off) <= self.now
    }

    /// Writes the next message of the device, with its fault.
    fn message(&mut self, out: &mut [u8]) -> Option<usize> {
        loop {
            let now = self.now;
            let length = self.session().poll_transmit(now, out)?;
            let bytes = out.get_mut(..length)?;
            let Some(fault) = self.faults.answer(self.now) else { return Some(length) };
            let copy = bytes.to_vec();
            if fault == Fault::Corrupt {
                self.faults.spoil(bytes);
            }
            self.happen(fault);
            match fault {
                Fault::Drop => {}
                Fault::Restart(_) | Fault::Close => return None,
                Fault::Cut => return Some(length / 2).filter(|half| *half > 0),
                Fault::Delay(time) | Fault::Freeze(time) => {
                    self.outgoing.push_back((self.now.saturating_add(time), copy));
                    return None;
                }
                Fault::Twice => {
                    self.outgoing.push_back((self.now, copy));
                    return Some(length);
                }
                Fault::Corrupt | Fault::Forget => return Some(length),
            }
        }
    }
}

impl<D: Device> Session for Simulator<D> {
    type Event = SimulatorReport<D::Event>;
    type Statistics = <D::Session as Session>::Statistics;
    const MAX_INPUT: usize = D::Session::MAX_INPUT;
    const MAX_TRANSMIT: usize = D::Session::MAX_TRANSMIT;

    fn handle_connected(&mut self, now: Duration) {
        self.connected = true;
        self.session().handle_connected(now);
        self.go_on(now);
    }

    fn handle_disconnected(&mut self, now: Duration) {
        (self.connected, self.closing, self.notes.close) = (false, None, None);
        self.told.retain(|told| !matches!(told, SimulatorReport::Close(_)));
        self.outgoing.clear();
        self.incoming.clear();
        self.session().handle_disconnected(now);
        self.go_on(now);
    }

    fn handle_input(&mut self, now: Duration, bytes: &[u8]) {
        self.go_on(now);
        let mut bytes = bytes.to_vec();
        let mut at = self.now;
        if let Some(fault) = self.faults.request(now) {
            if fault == Fault::Corrupt {
                self.faults.spoil(&mut bytes);
            }
            match fault {
                Fault::Drop | Fault::Restart(_) | Fault::Close => bytes.clear(),
                Fault::Cut => bytes.truncate(bytes.len() / 2),
                Fault::Delay(time) => at = at.saturating_add(time),
                Fault::Twice => self.incoming.push_back((at, bytes.clone())),
                Fault::Corrupt | Fault::Freeze(_) | Fault::Forget => {}
            }
            if fault == Fault::Cut {
                // The bytes that have arrived before the disconnection are read.
                let now = self.now;
                self.session().handle_input(now, &bytes);
                bytes.clear();
            }
            self.happen(fault);
        }
        if !bytes.is_empty() {
            let behind = self.incoming.back().map_or(at, |(at, _)| *at);
            self.incoming.push_back((at.max(behind), bytes));
        }
        self.deliver();
        self.go_on(now);
    }

    fn handle_timeout(&mut self, now: Duration) {
        self.go_on(now);
        if self.off <= self.now && self.frozen <= self.now {
            let now = self.now;
            self.session().handle_timeout(now);
        }
        self.deliver();
        self.go_on(now);
    }

    fn wants_input(&self) -> bool {
        self.reads() && self.incoming.is_empty()
    }

    fn poll_event(&mut self) -> Option<Self::Event> {
        self.go_on(self.now);
        self.told.pop_front()
    }

    fn poll_transmit(&mut self, now: Duration, out: &mut [u8]) -> Option<usize> {
        self.go_on(now);
        if !self.is_there() {
            return None;
        }
        if let Some((at, _)) = self.outgoing.front() {
            if *at > self.now {
                return None;
            }
            let (_, bytes) = self.outgoing.pop_front()?;
            out.get_mut(..bytes.len())?.copy_from_slice(&bytes);
            return Some(bytes.len());
        }
        let message = self.message(out);
        if message.is_none()
            && self.outgoing.is_empty()
            && let Some(why) = self.notes.close.take()
        {
            self.close(why);
        }
        message
    }

    fn poll_timeout(&self) -> Option<Duration> {
        let faults = self.faults.next();
        if self.off > self.now {
            return [Some(self.off), faults].into_iter().flatten().min();
        }
        let session = self.device.session().poll_timeout();
        // The session waits until the first delayed message has left, and while the device is frozen.
        let held = self.outgoing.front().map_or(Duration::ZERO, |(at, _)| *at).max(self.frozen);
        let session = if self.closing.is_some() { None } else { session.map(|at| at.max(held)) };
        let sent = self.outgoing.front().map(|(at, _)| (*at).max(self.frozen));
        let arrives = self.incoming.front().map(|(at, _)| *at).filter(|_| self.reads());
        let thaws = (self.frozen > self.now).then_some(self.frozen);
        [session, sent, arrives, thaws, faults, self.device.due()].into_iter().flatten().min()
    }

    fn statistics(&self) -> Self::Statistics {
        self.device.session().statistics()
    }
}
