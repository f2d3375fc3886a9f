//! The device's end of a simulated serial line, on which bytes take as long as on a real one.

mod port;
mod server;
#[cfg(all(test, unix))]
mod tests;

use std::collections::VecDeque;
use std::io::{self, Write};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread;
use std::time::Duration;

use anyhow::{Context, Result};
use cellwire_sim::ByteFaults;
use cellwire_sim::host::Listener;
use robot_session::{ReceiveOutcome, SendOutcome, Transport, Wait, is_silence};
use serialport::SerialPort;

use crate::io::priority::{self, ThreadRole};
use cellwire_io::clock::Clock;
use cellwire_io::output::remark;
use cellwire_io::serial::{self, READ_TIMEOUT};
use cellwire_io::tcp;
use cellwire_io::trace::{Trace, TraceDirection};

/// Consecutive bytes are handed over in runs of this many, as a serial chip with a FIFO does: one by one they would keep two
/// processors busy waking threads. The last byte of a transmission is not late because of that.
const FIFO: usize = 8;

/// The time for which the bytes of a disconnected client are carried. The rest is dropped: the bytes in the system's buffers may
/// need an hour on the line.
const CARRIED: Duration = Duration::from_secs(5);

/// The maximum number of bytes that wait in each direction, as in a modem. A client that sends more waits until the line has
/// carried them; a device that sends more takes no input meanwhile.
const MODEM: usize = 4096;

/// The longest chunk of the reader in bytes, and the number of chunks that may wait.
const CHUNK: usize = 256;
const CHUNKS: usize = 16;

/// The device's end. Bytes that it sends reach the client at the baud rate, in the runs of a serial chip's FIFO; bytes from the
/// client reach the device at the baud rate too. Bytes sent while no client is connected are lost.
#[allow(missing_debug_implementations, reason = "it holds a port")]
pub struct Line {
    clock: Clock,
    /// The time until which the session has been driven.
    driven: Duration,
    byte_time: Duration,
    incoming: Receiver<Chunk>,
    writer: Box<dyn Write + Send>,
    client: Arc<Presence>,
    /// Chunks of which a byte has not arrived.
    chunks: usize,
    /// The number of clients that had disconnected when this was checked.
    left: usize,
    /// Whether the device has seen that a client is connected: it does before the client's first byte.
    announced: bool,
    /// The number of clients that had disconnected when the device saw that the last time.
    announced_left: usize,
    sending: Direction,
    /// The time by which this process, not the line, has delayed the bytes that were sent.
    late: Duration,
    receiving: Direction,
    faults: ByteFaults,
    trace: Trace,
    had_client: bool,
    /// The client does not read, and bytes were lost.
    is_overrun: bool,
    /// The device ends the connection once its bytes are carried.
    hangs_up: bool,
}

/// Bytes that were read, when, and how many clients had left then.
type Chunk = (Duration, Vec<u8>, usize);

/// The data that the thread that reads from the client shares with the line.
struct Feed {
    clock: Clock,
    sender: SyncSender<Chunk>,
    client: Arc<Presence>,
}

/// The known state of the client.
#[derive(Debug, Default)]
struct Presence {
    is_connected: AtomicBool,
    /// The client has closed its end, and its bytes are still carried: bytes to it are lost.
    is_deaf: AtomicBool,
    /// Chunks that were read from it, and have not arrived at the device.
    under_way: AtomicUsize,
    /// The number of clients that have disconnected: bytes on the line at that time are lost.
    left: AtomicUsize,
    /// The device has ended the connection.
    is_ended: AtomicBool,
}

impl Feed {
    /// Returns whether the line still exists: then it has a reference to `client`.
    fn is_wanted(&self) -> bool {
        Arc::strong_count(&self.client) > 1
    }

    fn connect(&self, is_connected: bool) {
        self.client.is_deaf.store(false, Ordering::Relaxed);
        self.client.is_connected.store(is_connected, Ordering::Relaxed);
    }

    /// Called when a client has disconnected and its bytes were carried: bytes on the line now are lost.
    fn leave(&self) {
        self.client.left.fetch_add(1, Ordering::Release);
        self.connect(false);
        self.client.is_ended.store(false, Ordering::Release);
    }

