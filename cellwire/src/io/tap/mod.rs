//! A tap: forwards or only listens to the bytes between two ends, and passes them on to its sinks.
//!
//! Bytes are forwarded first. Each sink has a queue of its own; bytes that do not fit into it are counted as missed. A full disk,
//! a slow reader or a slow screen has no effect on the two ends.

pub mod serial;
pub mod tcp;
pub mod udp;

use std::net::SocketAddr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant, SystemTime};

/// The number of bytes that are read and passed on at once.
pub const CHUNK: usize = 16 * 1024;

/// The number of pieces that may wait for a watcher: of the longest, 64 MiB.
const WAITING: usize = 4096;

/// One of the two ends: of a TCP connection `A` is the client, and on a serial line the device at the port `--a`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum End {
    /// The client of a connection, or the device at the port `--a`.
    A,
    /// The server of a connection, or the other device.
    B,
}

impl End {
    /// Returns the opposite end.
    #[must_use]
    pub fn other(self) -> Self {
        match self {
            Self::A => Self::B,
            Self::B => Self::A,
        }
    }
}

/// An event of a connection, with its time and the end that caused it.
#[derive(Debug, Clone)]
pub struct TapRecord {
    /// The time of the event.
    pub at: SystemTime,
    /// The number of the connection, from 1.
    pub connection: u32,
    /// The end that caused the event.
    pub from: End,
    /// The event between the ends.
    pub what: TapEvent,
}

/// An event of a connection.
#[derive(Debug, Clone)]
pub enum TapEvent {
    /// A connection, from A's address to B's. On a line that is joined or listened to it is the first that is seen.
    Opened(ConnectionTransport),
    /// Bytes, as they were read at once.
    Bytes(Arc<[u8]>),
    /// The number of bytes that were passed on, and not seen.
    Missed(u64),
    /// The end sends no more; or with a reason, its connection broke.
    Closed(Option<String>),
}

/// The transport of a connection.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ConnectionTransport {
    /// TCP from A's address to B's.
    Tcp(SocketAddr, SocketAddr),
    /// Datagrams from A's address to B's.
    Udp(SocketAddr, SocketAddr),
    /// Two serial ports, A's and B's.
    Ports([String; 2]),
    /// A serial line that carries the bytes of both ends.
    Line(String),
}

/// The destination of everything that is seen. Clones lead to the same destination.
#[derive(Debug, Clone, Default)]
pub struct Watch {
    sinks: Vec<Arc<Sink>>,
}

/// The way to one that looks at everything, in a thread of its own.
#[derive(Debug)]
struct Sink {
    queue: SyncSender<TapRecord>,
    rest: Arc<TapOverflow>,
}

/// Events for which a queue had no room, and whether the tap ends.
#[derive(Debug, Default)]
struct TapOverflow {
    /// The number of bytes, by connection and end, and all other observations.
    missed: Mutex<Vec<TapRecord>>,
    has_missed: AtomicBool,
    /// Nothing more is seen.
    is_closed: AtomicBool,
}

/// Everything that was seen, for one that looks at it.
#[derive(Debug)]
pub struct TapReceiver {
    queue: Receiver<TapRecord>,
    rest: Arc<TapOverflow>,
}

/// The interval at which a waiting watcher checks whether the tap ends.
const CLOSE_CHECK_INTERVAL: Duration = Duration::from_millis(100);

impl Watch {
    /// Adds one that looks at everything.
    pub fn add(&mut self) -> TapReceiver {
        let ((queue, seen), rest) = (sync_channel(WAITING), Arc::<TapOverflow>::default());
        self.sinks.push(Arc::new(Sink { queue, rest: Arc::clone(&rest) }));
        TapReceiver { queue: seen, rest }
    }

    /// Passes an event of a connection to all sinks.
    pub fn see(&self, connection: u32, from: End, what: TapEvent) {
        let seen = TapRecord { at: SystemTime::now(), connection, from, what };
        for sink in &self.sinks {
            sink.put(seen.clone());
        }
    }

    /// Closes the watch: each watcher gets the rest, and then the end.
    pub fn close(&self) {
        for sink in &self.sinks {
            sink.rest.is_closed.store(true, Ordering::Release);
        }
    }
}

impl Sink {
    fn put(&self, seen: TapRecord) {
        if self.rest.is_closed.load(Ordering::Acquire) {
            return;
        }
        if self.rest.has_missed.load(Ordering::Acquire) {
            let mut missed = self.rest.missed();
            while let Some(first) = missed.first() {
                match self.queue.try_send(first.clone()) {
                    Ok(()) => drop(missed.remove(0)),
                    Err(_) => return miss(&mut missed, seen),
                }
            }
            self.rest.has_missed.store(false, Ordering::Release);
        }
        if let Err(TrySendError::Full(seen)) = self.queue.try_send(seen) {
            miss(&mut self.rest.missed(), seen);
            self.rest.has_missed.store(true, Ordering::Release);
        }
    }
}

