//! A link between two sessions on a virtual clock, with the faults that its transport can commit.
//!
//! ```
//! use core::time::Duration;
//! use testkit::link::{Delivery, End, Faults, Link};
//!
//! let mut link = Link::new(7, Faults::NONE);
//! link.send(End::A, Duration::ZERO, b"hello");
//! let now = link.next_delivery().unwrap();
//! assert_eq!(link.receive(End::B, now), Some(Delivery::Bytes(b"hello".to_vec())));
//! assert_eq!(link.receive(End::B, now), None);
//! ```

use core::time::Duration;
use std::collections::VecDeque;

pub use crate::faults::{FaultCounts, Faults};
use robot_session::contract::Rng;

/// One of the two ends of a [`Link`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum End {
    /// The first end.
    A,
    /// The second end.
    B,
}

impl End {
    /// Returns the end that receives this end's bytes.
    pub fn other(self) -> Self {
        match self {
            End::A => End::B,
            End::B => End::A,
        }
    }
}

/// A delivery to an end.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Delivery {
    /// Some bytes of a stream, or one datagram.
    Bytes(Vec<u8>),
    /// The connection is gone: nothing sent before it will still arrive. Call [`Link::reconnect`] to continue.
    Closed,
}

/// Two directions of bytes between [`End::A`] and [`End::B`]. The same seed commits the same faults.
#[derive(Debug)]
pub struct Link {
    faults: Faults,
    rng: Rng,
    counts: FaultCounts,
    connected: bool,
    to_a: Direction,
    to_b: Direction,
}

impl Link {
    /// Creates a connected link whose faults follow from `seed`.
    pub fn new(seed: u64, faults: Faults) -> Self {
        let direction = Direction::default();
        Self {
            faults,
            rng: Rng::new(seed),
            counts: FaultCounts::default(),
            connected: true,
            to_a: direction.clone(),
            to_b: direction,
        }
    }

    /// Takes bytes from an end. On a broken link they are gone, as on a closed socket.
    pub fn send(&mut self, from: End, now: Duration, bytes: &[u8]) {
        if !self.connected || bytes.is_empty() {
            return;
        }
        let mut bytes = self.corrupt(bytes);
        let breaks = self.rng.chance(self.faults.disconnect);
        if breaks {
            bytes.truncate(self.rng.below(bytes.len() + 1));
        }
        let line_time = self.faults.byte_time * u32::try_from(bytes.len()).unwrap_or(u32::MAX);
        let lost = self.rng.chance(self.faults.lose);
        let late = self.rng.chance(self.faults.delay);
        let extra = if late { self.faults.max_delay.mul_f64(self.rng.unit()) } else { Duration::ZERO };
        self.counts.losses += u64::from(lost);
        self.counts.delays += u64::from(late);

        let direction = match from {
            End::A => &mut self.to_b,
            End::B => &mut self.to_a,
        };
        let start = now.max(direction.line_free_at);
        direction.line_free_at = start + line_time;
        let arrival = start + line_time + self.faults.latency + extra;
        if !lost && !bytes.is_empty() {
            if self.faults.datagrams {
                if self.rng.chance(self.faults.repeat) {
                    self.counts.repeats += 1;
                    let again = arrival + self.faults.max_delay.mul_f64(self.rng.unit());
                    direction.insert(again, Delivery::Bytes(bytes.clone()));
                }
                direction.insert(arrival, Delivery::Bytes(bytes));
            } else {
                direction.append(arrival, bytes, &self.faults, &mut self.rng, &mut self.counts);
            }
        }
        if breaks {
            self.disconnect(now);
        }
    }

    /// Returns the next delivery to an end by `now`; call until it returns `None`.
    pub fn receive(&mut self, at: End, now: Duration) -> Option<Delivery> {
        self.receive_part(at, now, usize::MAX)
    }

    /// Receives as [`receive`](Self::receive) does, at most this many bytes at once.
    pub fn receive_part(&mut self, at: End, now: Duration, most: usize) -> Option<Delivery> {
        let direction = match at {
            End::A => &mut self.to_a,
            End::B => &mut self.to_b,
        };
        let (arrives, delivery) = direction.queue.front_mut()?;
        if *arrives > now {
            return None;
        }
        if let Delivery::Bytes(bytes) = delivery
            && bytes.len() > most
        {
            let rest = bytes.split_off(most);
            return Some(Delivery::Bytes(core::mem::replace(bytes, rest)));
        }
        direction.queue.pop_front().map(|(_, delivery)| delivery)
    }

