//! The faulty link of a session, and its effect on each transmission.

use core::time::Duration;

use super::log::{Log, Mark};
use super::tally::Tally;
use crate::link::{Delivery, End, Faults, Link};
use robot_session::contract::Rng;

/// The message that some bytes begin with, by the protocol's own check.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Check {
    /// No whole message.
    Nothing,
    /// A message that only the check refuses.
    Refused,
    /// A valid message of this many bytes.
    Good(usize),
}

/// A valid message, by the protocol's own check, that was not sent: corruption made it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Unseen {
    /// The sender of the corrupt bytes.
    pub from: End,
    /// The transmissions that its bytes come from.
    first: usize,
    last: usize,
    /// The bytes of the message.
    pub bytes: Vec<u8>,
}

impl Unseen {
    /// Returns whether one of the transmissions was made between two marks.
    pub fn is_between(&self, from: Mark, to: Mark) -> bool {
        let (from, to) = match self.from {
            End::A => (from.0, to.0),
            End::B => (from.1, to.1),
        };
        self.first < to && self.last >= from
    }
}

/// A [`Link`] that records its acts, and can trace them.
#[derive(Debug)]
pub struct Wire {
    link: Link,
    log: Log,
    names: [&'static str; 2],
    text: bool,
    polls: Rng,
    late_polls: f64,
    sent: [Vec<Transmission>; 2],
    /// The bytes that have arrived, where the transport changes any.
    received: [Vec<u8>; 2],
    corrupts: bool,
}

#[derive(Debug)]
struct Transmission {
    /// Empty where the transport changes no bytes.
    bytes: Vec<u8>,
    /// The position of its first byte in the stream that its receiver reads.
    start: usize,
    end: usize,
    corrupt: bool,
}

impl Wire {
    /// Creates a link whose faults follow from `seed`. `names` are those of the ends A and B in the trace; `text` shows
    /// bytes as text.
    pub fn new(seed: u64, faults: Faults, names: [&'static str; 2], text: bool, log: Log) -> Self {
        let corrupts = !faults.datagrams && faults.flip + faults.lose_byte + faults.insert > 0.0;
        let link = Link::new(seed, faults);
        let polls = Rng::new(seed ^ 0x6C61_7465);
        Self {
            link,
            log,
            names,
            text,
            polls,
            late_polls: 0.0,
            sent: Default::default(),
            received: Default::default(),
            corrupts,
        }
    }

    /// Calls [`Link::send`].
    pub fn send(&mut self, from: End, now: Duration, bytes: &[u8]) {
        let before = self.link.counts();
        self.link.send(from, now, bytes);
        let after = self.link.counts();
        let missing = after.lost_bytes - before.lost_bytes;
        let extra = after.inserts - before.inserts;
        let whole = after.losses > before.losses;
        let corrupt = !whole && after.corruption() > before.corruption();
        let sent = &mut self.sent[index(from)];
        let start = sent.last().map_or(0, |last| last.end);
        let len = if whole { 0 } else { bytes.len() as u64 + extra - missing };
        let kept = if self.corrupts { bytes.to_vec() } else { Vec::new() };
        sent.push(Transmission { bytes: kept, start, end: start + len as usize, corrupt });
        if self.log.on {
            let what = if before == after { String::new() } else { format!("  [{}]", after.since(&before)) };
            let (from, to) = (self.names[index(from)], self.names[index(from.other())]);
            self.log.line(now, format_args!("{from} -> {to}: {}{what}", self.shown(bytes)));
        }
    }

    /// Calls [`Link::receive`].
    pub fn receive(&mut self, at: End, now: Duration) -> Option<Delivery> {
        self.receive_part(at, now, usize::MAX)
    }

    /// Calls [`Link::receive_part`].
    pub fn receive_part(&mut self, at: End, now: Duration, most: usize) -> Option<Delivery> {
        let delivery = self.link.receive_part(at, now, most)?;
        if let (Delivery::Bytes(bytes), true) = (&delivery, self.corrupts) {
            self.received[index(at.other())].extend(bytes);
        }
        if self.log.on {
            let at = self.names[index(at)];
            match &delivery {
                Delivery::Bytes(bytes) => {
                    self.log.line(now, format_args!("  {at} receives {}", self.shown(bytes)));
                }
                Delivery::Closed => {
                    self.log.line(now, format_args!("  {at} learns that the connection is gone"))
                }
            }
        }
        Some(delivery)
    }

    /// Calls [`Link::disconnect`].
    pub fn disconnect(&mut self, now: Duration) {
        self.log.line(now, format_args!("the connection is closed"));
        self.link.disconnect(now);
    }

    /// Calls [`Link::reconnect`].
    pub fn reconnect(&mut self, now: Duration) {
        self.log.line(now, format_args!("a new connection"));
        self.link.reconnect();
        // The bytes that were under way do not arrive.
        for (sent, received) in self.sent.iter().zip(&mut self.received) {
            if self.corrupts {
                received.resize(sent.last().map_or(0, |last| last.end), 0);
            }
        }
    }

    /// Calls [`Link::is_connected`].
    pub fn is_connected(&self) -> bool {
        self.link.is_connected()
    }

    /// Returns the next time at which the ends are polled: a delivery, or one of `timeouts`; or, with the probability of
    /// [`poll_late`](Self::poll_late), up to seconds later.
    pub fn next(&mut self, now: Duration, timeouts: impl IntoIterator<Item = Option<Duration>>) -> Duration {
        let times = timeouts.into_iter().chain([self.link.next_delivery()]).flatten();
        let next = times.min().unwrap_or(now).max(now + Duration::from_micros(50));
        if !self.polls.chance(self.late_polls) {
            return next;
        }
        let late = self.polls.log_uniform(Duration::from_millis(1), Duration::from_secs(5));
        self.log.line(next, format_args!("both ends are polled {late:?} late"));
        next + late
    }

    /// Polls the ends late from now on with probability `late`: by 1 ms to 5 s, each order of magnitude equally likely.
    pub fn poll_late(&mut self, late: f64) {
        self.late_polls = late;
    }

    /// Ends the faults of the link and of its polls from now on.
    pub fn heal(&mut self, now: Duration) {
        self.log.line(now, format_args!("no more faults"));
        self.late_polls = 0.0;
        self.link.heal();
    }

    /// Writes a line of the trace.
    pub fn log(&self, now: Duration, text: core::fmt::Arguments<'_>) {
        self.log.line(now, text);
    }

    /// Calls [`Link::next_delivery`].
    pub fn next_delivery(&self) -> Option<Duration> {
        self.link.next_delivery()
    }

    /// Returns a mark after the transmissions up to now.
    pub fn mark(&self) -> Mark {
        Mark(self.sent[0].len(), self.sent[1].len())
    }

    /// Adds the faults and the corruption. Returns the valid messages that corruption made, of at most `longest` bytes.
    pub fn settle(
        &self,
        now: Duration,
        tally: &mut Tally,
        longest: usize,
        check: impl Fn(End, &[u8]) -> Check,
    ) -> Vec<Unseen> {
        tally.faults += self.link.counts();
        let mut found: Vec<Unseen> = Vec::new();
        for from in [End::A, End::B] {
            let (sent, received) = (&self.sent[index(from)], &self.received[index(from)]);
            let mut searched = 0;
            for hurt in sent.iter().filter(|sent| sent.corrupt && sent.start < sent.end) {
                tally.corrupt += 1;
                let first = searched.max(hurt.start.saturating_sub(longest));
                searched = searched.max(hurt.end);
                for start in first..hurt.end {
                    let len = match check(from, received.get(start..).unwrap_or_default()) {
                        Check::Nothing => continue,
                        Check::Refused => {
                            tally.refused += 1;
                            continue;
                        }
                        Check::Good(len) => len,
                    };
                    let end = start + len;
                    let first = sent.partition_point(|sent| sent.end <= start);
                    let last = sent.partition_point(|sent| sent.start < end).saturating_sub(1);
                    let sources = sent.get(first..=last).unwrap_or_default();
                    let bytes = received[start..end].to_vec();
                    let said: Vec<u8> = sources.iter().flat_map(|sent| &sent.bytes).copied().collect();
                    let was_said = said.windows(bytes.len()).any(|window| window == bytes);
                    if sources.iter().any(|sent| sent.corrupt) && !was_said {
                        found.push(Unseen { from, first, last, bytes });
                    }
                }
            }
        }
        tally.unseen += found.len() as u64;
        for unseen in &found {
            let (to, shown) = (self.names[index(unseen.from.other())], self.shown(&unseen.bytes));
            self.log.line(now, format_args!("corruption has made a valid message for {to}: {shown}"));
        }
        found
    }

    fn shown(&self, bytes: &[u8]) -> String {
        if self.text { bytes.escape_ascii().to_string() } else { hex(bytes) }
    }
}

fn index(end: End) -> usize {
    match end {
        End::A => 0,
        End::B => 1,
    }
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02X}")).collect::<Vec<_>>().join(" ")
}
