//! A simulated end of a link, and where its peer reaches it.

use std::net::TcpListener;
use std::time::Duration;

use anyhow::Result;
use cellwire_sim::host::{ConnectionEnd, Listener, Notice, Server};
use serde_json::{Map, Value};

use crate::devices::control::Control;
use crate::io::line::Line;
use cellwire_io::clock::Clock;
pub use cellwire_io::endpoint::Endpoint;
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
    /// Creates the server of a device. Without `--control`, only its clients change the device.
    ///
    /// # Errors
    /// The listener cannot be made not to block; the files of TLS cannot be used.
    pub fn server(&self, listener: TcpListener, clock: Clock) -> Result<Server<impl Fn() -> Duration>> {
        let look = self.control.as_ref().map(|_| POLL_INTERVAL);
        let listener = Listener::new(listener)?;
        let (idle_timeout, tls) = (self.idle_timeout, self.tls.server()?);
        Ok(Server { idle_timeout, look, tls, ..Server::new(listener, move || clock.now()) })
    }
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

/// Runs `device` on a line at `baud` until the process is interrupted. `name` is the name of the device, `trace` that of its
/// traces.
///
/// # Errors
/// If the endpoint cannot be opened; whatever `device` returns.
pub fn serve(
    name: &str,
    trace: &str,
    options: &SimulateOptions,
    baud: u32,
    device: impl FnOnce(&mut Line, Clock) -> Result<()>,
) -> Result<()> {
    let clock = Clock::start();
    let trace = options.trace.start(trace);
    match &options.endpoint {
        Endpoint::Pty(path) => {
            let (_link, port) = PtyLink::create(path)?;
            let mut line = Line::over_port(port, path, clock, baud, trace)?;
            options.ready(name, "pty", &path.to_string_lossy())?;
            device(&mut line, clock)
        }
        Endpoint::Listen(address) => {
            let listener = tcp::listen(address)?;
            options.ready(name, "listen", &listener.local_addr()?.to_string())?;
            let listener = Listener::new(listener)?;
            device(&mut Line::over_tcp(listener, options.idle_timeout, clock, baud, trace)?, clock)
        }
        Endpoint::Connect(_) => anyhow::bail!("{name} is on a serial line: use --pty or --listen"),
    }
}

/// The interval at which a stop, a client that comes or goes, and commands are looked for.
pub const POLL_INTERVAL: Duration = Duration::from_millis(10);