    /// Returns the time of the next delivery to either end.
    pub fn next_delivery(&self) -> Option<Duration> {
        let first = |direction: &Direction| direction.queue.front().map(|(at, _)| *at);
        first(&self.to_a).into_iter().chain(first(&self.to_b)).min()
    }

    /// Breaks the connection: a part of the bytes in flight still arrives, then [`Delivery::Closed`].
    pub fn disconnect(&mut self, now: Duration) {
        if !self.connected {
            return;
        }
        self.connected = false;
        self.counts.disconnects += 1;
        for direction in [&mut self.to_a, &mut self.to_b] {
            let kept = self.rng.below(direction.queue.len() + 1);
            direction.queue.truncate(kept);
            let last = direction.queue.back().map_or(now, |(at, _)| *at);
            direction.queue.push_back((last.max(now), Delivery::Closed));
        }
    }

    /// Opens a new connection: bytes of the old one no longer arrive.
    pub fn reconnect(&mut self) {
        self.connected = true;
        self.to_a = Direction::default();
        self.to_b = Direction::default();
    }

    /// Stops the faults. Bytes in flight arrive as planned.
    pub fn heal(&mut self) {
        self.faults = self.faults.healed();
    }

    /// Returns whether bytes that are sent now can arrive.
    pub fn is_connected(&self) -> bool {
        self.connected
    }

    /// Returns the counts of the faults so far.
    pub fn counts(&self) -> FaultCounts {
        self.counts
    }

    fn corrupt(&mut self, bytes: &[u8]) -> Vec<u8> {
        let mut out = Vec::with_capacity(bytes.len() + 4);
        for &byte in bytes {
            if self.rng.chance(self.faults.insert) {
                self.counts.inserts += 1;
                out.push(self.rng.next_u64() as u8);
            }
            if self.rng.chance(self.faults.lose_byte) {
                self.counts.lost_bytes += 1;
            } else if self.rng.chance(self.faults.flip) {
                self.counts.flips += 1;
                out.push(byte ^ (1 << self.rng.below(8)));
            } else {
                out.push(byte);
            }
        }
        out
    }
}

#[derive(Debug, Clone, Default)]
struct Direction {
    queue: VecDeque<(Duration, Delivery)>,
    line_free_at: Duration,
}

impl Direction {
    /// Inserts a delivery in sequence of arrival: datagrams may overtake one another.
    fn insert(&mut self, at: Duration, delivery: Delivery) {
        let place = self.queue.partition_point(|(time, _)| *time <= at);
        self.queue.insert(place, (at, delivery));
    }

    /// Appends bytes after all others: a stream keeps its sequence.
    fn append(
        &mut self,
        at: Duration,
        bytes: Vec<u8>,
        faults: &Faults,
        rng: &mut Rng,
        counts: &mut FaultCounts,
    ) {
        let mut at = self.queue.back().map_or(at, |(last, _)| at.max(*last));
        if rng.chance(faults.merge)
            && let Some((_, Delivery::Bytes(last))) = self.queue.back_mut()
        {
            counts.merges += 1;
            last.extend(bytes);
            return;
        }
        let mut rest = bytes.as_slice();
        if rest.len() > 1 && rng.chance(faults.split) {
            counts.splits += 1;
            let mut pause = faults.pause;
            for _ in 0..1 + rng.below(3) {
                let (head, tail) = rest.split_at(rng.below(rest.len()));
                if !head.is_empty() {
                    self.queue.push_back((at, Delivery::Bytes(head.to_vec())));
                    if !pause.is_zero() {
                        at += core::mem::take(&mut pause).mul_f64(rng.unit());
                    }
                }
                rest = tail;
            }
        }
        if rest.len() > 1 && rng.chance(faults.stall) {
            counts.stalls += 1;
            let (head, tail) = rest.split_at(1 + rng.below(rest.len() - 1));
            self.queue.push_back((at, Delivery::Bytes(head.to_vec())));
            at += rng.log_uniform(Duration::from_millis(1), faults.max_stall);
            rest = tail;
        }
        self.queue.push_back((at, Delivery::Bytes(rest.to_vec())));
    }
}