    /// Returns whether the device has ended the connection.
    fn is_ended(&self) -> bool {
        self.client.is_ended.load(Ordering::Acquire)
    }
}

/// The bytes on the line in one direction, each with the time at which it has arrived completely.
#[derive(Debug, Default)]
struct Direction {
    bytes: VecDeque<(Duration, u8)>,
    free_at: Duration,
}

/// The transport in place of a serial line between two parts of this process.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Lines {
    /// A pair of pseudo-terminals.
    PseudoTerminals,
    /// A TCP connection, as of a serial device server.
    Tcp,
}

impl Lines {
    /// The transport that is most like a serial line on this platform.
    pub const HERE: Self = if cfg!(unix) { Self::PseudoTerminals } else { Self::Tcp };
}

impl Line {
    /// Creates a line; returns the address of its other end: the path of a port, or `HOST:PORT`.
    ///
    /// # Errors
    /// If the system cannot create another one.
    pub fn simulated(lines: Lines, clock: Clock, baud: u32, trace: Trace) -> Result<(Self, String)> {
        Ok(match lines {
            Lines::PseudoTerminals => {
                let (device, path) = serial::pair()?;
                (Self::over_port(device, Path::new(&path), clock, baud, trace)?, path)
            }
            Lines::Tcp => {
                let listener = tcp::listen("127.0.0.1:0")?;
                let address = listener.local_addr()?.to_string();
                (Self::over_tcp(Listener::new(listener)?, None, clock, baud, trace)?, address)
            }
        })
    }

    /// Creates a line over the device's end of a pseudo-terminal, whose other end is at `path`. When a client closes it, its
    /// bytes are carried for five more seconds; replies to them are dropped, so that the next client reads none of them.
    ///
    /// # Errors
    /// If the port cannot be shared between reader and writer.
    pub fn over_port(
        mut port: Box<dyn SerialPort>,
        path: &Path,
        clock: Clock,
        baud: u32,
        trace: Trace,
    ) -> Result<Self> {
        let reader = port.try_clone()?;
        // A client that does not read loses bytes, as on a line without flow control: nothing waits for it.
        port.set_timeout(Duration::ZERO)?;
        let path = path.to_owned();
        Self::new(Box::new(port), clock, baud, trace, move |feed| port::read(reader, &path, &feed))
    }

    /// Creates a line over TCP, like a serial device server: one client at a time, others are refused, and the device
    /// continues when the client disconnects, or has neither sent nor received a byte for `idle_timeout`. The bytes of a
    /// disconnected client are carried for five more seconds; its other bytes are dropped, and so are the answers to it.
    ///
    /// # Errors
    /// If the system has no room for it.
    pub fn over_tcp(
        listener: Listener,
        idle_timeout: Option<Duration>,
        clock: Clock,
        baud: u32,
        trace: Trace,
    ) -> Result<Self> {
        let (server, client) = server::Server::new(listener, idle_timeout)?;
        Self::new(Box::new(client), clock, baud, trace, |feed| server.run(&feed))
    }

    fn new(
        writer: Box<dyn Write + Send>,
        clock: Clock,
        baud: u32,
        trace: Trace,
        read: impl FnOnce(Feed) + Send + 'static,
    ) -> Result<Self> {
        let (sender, incoming) = sync_channel(CHUNKS);
        let client = Arc::<Presence>::default();
        let feed = Feed { clock, sender, client: Arc::clone(&client) };
        let thread = thread::Builder::new().name("line".into()).spawn(move || {
            priority::raise(ThreadRole::Hardware);
            read(feed);
        });
        thread.context("cannot start a thread that reads from the line")?;
        Ok(Self {
            clock,
            driven: clock.now(),
            byte_time: Duration::from_secs_f64(10.0 / f64::from(baud)),
            incoming,
            writer,
            client,
            chunks: 0,
            left: 0,
            announced: false,
            announced_left: 0,
            sending: Direction::default(),
            late: Duration::ZERO,
            receiving: Direction::default(),
            faults: ByteFaults::none(),
            trace,
            had_client: false,
            is_overrun: false,
            hangs_up: false,
        })
    }

