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
    /// The end that receives what this one sends.
    pub fn other(self) -> Self {
        match self {
            End::A => End::B,
            End::B => End::A,
        }
    }
}

/// What arrives at an end.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Delivery {
    /// Some bytes of a stream, or one datagram.
    Bytes(Vec<u8>),
    /// The connection is gone: nothing sent before it will still arrive. Call [`Link::reconnect`] to go on.
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
    /// A connected link whose faults follow from `seed`.
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

    /// What has arrived at an end by `now`: call until it gives `None`.
    pub fn receive(&mut self, at: End, now: Duration) -> Option<Delivery> {
        self.receive_part(at, now, usize::MAX)
    }

    /// The same, at most this many bytes at once.
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

    /// The time of the next delivery to either end.
    pub fn next_delivery(&self) -> Option<Duration> {
        let first = |direction: &Direction| direction.queue.front().map(|(at, _)| *at);
        first(&self.to_a).into_iter().chain(first(&self.to_b)).min()
    }

    /// Breaks the connection: of what is in flight, a beginning still arrives, then [`Delivery::Closed`].
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

    /// A new connection: nothing of the old one arrives any more.
    pub fn reconnect(&mut self) {
        self.connected = true;
        self.to_a = Direction::default();
        self.to_b = Direction::default();
    }

    /// No fault is committed from now on; what is in flight arrives as it was to.
    pub fn heal(&mut self) {
        self.faults = self.faults.healed();
    }

    /// Whether bytes that are sent now can arrive.
    pub fn is_connected(&self) -> bool {
        self.connected
    }

    /// The faults committed so far.
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
    /// In order of arrival: datagrams may overtake one another.
    fn insert(&mut self, at: Duration, delivery: Delivery) {
        let place = self.queue.partition_point(|(time, _)| *time <= at);
        self.queue.insert(place, (at, delivery));
    }

    /// After all that is there: a stream keeps its order.
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

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Duration = Duration::from_millis(1);

    fn drain(link: &mut Link, at: End) -> (Vec<u8>, Vec<usize>, bool) {
        let (mut bytes, mut sizes, mut closed) = (Vec::new(), Vec::new(), false);
        while let Some(delivery) = link.receive(at, Duration::MAX) {
            match delivery {
                Delivery::Bytes(chunk) => {
                    sizes.push(chunk.len());
                    bytes.extend(chunk);
                }
                Delivery::Closed => closed = true,
            }
        }
        (bytes, sizes, closed)
    }

    #[test]
    fn tcp_cuts_and_glues_but_keeps_every_byte_in_order() {
        let faults = Faults { disconnect: 0.0, ..Faults::TCP };
        let mut link = Link::new(1, faults);
        let sent: Vec<u8> = (0..=255).cycle().take(10_000).collect();
        for chunk in sent.chunks(100) {
            link.send(End::A, MS, chunk);
        }
        let (bytes, sizes, closed) = drain(&mut link, End::B);
        assert_eq!(bytes, sent);
        assert!(!closed);
        assert!(sizes.iter().any(|s| *s < 100) && sizes.iter().any(|s| *s > 100), "{sizes:?}");
        assert_eq!(link.counts().corruption(), 0);
    }

    #[test]
    fn the_pieces_of_a_send_may_be_apart() {
        let mut link = Link::new(1, Faults { split: 1.0, pause: 10 * MS, ..Faults::NONE });
        let (mut at, mut bytes) = (Vec::new(), Vec::new());
        link.send(End::A, Duration::ZERO, b"0123456789");
        while let Some(now) = link.next_delivery() {
            at.push(now);
            let Some(Delivery::Bytes(piece)) = link.receive(End::B, now) else { panic!() };
            bytes.extend(piece);
        }
        assert_eq!(bytes, b"0123456789");
        assert!(at.len() > 1 && at.is_sorted() && at[0] == MS, "{at:?}");
        assert!(at[1] > MS && at.last() <= Some(&(11 * MS)), "{at:?}");
    }

    #[test]
    fn a_send_may_pause_once_within() {
        let faults = Faults { stall: 1.0, latency: Duration::ZERO, ..Faults::NONE };
        let mut longest = Duration::ZERO;
        for seed in 0..200 {
            let mut link = Link::new(seed, faults);
            link.send(End::A, Duration::ZERO, b"0123456789");
            let Some(Delivery::Bytes(mut bytes)) = link.receive(End::B, Duration::ZERO) else { panic!() };
            let at = link.next_delivery().unwrap();
            assert!((MS..=10_000 * MS).contains(&at) && !bytes.is_empty(), "{at:?}");
            let Some(Delivery::Bytes(rest)) = link.receive(End::B, at) else { panic!() };
            bytes.extend(rest);
            assert_eq!((&bytes[..], link.counts().stalls), (&b"0123456789"[..], 1));
            longest = longest.max(at);
        }
        assert!(longest > 5000 * MS, "{longest:?}");
    }

    #[test]
    fn a_healed_link_commits_nothing_more() {
        let mut link = Link::new(6, Faults { disconnect: 1.0, ..Faults::SERIAL }.at_baud(9600));
        link.heal();
        link.send(End::A, Duration::ZERO, &[0; 960]);
        assert_eq!(link.counts(), FaultCounts::default());
        assert!(link.next_delivery() > Some(999 * MS), "the line is as slow as before");
    }

    #[test]
    fn a_break_keeps_a_beginning_and_both_ends_learn_of_it() {
        let mut link = Link::new(2, Faults { disconnect: 1.0, ..Faults::NONE });
        link.send(End::A, MS, b"0123456789");
        assert!(!link.is_connected());
        let (bytes, _, closed) = drain(&mut link, End::B);
        assert!(closed && b"0123456789".starts_with(&bytes));
        assert_eq!(drain(&mut link, End::A), (vec![], vec![], true));
        link.send(End::A, MS, b"lost");
        link.reconnect();
        assert_eq!(link.next_delivery(), None);
    }

    #[test]
    fn a_serial_line_corrupts_as_often_as_its_settings_say() {
        let mut link = Link::new(3, Faults { flip: 0.01, ..Faults::NONE });
        let sent = vec![0u8; 100_000];
        link.send(End::B, MS, &sent);
        let (bytes, _, _) = drain(&mut link, End::A);
        let wrong = bytes.iter().filter(|b| b.count_ones() == 1).count() as u64;
        assert_eq!(wrong, link.counts().flips);
        assert!((800..1200).contains(&wrong), "{wrong}");
    }

    #[test]
    fn each_byte_takes_ten_bits_at_the_baud_rate() {
        let mut link = Link::new(4, Faults { latency: Duration::ZERO, ..Faults::NONE }.at_baud(9600));
        link.send(End::A, Duration::ZERO, &[0; 96]);
        assert_eq!(link.next_delivery().unwrap().as_micros(), 99_999);
        link.send(End::A, Duration::ZERO, &[0; 96]);
        link.receive(End::B, Duration::MAX);
        assert_eq!(link.next_delivery().unwrap().as_micros(), 199_999);
    }

    #[test]
    fn datagrams_repeat_and_overtake_but_keep_their_borders() {
        let faults = Faults { delay: 0.5, repeat: 0.2, lose: 0.1, ..Faults::UDP };
        let mut link = Link::new(5, faults);
        for i in 0..100u8 {
            link.send(End::A, MS * u32::from(i), &[i, i]);
        }
        let mut seen = Vec::new();
        while let Some(Delivery::Bytes(d)) = link.receive(End::B, Duration::MAX) {
            assert!(d.len() == 2 && d[0] == d[1]);
            seen.push(d[0]);
        }
        assert!(seen.windows(2).any(|w| w[0] > w[1]), "none overtook");
        let counts = link.counts();
        assert_eq!(seen.len() as u64, 100 - counts.losses + counts.repeats);
    }

    #[test]
    fn the_same_seed_commits_the_same_faults() {
        let run = |seed| {
            let mut link = Link::new(seed, Faults::SERIAL);
            for _ in 0..50 {
                link.send(End::A, MS, b"the same bytes every time");
            }
            (drain(&mut link, End::B), link.counts())
        };
        assert_eq!(run(9), run(9));
        assert_ne!(run(9), run(10));
    }
}
