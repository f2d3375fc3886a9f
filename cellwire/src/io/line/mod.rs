//! The device's end of a simulated serial line, on which bytes take as long as on a real one.

mod faults;

use std::collections::VecDeque;
use std::io::{self, ErrorKind, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::Result;
use robot_session::{Received, Sent, Transport};
use serialport::SerialPort;

use crate::io::priority::{self, Rank};
use crate::io::serial::READ_TIMEOUT;
use crate::io::trace::{Trace, Way};

pub use faults::LineFaults;

/// Consecutive bytes are handed over in runs of this many, as a serial chip with a FIFO does: one by one they would keep two
/// processors busy waking threads. The last byte of a transmission is not late because of that.
const FIFO: usize = 8;

/// The time since the start of a run, the same for all its parts.
#[derive(Debug, Clone, Copy)]
pub struct Clock(Instant);

impl Clock {
    /// A clock that begins now.
    pub fn start() -> Self {
        Self(Instant::now())
    }

    /// The time since then.
    pub fn now(self) -> Duration {
        self.0.elapsed()
    }
}

/// The device's end. Bytes that it sends reach the client at the baud rate, in the runs of a serial chip's FIFO; bytes from the
/// client reach the device at the baud rate too. Bytes sent while no client is connected are lost.
#[allow(missing_debug_implementations, reason = "it holds a port")]
pub struct Line {
    clock: Clock,
    /// Until when its session has been driven.
    driven: Duration,
    byte_time: Duration,
    incoming: Receiver<(Duration, Vec<u8>)>,
    writer: Box<dyn Write + Send>,
    connected: Arc<AtomicBool>,
    sending: Direction,
    late: Duration,
    receiving: Direction,
    faults: LineFaults,
    trace: Trace,
    had_client: bool,
}

/// The bytes on the line in one direction, each with the time at which it has arrived completely.
#[derive(Debug, Default)]
struct Direction {
    bytes: VecDeque<(Duration, u8)>,
    free_at: Duration,
}

impl Line {
    /// Over a port: the device's end of a pseudo-terminal, or a real port.
    ///
    /// # Errors
    /// When the port cannot be shared between reader and writer.
    pub fn over_port(port: Box<dyn SerialPort>, clock: Clock, baud: u32, trace: Trace) -> Result<Self> {
        let reader = port.try_clone()?;
        Ok(Self::new(Box::new(reader), Box::new(port), clock, baud, trace))
    }

    /// Over TCP, like a serial device server: one client at a time, and the device continues when the client disconnects.
    pub fn over_tcp(listener: TcpListener, clock: Clock, baud: u32, trace: Trace) -> Self {
        let client = Arc::new(Mutex::new(None));
        let server = Server { listener, client: Arc::clone(&client) };
        Self::new(Box::new(server), Box::new(Client(client)), clock, baud, trace)
    }

    fn new(
        reader: Box<dyn Read + Send>,
        writer: Box<dyn Write + Send>,
        clock: Clock,
        baud: u32,
        trace: Trace,
    ) -> Self {
        let (sender, incoming) = channel();
        let connected = Arc::new(AtomicBool::new(false));
        let shared = Arc::clone(&connected);
        // The thread ends after the line is dropped: then it has the only reference to `connected`.
        thread::spawn(move || {
            priority::raise(Rank::Hardware);
            read(reader, clock, &sender, &shared);
        });
        Self {
            clock,
            driven: clock.now(),
            byte_time: Duration::from_secs_f64(10.0 / f64::from(baud)),
            incoming,
            writer,
            connected,
            sending: Direction::default(),
            late: Duration::ZERO,
            receiving: Direction::default(),
            faults: LineFaults::none(),
            trace,
            had_client: false,
        }
    }

    /// Sets the faults, for both directions.
    #[must_use]
    pub fn with_faults(mut self, faults: LineFaults) -> Self {
        self.faults = faults;
        self
    }

    /// Puts bytes on the line. Returns the time at which the last of them arrives.
    pub fn send(&mut self, bytes: &[u8]) -> Duration {
        let now = self.clock.now();
        self.trace.add(now, Way::Sent, bytes);
        for &byte in bytes {
            self.faults.pass(byte, |byte| self.sending.put(now, self.byte_time, byte));
        }
        self.carry();
        self.sending.free_at
    }

    /// The next byte that has arrived by now, and when it arrived: the time does not depend on when this is called.
    pub fn receive(&mut self) -> Option<(Duration, u8)> {
        let (at, byte) = self.receiving.take(self.clock.now())?;
        self.trace.add(at, Way::Received, &[byte]);
        Some((at, byte))
    }

    /// Waits until a byte arrives, or until `deadline`. Returns false when the connection has ended and no other can follow.
    pub fn wait(&mut self, deadline: Duration) -> bool {
        loop {
            let now = self.clock.now();
            self.carry();
            if self.is_connected() {
                self.had_client = true;
            } else if self.receiving.bytes.is_empty() && core::mem::take(&mut self.had_client) {
                self.end_session("the client disconnected");
            }
            if deadline <= now || self.receiving.next().is_some_and(|at| at <= now) {
                return true;
            }
            let next = [self.sending.next_run(), self.receiving.next_run()];
            let next = next.into_iter().flatten().fold(deadline, Ord::min);
            match self.incoming.recv_timeout(next.saturating_sub(now)) {
                Ok((at, bytes)) => {
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

    /// By how much this process, not the line, delayed the bytes sent since the last call.
    pub fn take_lateness(&mut self) -> Duration {
        core::mem::take(&mut self.late)
    }

    /// Whether a client has the other end open.
    pub fn is_connected(&self) -> bool {
        self.connected.load(Ordering::Relaxed)
    }

    /// The number of faults so far.
    pub fn faults(&self) -> u64 {
        self.faults.count
    }

    /// Writes the trace of a session that has ended, and prints its path on standard error. The same happens when the client
    /// disconnects and when the line is dropped.
    pub fn end_session(&self, why: &str) {
        self.trace.end_session(why);
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
        if !due.is_empty() && self.is_connected() {
            // An error means that the client has just disconnected: the bytes are lost.
            let _ = self.writer.write_all(&due);
        }
    }
}

/// A session is driven through the times at which bytes have arrived and deadlines were due, one after the other, so that a
/// process that is late makes neither of them late.
impl Transport for Line {
    fn now(&self) -> Duration {
        self.driven
    }

    fn receive(&mut self, buffer: &mut [u8], wait: Option<Duration>) -> io::Result<Received> {
        let until = wait.map_or(Duration::MAX, |wait| self.driven.saturating_add(wait));
        let until = until.min(self.clock.now().max(self.driven) + READ_TIMEOUT);
        if !self.wait(until) {
            return Ok(Received::Closed);
        }
        let Some(first) = buffer.first_mut().filter(|_| self.receiving.next().is_some_and(|at| at <= until))
        else {
            self.driven = until;
            return Ok(Received::Nothing);
        };
        Ok(match Line::receive(self) {
            Some((at, byte)) => {
                (self.driven, *first) = (self.driven.max(at), byte);
                Received::Bytes(1)
            }
            None => Received::Nothing,
        })
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<Sent> {
        Line::send(self, bytes);
        Ok(Sent::Buffered)
    }
}

impl Drop for Line {
    fn drop(&mut self) {
        self.end_session("the run ended");
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

    /// When the next run of bytes is complete: as many as the FIFO holds, or all that are left.
    fn next_run(&self) -> Option<Duration> {
        self.bytes.get(FIFO - 1).or(self.bytes.back()).map(|(at, _)| *at)
    }
}

/// Reads from the connected client, or waits for one.
struct Server {
    listener: TcpListener,
    client: Arc<Mutex<Option<TcpStream>>>,
}

impl Read for Server {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let client = lock(&self.client).as_ref().map(TcpStream::try_clone).transpose()?;
        let Some(mut client) = client else {
            let (stream, _) = self.listener.accept()?;
            stream.set_nodelay(true)?;
            stream.set_read_timeout(Some(READ_TIMEOUT))?;
            *lock(&self.client) = Some(stream);
            return Err(ErrorKind::TimedOut.into());
        };
        match client.read(buffer) {
            Ok(0) => {
                *lock(&self.client) = None;
                Err(ErrorKind::BrokenPipe.into())
            }
            outcome => outcome,
        }
    }
}

/// Writes to the connected client.
struct Client(Arc<Mutex<Option<TcpStream>>>);

impl Write for Client {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        lock(&self.0).as_mut().map_or(Ok(bytes.len()), |stream| stream.write(bytes))
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Forwards what clients write, with the time at which it was read, until the line is dropped.
fn read(
    mut reader: Box<dyn Read + Send>,
    clock: Clock,
    sender: &Sender<(Duration, Vec<u8>)>,
    connected: &Arc<AtomicBool>,
) {
    let mut buffer = [0; 256];
    while Arc::strong_count(connected) > 1 {
        match reader.read(&mut buffer) {
            Ok(n) => {
                connected.store(true, Ordering::Relaxed);
                let bytes = buffer.get(..n).unwrap_or_default().to_vec();
                if sender.send((clock.now(), bytes)).is_err() {
                    return;
                }
            }
            Err(e) if matches!(e.kind(), ErrorKind::TimedOut | ErrorKind::WouldBlock) => {
                connected.store(true, Ordering::Relaxed);
            }
            Err(e) if e.kind() == ErrorKind::Interrupted => {}
            // No client has the other end open.
            Err(_) => {
                connected.store(false, Ordering::Relaxed);
                thread::sleep(Duration::from_millis(5));
            }
        }
    }
}

#[cfg(test)]
#[cfg(unix)]
mod tests {
    use super::*;
    use crate::io::serial;
    use crate::io::trace::TraceArgs;

    const MS: Duration = Duration::from_millis(1);

    fn line(baud: u32) -> (Line, Box<dyn SerialPort>, Clock) {
        let (device, path) = serial::pair().unwrap();
        let clock = Clock::start();
        let mut line = Line::over_port(device, clock, baud, TraceArgs::off().start("x")).unwrap();
        let client = open(&path, baud);
        while !line.is_connected() {
            assert!(line.wait(clock.now() + MS));
        }
        (line, client, clock)
    }

    /// A client with a timeout that is long enough on a busy machine.
    fn open(path: &str, baud: u32) -> Box<dyn SerialPort> {
        let mut client = serial::open(path, baud).unwrap();
        client.set_timeout(20_000 * MS).unwrap();
        client
    }

    #[test]
    fn bytes_arrive_at_the_baud_rate_both_ways() {
        let (mut line, mut client, clock) = line(1200);
        let before = clock.now();
        let arrives = line.send(&[1, 2, 3, 4, 5, 6]);
        let six_bytes = 50 * MS;
        assert!((before + six_bytes..clock.now() + six_bytes).contains(&arrives));
        let reader = thread::spawn(move || {
            let mut bytes = [0; 6];
            client.read_exact(&mut bytes).unwrap();
            let at = clock.now();
            client.write_all(&[7, 8, 9]).unwrap();
            (client, bytes, at)
        });
        let mut got = Vec::new();
        while got.len() < 3 {
            assert!(line.wait(clock.now() + 500 * MS));
            got.extend(core::iter::from_fn(|| line.receive().map(|(_, byte)| byte)));
        }
        let answered = clock.now();
        let (_client, bytes, at) = reader.join().unwrap();
        assert_eq!((bytes, &got[..]), ([1, 2, 3, 4, 5, 6], &[7, 8, 9][..]));
        assert!(at >= arrives, "{at:?} is before the last byte at {arrives:?}");
        assert!(answered - at >= 24 * MS, "three bytes took {:?}", answered - at);
    }

    #[test]
    fn bytes_sent_without_a_client_are_lost_and_the_next_client_is_served() {
        let (device, path) = serial::pair().unwrap();
        let clock = Clock::start();
        let mut line = Line::over_port(device, clock, 115_200, TraceArgs::off().start("x")).unwrap();
        for round in 1..4u8 {
            line.send(&[99]);
            assert!(line.wait(clock.now() + 5 * MS));
            let mut client = open(&path, 115_200);
            while !line.is_connected() {
                assert!(line.wait(clock.now() + MS));
            }
            line.send(&[round]);
            assert!(line.wait(clock.now() + 5 * MS));
            let mut byte = [0];
            client.read_exact(&mut byte).unwrap();
            assert_eq!(byte, [round]);
            drop(client);
            while line.is_connected() {
                assert!(line.wait(clock.now() + MS));
            }
        }
    }

    #[test]
    fn a_client_that_disconnects_and_the_end_of_the_line_write_a_trace() {
        let dir = std::env::temp_dir().join(format!("cellwire-line-{}", std::process::id()));
        std::fs::create_dir_all(&dir).unwrap();
        let (device, path) = serial::pair().unwrap();
        let clock = Clock::start();
        let trace = Trace::new("x", 10, Some(&dir));
        let mut line = Line::over_port(device, clock, 115_200, trace).unwrap();
        for byte in [7, 8] {
            let mut client = open(&path, 115_200);
            client.write_all(&[byte]).unwrap();
            while line.receive().is_none() {
                assert!(line.wait(clock.now() + 50 * MS));
            }
            drop(client);
            while byte == 7 && line.is_connected() {
                assert!(line.wait(clock.now() + MS));
            }
            assert!(line.wait(clock.now() + MS));
        }
        drop(line);
        let files = ["x.trace", "x-2.trace"].map(|name| std::fs::read_to_string(dir.join(name)).unwrap());
        assert!(files[0].starts_with("# x: the client disconnected\n07 # "), "{files:?}");
        assert!(files[1].starts_with("# x: ") && files[1].contains("\n08 # "), "{files:?}");
        std::fs::remove_dir_all(dir).unwrap();
    }

    #[test]
    fn over_tcp_the_device_serves_one_client_after_another() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap();
        let clock = Clock::start();
        let mut line = Line::over_tcp(listener, clock, 115_200, TraceArgs::off().start("x"));
        for round in 1..4u8 {
            let mut client = TcpStream::connect(address).unwrap();
            client.write_all(&[round]).unwrap();
            let byte = loop {
                assert!(line.wait(clock.now() + 50 * MS));
                if let Some((_, byte)) = line.receive() {
                    break byte;
                }
            };
            line.send(&[byte, byte]);
            assert!(line.wait(clock.now() + 5 * MS));
            let mut echo = [0; 2];
            client.read_exact(&mut echo).unwrap();
            assert_eq!(echo, [round, round]);
            drop(client);
            while line.is_connected() {
                assert!(line.wait(clock.now() + MS));
            }
        }
    }

    #[test]
    fn faults_are_about_as_frequent_as_configured() {
        let (line, mut client, clock) = line(10_000_000);
        let mut line = line.with_faults(LineFaults { flip: 0.02, ..LineFaults::none() });
        let sent = vec![0; 2000];
        client.write_all(&sent).unwrap();
        let mut got = Vec::new();
        while got.len() < sent.len() {
            assert!(line.wait(clock.now() + 500 * MS));
            got.extend(core::iter::from_fn(|| line.receive().map(|(_, byte)| byte)));
        }
        let wrong = got.iter().filter(|byte| byte.count_ones() == 1).count() as u64;
        assert_eq!(wrong, line.faults());
        assert!((10..100).contains(&wrong), "{wrong} of 2000");
    }
}