    /// Sets the faults, for both directions.
    #[must_use]
    pub fn with_faults(mut self, faults: ByteFaults) -> Self {
        self.faults = faults;
        self
    }

    /// Puts bytes on the line. Returns the time at which the last of them arrives.
    pub fn send(&mut self, bytes: &[u8]) -> Duration {
        let now = self.clock.now();
        self.trace.add(now, TraceDirection::Sent, bytes);
        for &byte in bytes {
            self.faults.pass(byte, |byte| self.sending.put(now, self.byte_time, byte));
        }
        self.carry();
        self.sending.free_at
    }

    /// Receives the next byte that has arrived by now, with its time of arrival, which does not depend on the time of the
    /// call.
    pub fn receive(&mut self) -> Option<(Duration, u8)> {
        if self.is_full() {
            return None;
        }
        let (at, byte) = self.receiving.take(self.clock.now())?;
        self.trace.add(at, TraceDirection::Received, &[byte]);
        Some((at, byte))
    }

    /// Waits until a byte arrives, or until `deadline`. Returns false when the connection has ended and no other can follow.
    pub fn wait(&mut self, deadline: Duration) -> bool {
        loop {
            let now = self.clock.now();
            self.carry();
            self.forget();
            if self.is_connected() {
                self.had_client = true;
            } else if self.receiving.bytes.is_empty() && core::mem::take(&mut self.had_client) {
                self.trace.end_session("the client disconnected");
                self.is_overrun = false;
            }
            if deadline <= now || self.next_byte().is_some_and(|at| at <= now) {
                return true;
            }
            let arrival = if self.is_full() { None } else { self.receiving.next_run() };
            let next = [self.sending.next_run(), arrival].into_iter().flatten().fold(deadline, Ord::min);
            let wait = next.saturating_sub(now);
            if self.receiving.bytes.len() >= MODEM {
                thread::sleep(wait);
                continue;
            }
            match self.incoming.recv_timeout(wait) {
                Ok((at, bytes, left)) => {
                    self.forget();
                    self.chunks += 1;
                    if left != self.left {
                        continue;
                    }
                    // The client may have disconnected already.
                    self.had_client = true;
                    for byte in bytes {
                        self.faults.pass(byte, |byte| self.receiving.put(at, self.byte_time, byte));
                    }
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return false,
            }
        }
    }

    /// Returns the time by which this process, not the line, has delayed the bytes sent so far.
    pub fn lateness(&self) -> Duration {
        self.late
    }

    /// Returns the clock of the line.
    pub fn clock(&self) -> Clock {
        self.clock
    }

    /// Returns whether a client has the other end open, and the device does not end its connection.
    pub fn is_connected(&self) -> bool {
        !self.hangs_up() && self.client.is_connected.load(Ordering::Relaxed)
    }

    /// Ends the connection of the client once the bytes to it are carried. A client of a pseudo-terminal keeps it open, and
    /// is connected again.
    pub fn hang_up(&mut self) {
        self.hangs_up = self.client.is_connected.load(Ordering::Relaxed);
    }

    /// Returns whether the connection is being ended.
    pub fn hangs_up(&self) -> bool {
        self.hangs_up || self.client.is_ended.load(Ordering::Acquire)
    }

    /// Carries bytes up to now while the device does not read.
    pub fn pass(&mut self) {
        self.driven = self.driven.max(self.clock.now());
        self.wait(self.driven);
    }

    /// Discards the bytes on the line to the device, which has no power.
    pub fn discard(&mut self) {
        self.receiving = Direction::default();
    }

    /// Returns the number of clients that have disconnected: a client may follow another one at once.
    pub fn left(&self) -> usize {
        self.left
    }

    /// Returns the number of faults so far.
    pub fn faults(&self) -> u64 {
        self.faults.count()
    }

    /// Returns the trace. The trace is written when the client disconnects, and when the line is dropped.
    pub fn trace(&self) -> Trace {
        self.trace.clone()
    }

    /// Returns whether the device has sent as much as the line can take, and waits for it.
    fn is_full(&self) -> bool {
        self.sending.bytes.len() >= MODEM
    }

    /// Returns the time at which the device can receive the next byte.
    fn next_byte(&self) -> Option<Duration> {
        self.receiving.next().filter(|_| !self.is_full())
    }

    /// Notes the arrived bytes, and drops those on the line when a client has left.
    fn forget(&mut self) {
        let left = self.client.left.load(Ordering::Acquire);
        if core::mem::replace(&mut self.left, left) != left {
            (self.receiving, self.sending) = (Direction::default(), Direction::default());
        }
        if self.receiving.bytes.is_empty() {
            self.client.under_way.fetch_sub(core::mem::take(&mut self.chunks), Ordering::Relaxed);
        }
    }

    /// Writes every byte that has arrived completely by now.
    fn carry(&mut self) {
        let now = self.clock.now();
        let mut due = Vec::new();
        let mut last = now;
        while let Some((at, byte)) = self.sending.take(now) {
            due.push(byte);
            last = at;
        }
        if self.sending.bytes.is_empty() {
            self.late += now - last;
        }
        if !due.is_empty()
            && self.client.is_connected.load(Ordering::Relaxed)
            && !self.client.is_deaf.load(Ordering::Relaxed)
        {
            // Another error means that the client has just disconnected: the bytes are lost.
            if let Err(error) = self.writer.write_all(&due)
                && is_silence(&error)
                && !core::mem::replace(&mut self.is_overrun, true)
            {
                remark("warning: the client does not read; bytes to it are lost");
            }
        }
        if self.sending.bytes.is_empty() && core::mem::take(&mut self.hangs_up) {
            self.client.is_ended.store(true, Ordering::Release);
        }
    }
}

/// A session is driven through the times at which bytes have arrived and deadlines were due, one after the other, so that a
/// process that is late makes neither of them late.
impl Transport for Line {
    fn now(&self) -> Duration {
        self.driven
    }