impl TapOverflow {
    fn missed(&self) -> MutexGuard<'_, Vec<TapRecord>> {
        self.missed.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl TapReceiver {
    /// Returns the next event; `None` if there is none now. Bytes that did not fit into the queue are counted after those in it.
    pub fn next_now(&self) -> Option<TapRecord> {
        if let Ok(seen) = self.queue.try_recv() {
            return Some(seen);
        }
        if !self.rest.has_missed.load(Ordering::Acquire) {
            return None;
        }
        // While this is locked, no event overtakes the missed ones.
        let mut missed = self.rest.missed();
        let seen = self.queue.try_recv().ok();
        seen.or_else(|| (!missed.is_empty()).then(|| missed.remove(0)))
    }

    /// Returns the next item as [`next_now`](Self::next_now) does, after a wait of at most `time`.
    ///
    /// # Errors
    /// There is nothing in time, or there is nothing more to see.
    pub fn next_within(&self, time: Duration) -> Result<TapRecord, RecvTimeoutError> {
        let end = Instant::now() + time;
        loop {
            let is_closed = self.rest.is_closed.load(Ordering::Acquire);
            if let Some(seen) = self.next_now() {
                return Ok(seen);
            }
            let left = end.saturating_duration_since(Instant::now());
            if is_closed {
                return Err(RecvTimeoutError::Disconnected);
            }
            match self.queue.recv_timeout(left.min(CLOSE_CHECK_INTERVAL)) {
                Ok(seen) => return Ok(seen),
                Err(RecvTimeoutError::Timeout) if !left.is_zero() => {}
                Err(RecvTimeoutError::Timeout) => return Err(RecvTimeoutError::Timeout),
                // The last ones may have been missed just now.
                Err(error) => return self.next_now().ok_or(error),
            }
        }
    }
}

/// Adds an event that does not fit into the queue: bytes are counted, other events are stored.
fn miss(missed: &mut Vec<TapRecord>, seen: TapRecord) {
    let TapEvent::Bytes(bytes) = &seen.what else { return missed.push(seen) };
    let length = bytes.len() as u64;
    let is_same = |it: &TapRecord| it.connection == seen.connection && it.from == seen.from;
    let last = missed.iter_mut().rev().find(|it| is_same(it));
    match last {
        Some(TapRecord { what: TapEvent::Missed(count), .. }) => *count += length,
        _ => missed.push(TapRecord { what: TapEvent::Missed(length), ..seen }),
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
        let long = Duration::from_secs(60);
        let reader =
            std::thread::spawn(move || (0..).take_while(|_| quick.next_within(long).is_ok()).count());
        for _ in 0..WAITING + 10 {
            watch.see(1, End::A, TapEvent::Bytes(Arc::clone(&bytes)));
            std::thread::yield_now();
        }
        watch.see(1, End::B, TapEvent::Bytes(Arc::clone(&bytes)));
        watch.see(1, End::A, TapEvent::Closed(None));
        let text = |it: TapRecord| format!("{} {:?} {:?}", it.connection, it.from, it.what);
        let next = |count: usize| {
            let texts = (0..count).map_while(|_| slow.next_now().map(text));
            texts.collect::<Vec<String>>()
        };
        assert_eq!(next(2), ["1 A Bytes([1, 2, 3])"; 2]);
        // The missed events come before the next ones, by their end, and without any of the next ones.
        watch.see(2, End::A, TapEvent::Bytes(Arc::clone(&bytes)));
        let rest = next(usize::MAX);
        let missed = ["1 A Missed(30)", "1 B Missed(3)", "1 A Closed(None)", "2 A Missed(3)"];
        assert_eq!(rest.split_at(WAITING - 2).1, missed);
        watch.see(2, End::A, TapEvent::Bytes(Arc::clone(&bytes)));
        watch.close();
        watch.see(2, End::A, TapEvent::Bytes(bytes));
        assert_eq!(slow.next_within(long).ok().map(text).as_deref(), Some("2 A Bytes([1, 2, 3])"));
        assert!(matches!(slow.next_within(long), Err(RecvTimeoutError::Disconnected)));
        assert!(reader.join().unwrap() > WAITING);
    }

    #[test]
    fn when_the_tap_has_ended_there_is_nothing_more_to_see() {
        let mut watch = Watch::default();
        let seeing = watch.add();
        assert!(matches!(seeing.next_within(Duration::from_millis(1)), Err(RecvTimeoutError::Timeout)));
        watch.see(1, End::A, TapEvent::Closed(None));
        drop(watch);
        let next = || seeing.next_within(Duration::from_secs(60));
        assert!(next().is_ok() && matches!(next(), Err(RecvTimeoutError::Disconnected)));
    }
}
