//! A simulated end of a link, and where its peer reaches it.

use std::time::Duration;

use anyhow::{Result, bail};
use cellwire_sim::host::{ConnectionEnd, Listener, Notice, Server};
use cellwire_sim::{Simulator, SimulatorReport};
use serde_json::{Map, Value, json};

use crate::devices::control::{Control, OwnCommands};
use crate::io::line::Line;
use cellwire_io::clock::Clock;
pub use cellwire_io::endpoint::Endpoint;
use cellwire_io::output::{log, notice};
use cellwire_io::serial::PtyLink;
use cellwire_io::tcp::{self, Dialing};
use cellwire_io::tls::TlsArgs;
use cellwire_io::trace::{Trace, TraceArgs, TraceDirection};
use cellwire_links::Link;
use cellwire_links::settings::Setting;

/// A simulated end of a link.
#[derive(Debug, Clone, Copy)]
pub struct Device {
    /// The name of the device on the command line.
    pub name: &'static str,
    /// The link of the device, if the link has no other device: a second name; so is the name of the link's crate.
    pub link: Option<&'static str>,
    /// The device in one line.
    pub about: &'static str,
    /// The settings of the device, with their defaults.
    pub settings: fn() -> Vec<Setting>,
    /// Runs it until the process is interrupted; fails when its endpoint cannot be opened.
    pub simulate: fn(&SimulateOptions) -> Result<()>,
}

impl Device {
    /// Returns whether the device has this name, or is the only one of the link with this name.
    pub fn is_called(&self, name: &str) -> bool {
        self.name == name || self.aliases().any(|alias| alias == name)
    }

    /// Returns the other names of the device.
    pub fn aliases(&self) -> impl Iterator<Item = &'static str> + use<> {
        let link = self.link.and_then(|link| Link::by_name(link).ok());
        link.into_iter().flat_map(|link| [link.short, link.name])
    }
}

/// The options of a simulator.
#[derive(Debug)]
pub struct SimulateOptions {
    /// The endpoint at which clients reach the device.
    pub endpoint: Endpoint,
    /// The settings of a connection, for a device that is a TCP client.
    pub dialing: Dialing,
    /// The TLS of the device's connections.
    pub tls: TlsArgs,
    /// The time after which a client that neither sends nor takes a byte is disconnected; `None`: never.
    pub idle_timeout: Option<Duration>,
    /// The options of traces: where the bytes of a session that ended are kept.
    pub trace: TraceArgs,
    /// Settings other than the device's defaults.
    pub settings: Map<String, Value>,
    /// The socket of `--control`; `None` without.
    pub control: Option<Control>,
}

impl SimulateOptions {
    /// Serves a device over TCP until the process is interrupted. Without `--control`, only its clients change the device.
    /// `observe` gets all notices; the bytes of the connections are in the trace.
    ///
    /// # Errors
    /// If the endpoint cannot be opened, or the files of TLS cannot be used; the errors of `observe`.
    pub fn serve_tcp<D: cellwire_sim::Device + 'static>(
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
    pub fn serve<D: cellwire_sim::Device + 'static>(
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

/// The interval at which a stop, a client that comes or goes, and commands are looked for.
pub const POLL_INTERVAL: Duration = Duration::from_millis(10);
