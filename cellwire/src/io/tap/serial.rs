//! Serial lines: two ports that are joined, or one or two whose receive lines are only listened to.

use std::io::{self, ErrorKind, Read, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use anyhow::{Result, anyhow};
use robot_session::is_silence;
use serialport::SerialPort;

use super::{CHUNK, ConnectionTransport, End, TapEvent, Watch};

/// A port by its name.
pub type NamedPort = (String, Box<dyn SerialPort>);

/// Joins two ports: forwards the bytes of each to the other.
///
/// # Errors
/// If a port is gone.
pub fn join([(a_name, a), (b_name, b)]: [NamedPort; 2], watch: &Watch) -> Result<()> {
    let (to_a, to_b) = (a.try_clone()?, b.try_clone()?);
    watch.see(1, End::A, TapEvent::Opened(ConnectionTransport::Ports([a_name.clone(), b_name.clone()])));
    let (a, b) = (
        Direction { name: a_name, from: a, to: Some(to_b) },
        Direction { name: b_name, from: b, to: Some(to_a) },
    );
    run(a, Some(b), watch)
}

/// Listens: to the receive lines of a Y cable, or to one line that carries both directions.
///
/// # Errors
/// If a port is gone.
pub fn listen((a_name, a): NamedPort, b: Option<NamedPort>, watch: &Watch) -> Result<()> {
    let place = match &b {
        Some((b_name, _)) => ConnectionTransport::Ports([a_name.clone(), b_name.clone()]),
        None => ConnectionTransport::Line(a_name.clone()),
    };
    watch.see(1, End::A, TapEvent::Opened(place));
    let b = b.map(|(name, from)| Direction { name, from, to: None });
    run(Direction { name: a_name, from: a, to: None }, b, watch)
}

/// The bytes that one port receives.
struct Direction {
    name: String,
    from: Box<dyn SerialPort>,
    to: Option<Box<dyn SerialPort>>,
}

fn run(a: Direction, b: Option<Direction>, watch: &Watch) -> Result<()> {
    let is_over = AtomicBool::new(false);
    thread::scope(|scope| {
        let b = b.map(|b| scope.spawn(|| b.pass(End::B, &is_over, watch)));
        let a = a.pass(End::A, &is_over, watch);
        let b = b.map_or(Ok(()), |b| b.join().unwrap_or_else(|_| Err(anyhow!("a thread has panicked"))));
        a.and(b)
    })
}

impl Direction {
    /// Forwards bytes until a port is gone.
    fn pass(mut self, end: End, is_over: &AtomicBool, watch: &Watch) -> Result<()> {
        let mut buffer = vec![0; CHUNK];
        let outcome = loop {
            if is_over.load(Ordering::Relaxed) {
                return Ok(());
            }
            let bytes = match self.from.read(&mut buffer) {
                Ok(0) => break Err(ErrorKind::UnexpectedEof.into()),
                Ok(length) => buffer.get(..length).unwrap_or_default(),
                Err(error) if is_silence(&error) => continue,
                Err(error) => break Err(error),
            };
            watch.see(1, end, TapEvent::Bytes(Arc::from(bytes)));
            if let Some(to) = &mut self.to
                && let Err(error) = write(to, bytes, is_over)
            {
                break Err(error);
            }
        };
        is_over.store(true, Ordering::Relaxed);
        watch.see(1, end, TapEvent::Closed(outcome.as_ref().err().map(ToString::to_string)));
        // As text: a broken pipe is that of standard output elsewhere.
        outcome.map_err(|error| anyhow!("{}: the port is gone: {error}", self.name))
    }
}

/// Waits for a port whose buffer is full.
fn write(to: &mut impl Write, mut bytes: &[u8], is_over: &AtomicBool) -> io::Result<()> {
    while !bytes.is_empty() && !is_over.load(Ordering::Relaxed) {
        match to.write(bytes) {
            Ok(written) => bytes = bytes.get(written..).unwrap_or_default(),
            Err(error) if is_silence(&error) => {}
            Err(error) => return Err(error),
        }
    }
    Ok(())
}
