//! A serial port, or a serial device server, that may go away and come back. Other threads do not wait for it: a thread of
//! its own closes and opens it.

use std::collections::VecDeque;
use std::io::{self, ErrorKind};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread;
use std::time::Duration;

use anyhow::Result;
use robot_session::{ReceiveOutcome, SendOutcome, Serial, Session, Transport, Wait};

use super::context::Context;
use super::echo::EchoDetector;
use super::messages::Notification;
use cellwire_io::latency::Deadline;
use cellwire_io::port::AnyPort;
use cellwire_io::serial;
use cellwire_io::tcp::Dialing;
use cellwire_io::trace::TraceDirection;

/// A serial port by its path, or `HOST:PORT`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PortConfig {
    /// The path of the port, or `HOST:PORT`.
    pub path: String,
    /// The rate of the line, in baud.
    pub baud: u32,
}

/// The interval at which a lost port is retried; the session continues meanwhile.
const REOPEN: Duration = Duration::from_millis(200);
/// The least wait: a wait that has run out still reads the bytes that are there.
const LEAST_WAIT: Duration = Duration::from_micros(50);
/// The most entries that wait for the trace: it does not store more either.
const UNTRACED: usize = 256;

type Opened = AnyPort;

pub(super) struct Port {
    name: &'static str,
    config: PortConfig,
    context: Context,
    open: Option<Opened>,
    /// Takes a port that is gone, to close it and to open it again: a driver may take its time for both.
    lost: Sender<Opened>,
    opened: Receiver<Opened>,
    /// The entries for the trace, which are written when its lock is free.
    untraced: VecDeque<(Duration, TraceDirection, Vec<u8>)>,
    returned: EchoDetector,
    /// When bytes were read last.
    pub(super) read_at: Duration,
    /// When bytes were written last.
    pub(super) written_at: Duration,
    /// The time of [`Transport::discard_after`], once a driver has set it.
    discard_after: Option<Duration>,
}

impl Port {
    /// Opens the port for the first time; the host cannot run without it.
    pub(super) fn open(
        name: &'static str,
        config: &PortConfig,
        deadline: Option<Deadline>,
        context: &Context,
    ) -> Result<Self> {
        let port = AnyPort::open(&config.path, config.baud, Dialing::default())?;
        context.notify(Notification::PortOpen(name, config.path.clone()));
        if let Some(advice) = deadline.and_then(|deadline| deadline.advice(&config.path)) {
            context.notify(Notification::SlowAdapter(name, advice));
        }
        let (lost, to_open) = channel();
        let (ready, opened) = channel();
        let (again, stop) = (config.clone(), context.clone());
        thread::spawn(move || reopen(&again, &stop, &to_open, &ready));
        Ok(Self {
            name,
            config: config.clone(),
            context: context.clone(),
            open: Some(port),
            lost,
            opened,
            untraced: VecDeque::new(),
            returned: EchoDetector::default(),
            read_at: Duration::ZERO,
            written_at: Duration::ZERO,
            discard_after: None,
        })
    }

    /// Reports to a session that the port was opened or is gone; `is_connected` is the session's state.
    pub(super) fn follow(&self, session: &mut impl Session, is_connected: &mut bool) {
        if self.is_open() == *is_connected {
            return;
        }
        *is_connected = self.is_open();
        let now = self.context.clock.now();
        if *is_connected { session.handle_connected(now) } else { session.handle_disconnected(now) }
    }

    /// Waits for bytes, and takes all that there are; none when none came in that time, or when the port has gone meanwhile.
    pub(super) fn read(&mut self, wait: Duration, buffer: &mut [u8]) -> usize {
        let Some(port) = &mut self.open else {
            if let Ok(port) = self.opened.recv_timeout(wait) {
                self.open = Some(port);
                if let Some(after) = self.discard_after
                    && let Err(e) = self.discard_after(after)
                {
                    self.lose(&e);
                    return 0;
                }
                self.context.notify(Notification::PortOpen(self.name, self.config.path.clone()));
            }
            return 0;
        };
        let (mut length, mut wait) = (0, wait.max(LEAST_WAIT));
        while let Some(rest) = buffer.get_mut(length..).filter(|rest| !rest.is_empty()) {
            match port.receive(rest, Wait::limited(wait)) {
                Ok(ReceiveOutcome::Bytes(n)) => length += n,
                Ok(ReceiveOutcome::Nothing) => {}
                Ok(ReceiveOutcome::Closed) => {
                    self.lose(&ErrorKind::UnexpectedEof.into());
                    break;
                }
                Err(e) => {
                    self.lose(&e);
                    break;
                }
            }
            if !port.is_waiting() {
                break;
            }
            wait = LEAST_WAIT;
        }
        if length > 0 {
            self.read_at = self.context.clock.now();
            let bytes = buffer.get(..length).unwrap_or_default();
            self.returned.read(bytes);
            self.keep(self.read_at, TraceDirection::Received, bytes);
        }
        length
    }

