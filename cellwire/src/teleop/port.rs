//! A serial port that may go away and come back.

use std::io::{ErrorKind, Read, Write};
use std::thread;
use std::time::Duration;

use anyhow::Result;
use serialport::SerialPort;

use super::{Context, PortConfig, Told};
use crate::serial;
use crate::trace::Way;

/// A port that is gone is tried again this often; the session goes on meanwhile.
const REOPEN: Duration = Duration::from_millis(200);
/// A wait that has run out still takes what is there.
const LEAST_WAIT: Duration = Duration::from_micros(50);

pub(super) struct Port {
    name: &'static str,
    config: PortConfig,
    open: Option<Box<dyn SerialPort>>,
    /// What goes to the trace when there is time for its lock.
    untraced: Vec<(Duration, Way, Vec<u8>)>,
}

impl Port {
    /// Opens it for the first time: without it there is no host.
    pub(super) fn open(name: &'static str, config: &PortConfig, context: &Context) -> Result<Self> {
        let port = serial::open(&config.path, config.baud)?;
        context.tell(Told::PortOpen(name, config.path.clone()));
        Ok(Self { name, config: config.clone(), open: Some(port), untraced: Vec::new() })
    }

    /// Waits for bytes; empty when none came in that time. A port that is gone is opened again meanwhile.
    pub(super) fn read<'a>(
        &mut self,
        context: &Context,
        wait: Duration,
        buffer: &'a mut [u8],
    ) -> (Duration, &'a [u8]) {
        let Some(port) = &mut self.open else {
            self.reopen(context);
            return (context.clock.now(), &[]);
        };
        let outcome = port
            .set_timeout(wait.max(LEAST_WAIT))
            .map_err(std::io::Error::from)
            .and_then(|()| port.read(buffer));
        let now = context.clock.now();
        let bytes = match outcome {
            Ok(n) => buffer.get(..n).unwrap_or_default(),
            Err(e) if matches!(e.kind(), ErrorKind::TimedOut | ErrorKind::Interrupted) => &[],
            Err(e) => {
                self.lose(context, &e);
                &[]
            }
        };
        if !bytes.is_empty() {
            self.untraced.push((now, Way::Received, bytes.to_vec()));
        }
        (now, bytes)
    }

    /// Whether the port is there.
    pub(super) fn is_open(&self) -> bool {
        self.open.is_some()
    }

    /// Whether bytes wait to be read.
    pub(super) fn has_bytes(&self) -> bool {
        self.open.as_ref().is_some_and(|port| port.bytes_to_read().is_ok_and(|waiting| waiting > 0))
    }

    /// Writes all of `bytes`; when that was done. `None` when the port is gone.
    pub(super) fn write(&mut self, context: &Context, bytes: &[u8]) -> Option<Duration> {
        let port = self.open.as_mut()?;
        if let Err(e) = port.write_all(bytes) {
            self.lose(context, &e);
            return None;
        }
        let now = context.clock.now();
        self.untraced.push((now, Way::Sent, bytes.to_vec()));
        Some(now)
    }

    /// Passes on to the trace what was read and written. The screen may hold its lock: not before a reply.
    pub(super) fn trace(&mut self, context: &Context) {
        for (at, way, bytes) in self.untraced.drain(..) {
            context.trace.add(at, way, &bytes);
        }
    }

    /// Listens at another baud rate for so long, after sending `ask`; what was heard. `None` when the port is gone or does not
    /// know the rate.
    pub(super) fn listen(&mut self, baud: u32, ask: &[u8], time: Duration) -> Option<Vec<u8>> {
        let port = self.open.as_mut()?;
        port.set_baud_rate(baud).ok()?;
        port.write_all(ask).ok()?;
        serial::listen(port.as_mut(), time).ok()
    }

    /// Back to the rate of its own.
    pub(super) fn end_listening(&mut self, context: &Context) {
        if let Some(Err(e)) = self.open.as_mut().map(|port| port.set_baud_rate(self.config.baud)) {
            self.lose(context, &e.into());
        }
    }

    fn lose(&mut self, context: &Context, error: &std::io::Error) {
        self.open = None;
        context.tell(Told::PortLost(self.name, error.to_string()));
    }

    fn reopen(&mut self, context: &Context) {
        thread::sleep(REOPEN);
        if let Ok(port) = serial::open(&self.config.path, self.config.baud) {
            self.open = Some(port);
            context.tell(Told::PortOpen(self.name, self.config.path.clone()));
        }
    }
}
