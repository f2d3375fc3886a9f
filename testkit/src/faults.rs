//! The faults of a transport: their probabilities and their counts.

use core::fmt;
use core::ops::AddAssign;
use core::time::Duration;

/// The frequency of each fault of a transport. A probability is for each byte, or for each call of
/// [`Link::send`](crate::link::Link::send).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Faults {
    /// Datagrams keep their borders and may overtake one another; a stream keeps its order and has no borders.
    pub datagrams: bool,
    /// The time that a delivery takes without fault.
    pub latency: Duration,
    /// The time that each byte occupies the line: 10 bits at the baud rate, zero for a network.
    pub byte_time: Duration,
    /// A byte with one bit turned over, for each byte.
    pub flip: f64,
    /// A byte lost, for each byte.
    pub lose_byte: f64,
    /// A byte of noise inserted, for each byte.
    pub insert: f64,
    /// Everything lost, for each send: a datagram, or silence on a line.
    pub lose: f64,
    /// A datagram that arrives twice, for each send.
    pub repeat: f64,
    /// Cut into up to four deliveries, for each send.
    pub split: f64,
    /// The longest pause after the first of them.
    pub pause: Duration,
    /// Pauses once within, for a time between 1 ms and `max_stall`, each order of magnitude equally likely; for each send.
    pub stall: f64,
    /// The longest such pause.
    pub max_stall: Duration,
    /// Joined to the delivery before it, for each send.
    pub merge: f64,
    /// Late by up to `max_delay`, for each send; datagrams overtake one another by it.
    pub delay: f64,
    /// The longest extra delay.
    pub max_delay: Duration,
    /// The connection breaks, somewhere within these bytes, for each send.
    pub disconnect: f64,
}

impl Faults {
    /// A stream that does nothing wrong, with a latency of 1 ms.
    pub const NONE: Self = Self {
        datagrams: false,
        latency: Duration::from_millis(1),
        byte_time: Duration::ZERO,
        flip: 0.0,
        lose_byte: 0.0,
        insert: 0.0,
        lose: 0.0,
        repeat: 0.0,
        split: 0.0,
        pause: Duration::ZERO,
        stall: 0.0,
        max_stall: Duration::from_secs(10),
        merge: 0.0,
        delay: 0.0,
        max_delay: Duration::ZERO,
        disconnect: 0.0,
    };

    /// The faults of TCP: split, merge, delay, disconnect. It never corrupts, loses or repeats a byte.
    pub const TCP: Self = Self {
        split: 0.3,
        merge: 0.3,
        delay: 0.1,
        max_delay: Duration::from_millis(300),
        disconnect: 0.01,
        ..Self::NONE
    };

    /// The faults of a serial line: flips, losses, insertions, silence, reads that end anywhere.
    pub const SERIAL: Self = Self {
        flip: 0.001,
        lose_byte: 0.001,
        insert: 0.001,
        lose: 0.01,
        split: 0.3,
        merge: 0.3,
        delay: 0.05,
        max_delay: Duration::from_millis(20),
        ..Self::NONE
    };

    /// A serial line that corrupts one message in ten or so, much worse than real ones, without times of its own.
    pub const BAD_LINE: Self =
        Self { flip: 0.004, lose_byte: 0.002, insert: 0.002, lose: 0.02, split: 0.3, ..Self::NONE };

    /// The faults of UDP: loss, repetition, reordering.
    pub const UDP: Self = Self {
        datagrams: true,
        lose: 0.02,
        repeat: 0.02,
        delay: 0.1,
        max_delay: Duration::from_millis(50),
        ..Self::NONE
    };

    /// Returns the same transport without its faults.
    pub const fn healed(self) -> Self {
        let Self { datagrams, latency, byte_time, .. } = self;
        Self { datagrams, latency, byte_time, ..Self::NONE }
    }

    /// Returns the same faults on a line on which each byte takes ten bits at `baud`.
    pub const fn at_baud(mut self, baud: u32) -> Self {
        self.byte_time = Duration::from_nanos(10_000_000_000 / baud as u64);
        self
    }
}

/// The number of faults of each kind that a link has committed.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[allow(missing_docs, reason = "the fields of Faults, counted")]
pub struct FaultCounts {
    pub flips: u64,
    pub lost_bytes: u64,
    pub inserts: u64,
    pub losses: u64,
    pub repeats: u64,
    pub splits: u64,
    pub stalls: u64,
    pub merges: u64,
    pub delays: u64,
    pub disconnects: u64,
}

impl FaultCounts {
    /// Faults that change or lose bytes; the others only move them in time.
    pub fn corruption(&self) -> u64 {
        self.flips + self.lost_bytes + self.inserts + self.losses
    }

    /// Returns the counts since `before`.
    pub fn since(&self, before: &Self) -> Self {
        Self {
            flips: self.flips - before.flips,
            lost_bytes: self.lost_bytes - before.lost_bytes,
            inserts: self.inserts - before.inserts,
            losses: self.losses - before.losses,
            repeats: self.repeats - before.repeats,
            splits: self.splits - before.splits,
            stalls: self.stalls - before.stalls,
            merges: self.merges - before.merges,
            delays: self.delays - before.delays,
            disconnects: self.disconnects - before.disconnects,
        }
    }

    /// Returns the count of each kind with its name.
    pub fn each(&self) -> [(&'static str, u64); 10] {
        [
            ("flip", self.flips),
            ("byte lost", self.lost_bytes),
            ("insertion", self.inserts),
            ("silence", self.losses),
            ("repetition", self.repeats),
            ("split", self.splits),
            ("stall", self.stalls),
            ("merge", self.merges),
            ("delay", self.delays),
            ("disconnect", self.disconnects),
        ]
    }
}

impl AddAssign for FaultCounts {
    fn add_assign(&mut self, other: Self) {
        self.flips += other.flips;
        self.lost_bytes += other.lost_bytes;
        self.inserts += other.inserts;
        self.losses += other.losses;
        self.repeats += other.repeats;
        self.splits += other.splits;
        self.stalls += other.stalls;
        self.merges += other.merges;
        self.delays += other.delays;
        self.disconnects += other.disconnects;
    }
}

/// The kinds that have happened: `2 flip, 1 delay`.
impl fmt::Display for FaultCounts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut comma = "";
        for (name, count) in self.each().into_iter().filter(|(_, count)| *count > 0) {
            write!(f, "{comma}{count} {name}")?;
            comma = ", ";
        }
        Ok(())
    }
}
