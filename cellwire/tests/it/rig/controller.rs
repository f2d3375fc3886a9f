//! A robot controller that shares no code with the crates: frames by hand, and time in its own cycles.

use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use cellwire::io::priority::{self, ThreadRole};

use super::pty::Pty;

pub(crate) const CYCLE: Duration = Duration::from_millis(28);

/// The outcome of a cycle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Cycle {
    /// The values of a reply; those left out are zero, and the count of bytes on the line.
    Values([i16; 6], usize),
    /// The same while the exception subroutine runs: they move nothing.
    Interrupted([i16; 6]),
    /// The same with a segment status other than that of a path that is followed.
    Status(u8, [i16; 6]),
    /// No reply.
    Missed,
    /// The host has accepted (00), or refused (FF) ALTER.
    Start(u8),
    /// Nobody answers: ALTER has ended.
    Ended,
}

enum Order {
    /// Execute `ALTER(0, mode)`.
    Start(u8),
    /// The exception subroutine runs for this many cycles.
    Interrupt(u32),
    /// Nothing is sent for this many cycles; then the program starts again.
    Pause(u32),
    /// The next message reports this error of the previous reply.
    Reject(u8),
    /// This segment status for this many cycles.
    Status(u8, u32),
}

/// The controller's thread, and what it saw.
pub(crate) struct Controller {
    orders: Sender<Order>,
    log: Arc<Mutex<Vec<Cycle>>>,
}

impl Controller {
    pub(crate) fn new(port: Pty) -> Self {
        let (orders, to_do) = channel();
        let log = Arc::new(Mutex::new(Vec::new()));
        let seen = Arc::clone(&log);
        thread::spawn(move || run(port, &to_do, &seen));
        Self { orders, log }
    }

    pub(crate) fn start(&self, mode: u8) {
        self.orders.send(Order::Start(mode)).unwrap();
    }

    pub(crate) fn interrupt(&self, cycles: u32) {
        self.orders.send(Order::Interrupt(cycles)).unwrap();
    }

    pub(crate) fn pause(&self, cycles: u32) {
        self.orders.send(Order::Pause(cycles)).unwrap();
    }

    pub(crate) fn reject(&self, error: u8) {
        self.orders.send(Order::Reject(error)).unwrap();
    }

    pub(crate) fn status(&self, status: u8, cycles: u32) {
        self.orders.send(Order::Status(status, cycles)).unwrap();
    }

    pub(crate) fn log(&self) -> Vec<Cycle> {
        self.log.lock().unwrap().clone()
    }

    /// Returns whether ALTER has ended.
    pub(crate) fn has_ended(&self) -> bool {
        self.log.lock().unwrap().last() == Some(&Cycle::Ended)
    }

    /// Returns the number of cycles so far.
    pub(crate) fn now(&self) -> usize {
        self.log.lock().unwrap().len()
    }

    /// Waits until one of the cycles from `since` on is what is asked for; its place.
    pub(crate) fn wait(&self, what: &str, since: usize, wanted: impl Fn(&Cycle) -> bool) -> usize {
        let end = Instant::now() + Duration::from_secs(30);
        loop {
            if let Some(at) = self.log().iter().skip(since).position(&wanted) {
                return since + at;
            }
            let log = self.log();
            let last = &log[since.max(log.len().saturating_sub(40))..];
            assert!(
                Instant::now() < end,
                "{what} did not come since cycle {since} of {}: {last:?}",
                log.len()
            );
            thread::sleep(Duration::from_millis(5));
        }
    }

    /// Waits for this many cycles, or for the end of ALTER.
    pub(crate) fn pass(&self, cycles: usize) {
        let until = self.now() + cycles;
        let end = Instant::now() + Duration::from_secs(30);
        while self.now() < until && !self.has_ended() {
            assert!(Instant::now() < end, "the controller hangs");
            thread::sleep(Duration::from_millis(5));
        }
    }
}

/// The segment status of a path that is followed.
const FOLLOWED: u8 = 2;

/// A missing reply ends the source's ALTER; this controller accepts a few of a busy computer, and reports each: the host begins
/// from rest.
const FORGIVEN: u32 = 30;

/// Returns the error code of a message after this many cycles without a reply.
fn error(missed: u32) -> u8 {
    if missed > 0 { 6 } else { 0 }
}