    fn receive(&mut self, buffer: &mut [u8], wait: Wait<'_>) -> io::Result<ReceiveOutcome> {
        let until = wait.limit.map_or(Duration::MAX, |wait| self.driven.saturating_add(wait));
        let until = until.min(self.clock.now().max(self.driven) + READ_TIMEOUT);
        if !self.wait(until) {
            return Ok(ReceiveOutcome::Closed);
        }
        let connected = self.is_connected();
        let has_changed = core::mem::replace(&mut self.announced, connected) != connected;
        let has_left = core::mem::replace(&mut self.announced_left, self.left) != self.left;
        if has_changed || has_left {
            return Ok(ReceiveOutcome::Nothing);
        }
        let Some(first) = buffer.first_mut().filter(|_| self.next_byte().is_some_and(|at| at <= until))
        else {
            self.driven = until;
            return Ok(ReceiveOutcome::Nothing);
        };
        Ok(match Line::receive(self) {
            Some((at, byte)) => {
                (self.driven, *first) = (self.driven.max(at), byte);
                ReceiveOutcome::Bytes(1)
            }
            None => ReceiveOutcome::Nothing,
        })
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<SendOutcome> {
        Line::send(self, bytes);
        Ok(SendOutcome::Buffered)
    }
}

impl AsMut<Self> for Line {
    fn as_mut(&mut self) -> &mut Self {
        self
    }
}

impl Drop for Line {
    fn drop(&mut self) {
        self.trace.end_session("the run ended");
    }
}

impl Direction {
    fn put(&mut self, now: Duration, byte_time: Duration, byte: u8) {
        self.free_at = self.free_at.max(now) + byte_time;
        self.bytes.push_back((self.free_at, byte));
    }

    fn take(&mut self, now: Duration) -> Option<(Duration, u8)> {
        self.next().filter(|at| *at <= now)?;
        self.bytes.pop_front()
    }

    fn next(&self) -> Option<Duration> {
        self.bytes.front().map(|(at, _)| *at)
    }

    /// Returns the time at which the next run of bytes is complete: as many as fit the FIFO, or all remaining ones.
    fn next_run(&self) -> Option<Duration> {
        self.bytes.get(FIFO - 1).or(self.bytes.back()).map(|(at, _)| *at)
    }
}
