//! A tap: what two ends say to each other passes through, or is only listened to, and is seen.
//!
//! Bytes pass first. What looks at them has a queue of its own, and what there is no room for is missed there, counted, and never
//! waited for: a full disk, a reader who has gone to lunch and a slow screen change nothing between the two ends.

pub mod serial;
pub mod tcp;
pub mod udp;

use std::net::SocketAddr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::SystemTime;

/// How much is read and passed on at once.
pub const CHUNK: usize = 16 * 1024;

/// How many pieces wait for what looks at them: of the longest, 64 MiB.
const WAITING: usize = 4096;

/// One of the two ends: of a TCP connection `A` is the client, and on a serial line what is at the port `--a`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum End {
    /// The client.
    A,
    /// The server.
    B,
}

impl End {
    /// The end opposite.
    #[must_use]
    pub fn other(self) -> Self {
        match self {
            Self::A => Self::B,
            Self::B => Self::A,
        }
    }
}

/// Something that happened between the ends.
#[derive(Debug, Clone)]
pub struct Seen {
    /// When.
    pub at: SystemTime,
    /// Of which connection, from 1.
    pub connection: u32,
    /// Which end has done it.
    pub from: End,
    /// What.
    pub what: What,
}

/// What happened.
#[derive(Debug, Clone)]
pub enum What {
    /// A connection, from A's address to B's. On a line that is joined or listened to it is the first that is seen.
    Opened(Place),
    /// Bytes, as they were read.
    Bytes(Arc<[u8]>),
    /// How many bytes were passed on, and not seen.
    Missed(u64),
    /// The end sends no more; or with a reason, its connection broke.
    Closed(Option<String>),
}

/// What carries a connection.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Place {
    /// TCP from A's address to B's.
    Tcp(SocketAddr, SocketAddr),
    /// Datagrams from A's address to B's.
    Udp(SocketAddr, SocketAddr),
    /// Two serial ports, A's and B's.
    Ports([String; 2]),
    /// A serial line that carries what both send.
    Line(String),
}

/// Where everything that is seen goes. Clones lead to the same.
#[derive(Debug, Clone, Default)]
pub struct Watch {
    sinks: Vec<Arc<Sink>>,
}

/// What looks at everything, by a thread of its own.
#[derive(Debug)]
struct Sink {
    queue: SyncSender<Seen>,
    /// Bytes that there was no room for, by connection and end.
    missed: Mutex<Vec<Seen>>,
    has_missed: AtomicBool,
}

impl Watch {
    /// Adds what looks at everything.
    pub fn add(&mut self) -> Receiver<Seen> {
        let (queue, seen) = sync_channel(WAITING);
        let (missed, has_missed) = (Mutex::default(), AtomicBool::new(false));
        self.sinks.push(Arc::new(Sink { queue, missed, has_missed }));
        seen
    }

    /// What a connection does, for every sink.
    pub fn see(&self, connection: u32, from: End, what: What) {
        let seen = Seen { at: SystemTime::now(), connection, from, what };
        for sink in &self.sinks {
            sink.put(seen.clone());
        }
    }
}

impl Sink {
    fn put(&self, seen: Seen) {
        if self.has_missed.load(Ordering::Acquire) {
            let mut missed = self.missed.lock().unwrap_or_else(PoisonError::into_inner);
            while let Some(first) = missed.first() {
                match self.queue.try_send(first.clone()) {
                    Ok(()) => drop(missed.remove(0)),
                    Err(_) => return miss(&mut missed, seen),
                }
            }
            self.has_missed.store(false, Ordering::Release);
        }
        if let Err(TrySendError::Full(seen)) = self.queue.try_send(seen) {
            miss(&mut self.missed.lock().unwrap_or_else(PoisonError::into_inner), seen);
            self.has_missed.store(true, Ordering::Release);
        }
    }
}

/// What there is no room for: bytes are counted, the rest is kept.
fn miss(missed: &mut Vec<Seen>, seen: Seen) {
    let What::Bytes(bytes) = &seen.what else { return missed.push(seen) };
    let length = bytes.len() as u64;
    let is_same = |it: &Seen| it.connection == seen.connection && it.from == seen.from;
    let last = missed.iter_mut().rev().find(|it| is_same(it));
    match last {
        Some(Seen { what: What::Missed(count), .. }) => *count += length,
        _ => missed.push(Seen { what: What::Missed(length), ..seen }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_nobody_looks_at_is_counted_and_makes_nobody_wait() {
        let mut watch = Watch::default();
        let (slow, quick) = (watch.add(), watch.add());
        let bytes: Arc<[u8]> = Arc::from([1, 2, 3]);
        let reader = std::thread::spawn(move || quick.iter().count());
        for _ in 0..WAITING + 10 {
            watch.see(1, End::A, What::Bytes(Arc::clone(&bytes)));
            std::thread::yield_now();
        }
        watch.see(1, End::B, What::Bytes(Arc::clone(&bytes)));
        watch.see(1, End::A, What::Closed(None));
        let before: Vec<Seen> = slow.try_iter().collect();
        assert_eq!(before.len(), WAITING);
        // What was missed comes before what is seen next, by its end.
        watch.see(2, End::A, What::Bytes(bytes));
        let after: Vec<String> =
            slow.try_iter().map(|it| format!("{} {:?} {:?}", it.connection, it.from, it.what)).collect();
        assert_eq!(after, ["1 A Missed(30)", "1 B Missed(3)", "1 A Closed(None)", "2 A Bytes([1, 2, 3])"]);
        drop(watch);
        assert!(reader.join().unwrap() > WAITING);
    }
}
