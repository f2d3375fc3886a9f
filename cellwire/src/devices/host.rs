//! The hosts of simulated devices: on TCP, and on a serial line.

use anyhow::{Result, bail};
use cellwire_sim::host::{ConnectionEnd, Listener, Notice, Server};
use cellwire_sim::{Device, Simulator, SimulatorReport};
use serde_json::json;

use crate::devices::control::OwnCommands;
use crate::devices::device::{Endpoint, POLL_INTERVAL, SimulateOptions};
use crate::io::line::Line;
use cellwire_io::clock::Clock;
use cellwire_io::output::{log, notice};
use cellwire_io::serial::PtyLink;
use cellwire_io::tcp;
use cellwire_io::trace::{Trace, TraceDirection};

impl SimulateOptions {
    /// Serves a device over TCP until the process is interrupted. Without `--control`, only its clients change the device.
    /// `observe` gets all notices; the bytes of the connections are in the trace.
    ///
    /// # Errors
    /// If the endpoint cannot be opened, or the files of TLS cannot be used; the errors of `observe`.
    pub fn serve_tcp<D: Device + 'static>(
        &self,
        name: &'static str,
        clock: Clock,
        mut simulator: Simulator<D>,
        own: OwnCommands<D>,
        mut observe: impl FnMut(&Trace, Notice<'_, SimulatorReport<D::Event>>) -> Result<()>,
    ) -> Result<()> {
        let Endpoint::Listen(address) = &self.endpoint else { bail!("{name} is a TCP server: use --listen") };
        let listener = tcp::listen(address)?;
        let place = listener.local_addr()?.to_string();
        let listener = Listener::new(listener)?.with_tls(self.tls.server()?);
        self.ready(name, "listen", &place, &mut simulator, own)?;
        let trace = self.trace.start(name);
        let (idle_timeout, look) = (self.idle_timeout, self.control.as_ref().map(|_| POLL_INTERVAL));
        let server = Server { idle_timeout, look, ..Server::new(listener, || clock.now()) };
        server.run(
            simulator,
            || true,
            |_, notice| {
                keep(&trace, &notice);
                observe(&trace, notice)
            },
        )
    }

    /// Runs a device on a line at `baud` until the process is interrupted. The names are those of the device and of its traces.
    ///
    /// # Errors
    /// If the endpoint cannot be opened; the errors of `run`.
    pub fn serve<D: Device + 'static>(
        &self,
        [name, trace]: [&'static str; 2],
        baud: u32,
        mut simulator: Simulator<D>,
        own: OwnCommands<D>,
        run: impl FnOnce(&mut Line, Simulator<D>) -> Result<()>,
    ) -> Result<()> {
        let clock = Clock::start();
        let trace = self.trace.start(trace);
        let (_link, mut line) = match &self.endpoint {
            Endpoint::Pty(path) => {
                let (link, port) = PtyLink::create(path)?;
                let line = Line::over_port(port, path, clock, baud, trace)?;
                self.ready(name, "pty", &path.to_string_lossy(), &mut simulator, own)?;
                (Some(link), line)
            }
            Endpoint::Listen(address) => {
                let listener = tcp::listen(address)?;
                let place = listener.local_addr()?.to_string();
                let line = Line::over_tcp(Listener::new(listener)?, self.idle_timeout, clock, baud, trace)?;
                self.ready(name, "listen", &place, &mut simulator, own)?;
                (None, line)
            }
            Endpoint::Connect(_) => bail!("{name} is on a serial line: use --pty or --listen"),
        };
        run(&mut line, simulator)
    }
}

/// Prints that a client is connected.
///
/// # Errors
/// Standard output is closed.
pub fn connected(peer: &str) -> Result<()> {
    notice(&json!({"event": "connected", "peer": peer}))
}

/// Prints that a client is disconnected, and the path of its trace.
///
/// # Errors
/// Standard output is closed.
pub fn disconnected(trace: &Trace, peer: &str, why: &str) -> Result<()> {
    let traced = trace.finish(why);
    notice(&json!({"event": "disconnected", "peer": peer, "why": why}))?;
    traced.map_or(Ok(()), |path| log(&json!({"event": "trace", "path": path})))
}

/// Keeps the bytes of a notice.
pub fn keep<E>(trace: &Trace, notice: &Notice<'_, E>) {
    match *notice {
        Notice::Received(at, bytes) => trace.add(at, TraceDirection::Received, bytes),
        Notice::Sent(at, bytes) => trace.add(at, TraceDirection::Sent, bytes),
        _ => {}
    }
}

/// Returns the end of a connection in words, with the option that has caused it.
pub fn reason(ending: &ConnectionEnd) -> String {
    match ending {
        ConnectionEnd::Idle { .. } => format!("{ending}, see --idle-timeout"),
        ending => ending.to_string(),
    }
}