    /// Returns whether the line returns the sent bytes: the last messages came back before any other bytes.
    pub(super) fn returns(&self) -> bool {
        self.returned.is_proved()
    }

    /// Returns whether the port exists.
    pub(super) fn is_open(&self) -> bool {
        self.open.is_some()
    }

    /// Writes all of `bytes`; false when the port is gone.
    pub(super) fn write(&mut self, bytes: &[u8]) -> bool {
        let Some(port) = &mut self.open else { return false };
        if let Err(e) = port.send_all(bytes) {
            self.lose(&e);
            return false;
        }
        self.written_at = self.context.clock.now();
        self.returned.sent(bytes);
        self.keep(self.written_at, TraceDirection::Sent, bytes);
        true
    }

    /// Passes the read and written bytes on to the trace, unless the screen or the disk is using it: then next time.
    pub(super) fn trace(&mut self) {
        while let Some((at, direction, bytes)) = self.untraced.front() {
            if !self.context.trace.try_add(*at, *direction, bytes) {
                return;
            }
            self.untraced.pop_front();
        }
    }

    /// Passes the rest on to the trace, when there is no other work.
    pub(super) fn trace_all(&mut self) {
        for (at, direction, bytes) in self.untraced.drain(..) {
            self.context.trace.add(at, direction, &bytes);
        }
    }

    /// Listens at another baud rate for this long, after sending `ask`; returns the received bytes. `None` when the port is gone
    /// or does not support the rate.
    pub(super) fn listen(&mut self, baud: u32, ask: &[u8], time: Duration) -> Option<Vec<u8>> {
        let Some(AnyPort::Serial(Serial(port))) = &mut self.open else { return None };
        port.set_baud_rate(baud).ok()?;
        port.write_all(ask).ok()?;
        serial::listen(port.as_mut(), time).ok()
    }

    /// Returns to the port's own rate.
    pub(super) fn end_listening(&mut self) {
        let Some(AnyPort::Serial(Serial(port))) = &mut self.open else { return };
        if let Err(e) = port.set_baud_rate(self.config.baud) {
            self.lose(&e.into());
        }
    }

    fn keep(&mut self, at: Duration, direction: TraceDirection, bytes: &[u8]) {
        if self.untraced.len() == UNTRACED {
            self.untraced.pop_front();
        }
        self.untraced.push_back((at, direction, bytes.to_vec()));
    }

    fn lose(&mut self, error: &io::Error) {
        if let Some(port) = self.open.take() {
            // The thread ends only with this.
            let _ = self.lost.send(port);
        }
        self.context.notify(Notification::PortLost(self.name, error.to_string()));
    }
}

/// Closes each port that is gone, and opens it again as soon as that is possible.
fn reopen(config: &PortConfig, context: &Context, lost: &Receiver<Opened>, opened: &Sender<Opened>) {
    while let Ok(port) = lost.recv() {
        drop(port);
        loop {
            thread::sleep(REOPEN);
            if context.is_stopped() {
                return;
            }
            let Ok(port) = AnyPort::open(&config.path, config.baud, Dialing::default()) else { continue };
            if opened.send(port).is_err() {
                return;
            }
            break;
        }
    }
}

/// A lost port behaves like a silent one; its loss ends the connection.
impl Transport for Port {
    fn now(&self) -> Duration {
        self.context.clock.now()
    }

    fn receive(&mut self, buffer: &mut [u8], wait: Wait<'_>) -> io::Result<ReceiveOutcome> {
        Ok(match self.read(wait.limit.unwrap_or(LEAST_WAIT), buffer) {
            0 => ReceiveOutcome::Nothing,
            length => ReceiveOutcome::Bytes(length),
        })
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<SendOutcome> {
        self.write(bytes);
        Ok(SendOutcome::Buffered)
    }

    fn discard_after(&mut self, after: Duration) -> io::Result<()> {
        self.discard_after = Some(after);
        self.open.as_mut().map_or(Ok(()), |port| port.discard_after(after))
    }
}