fn run(mut port: Pty, orders: &Receiver<Order>, log: &Mutex<Vec<Cycle>>) {
    // Real hardware does not wait for a processor.
    priority::raise(ThreadRole::Hardware);
    let see = |cycle| log.lock().unwrap().push(cycle);
    'off: loop {
        let Ok(order) = orders.recv() else { return };
        let Order::Start(mode) = order else { continue };
        loop {
            match exchange(&mut port, &[0xA0, mode]).as_deref() {
                Some([0x00]) => {
                    see(Cycle::Start(0));
                    break;
                }
                Some([0xFF]) => {
                    see(Cycle::Start(0xFF));
                    continue 'off;
                }
                _ => see(Cycle::Missed),
            }
        }
        let (mut missed, mut interrupted, mut position) = (0, 0, 0i16);
        let mut held = (FOLLOWED, 0);
        loop {
            let mut error = error(missed);
            match orders.try_recv() {
                Ok(Order::Interrupt(cycles)) => interrupted = cycles,
                Ok(Order::Reject(code)) => error = code,
                Ok(Order::Status(status, cycles)) => held = (status, cycles),
                Ok(Order::Pause(cycles)) => {
                    thread::sleep(CYCLE * cycles);
                    break;
                }
                // The program is started again, without a word about the ALTER before.
                Ok(Order::Start(_)) => break,
                Err(std::sync::mpsc::TryRecvError::Disconnected) => return,
                Err(std::sync::mpsc::TryRecvError::Empty) => {}
            }
            let control = error | if interrupted > 0 { 0xC0 } else { 0x80 };
            let (status, left) = held;
            held = if left > 1 { (status, left - 1) } else { (FOLLOWED, 0) };
            let mut message = vec![control, status, 1, 0, 0, 0x20];
            if mode & 4 != 0 {
                let words = [16384, 0, 0, 0, -16384, 0, 0, 0, -16384, position, 0, 0];
                message.extend(words.iter().flat_map(|word: &i16| word.to_le_bytes()));
            }
            let reply = exchange(&mut port, &message);
            match reply.as_deref().and_then(values) {
                Some((values, length)) => {
                    missed = 0;
                    if status != FOLLOWED {
                        see(Cycle::Status(status, values));
                    } else if interrupted == 0 {
                        position = position.wrapping_add(values[0]);
                        see(Cycle::Values(values, length));
                    } else {
                        see(Cycle::Interrupted(values));
                    }
                }
                None => {
                    missed += 1;
                    see(Cycle::Missed);
                }
            }
            interrupted = interrupted.saturating_sub(1);
            if missed > FORGIVEN {
                send(&mut port, &[0xE6]);
                see(Cycle::Ended);
                continue 'off;
            }
        }
        // A new start message for the same mode.
        loop {
            match exchange(&mut port, &[0xA0, mode]).as_deref() {
                Some([0x00]) => break see(Cycle::Start(0)),
                _ => see(Cycle::Missed),
            }
        }
        again(&mut port, mode, log);
    }
}

/// Cycles of an ALTER that was started again, without answers.
fn again(port: &mut Pty, mode: u8, log: &Mutex<Vec<Cycle>>) {
    let mut missed = 0;
    while missed <= FORGIVEN {
        let mut message = vec![0x80 | error(missed), 2, 1, 0, 0, 0x20];
        message.resize(if mode & 4 != 0 { 30 } else { 6 }, 0);
        let cycle = match exchange(port, &message).as_deref().and_then(values) {
            Some((values, length)) => {
                missed = 0;
                Cycle::Values(values, length)
            }
            None => {
                missed += 1;
                Cycle::Missed
            }
        };
        log.lock().unwrap().push(cycle);
    }
    send(port, &[0xE6]);
    log.lock().unwrap().push(Cycle::Ended);
}

fn send(port: &mut Pty, data: &[u8]) {
    let mut frame = vec![0x10, 0x10, 0x02];
    for byte in data {
        frame.extend(if *byte == 0x10 { vec![0x10, 0x10] } else { vec![*byte] });
    }
    let sum = data.iter().fold(0u8, |sum, byte| sum.wrapping_add(*byte));
    frame.extend([0x10, 0x03, sum]);
    port.write(&frame);
}

/// Runs one cycle: sends a message, and returns the data of the reply that comes before the next one. Earlier bytes are too
/// late, and are not a reply.
fn exchange(port: &mut Pty, data: &[u8]) -> Option<Vec<u8>> {
    let next = Instant::now() + CYCLE;
    let mut stale = [0; 256];
    while port.read(Duration::ZERO, &mut stale).is_ok_and(|length| length > 0) {}
    send(port, data);
    let (mut bytes, mut reply) = (Vec::new(), None);
    loop {
        let left = next.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return reply;
        }
        if reply.is_some() {
            thread::sleep(left);
            continue;
        }
        let mut buffer = [0; 64];
        match port.read(left, &mut buffer) {
            Ok(n) => bytes.extend_from_slice(&buffer[..n]),
            Err(_) => thread::sleep(Duration::from_millis(2)),
        }
        reply = unframe(&bytes);
    }
}

/// Returns the data of a whole frame, if its sum is valid.
fn unframe(bytes: &[u8]) -> Option<Vec<u8>> {
    let begin = bytes.windows(3).position(|mark| mark == [0x10, 0x10, 0x02])? + 3;
    let (mut data, mut rest) = (Vec::new(), bytes[begin..].iter());
    loop {
        match *rest.next()? {
            0x10 => match *rest.next()? {
                0x10 => data.push(0x10),
                0x03 => break,
                other => panic!("10 {other:02x} inside of {bytes:02x?}"),
            },
            byte => data.push(byte),
        }
    }
    let sum = data.iter().fold(0u8, |sum, byte| sum.wrapping_add(*byte));
    assert_eq!(*rest.next()?, sum, "{bytes:02x?}");
    Some(data)
}

/// Returns the values of a reply, and its length on the line.
fn values(data: &[u8]) -> Option<([i16; 6], usize)> {
    let [_exception, select, words @ ..] = data else { return None };
    let mut words = words.chunks(2);
    let values = [0, 1, 2, 3, 4, 5].map(|axis| {
        if select >> axis & 1 == 0 {
            return 0;
        }
        let word = words.next().unwrap();
        i16::from_le_bytes([word[0], word[1]])
    });
    assert!(words.next().is_none(), "{data:02x?}");
    Some((values, 6 + data.iter().map(|byte| if *byte == 0x10 { 2 } else { 1 }).sum::<usize>()))
}
