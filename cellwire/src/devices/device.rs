//! A simulated end of a link, and where its peer reaches it.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use anyhow::Result;
use cellwire_sim::{Device as Simulated, Simulator, Told};
use robot_session::{Driver, Session as _, Transport as _};
use serde_json::{Map, Value};

use crate::devices::control::Control;
use crate::io::line::Line;
use cellwire_io::clock::Clock;
use cellwire_io::drive::turn;
pub use cellwire_io::endpoint::Endpoint;
use cellwire_io::listener::Listener;
use cellwire_io::priority::{self, Rank};
use cellwire_io::serial::PtyLink;
use cellwire_io::tcp::{self, Dialing};
use cellwire_io::trace::TraceArgs;
use cellwire_links::Link;
use cellwire_links::settings::Setting;

/// A simulated end of a link.
#[derive(Debug, Clone, Copy)]
pub struct Device {
    /// Its name on the command line.
    pub name: &'static str,
    /// Its link, where that has no other device: another name, and so is that of the link's crate.
    pub link: Option<&'static str>,
    /// What it is, in one line.
    pub about: &'static str,
    /// What can be set of it, and the defaults.
    pub settings: fn() -> Vec<Setting>,
    /// Runs it until the process is interrupted; fails when its endpoint cannot be opened.
    pub simulate: fn(&SimulateOptions) -> Result<()>,
}

impl Device {
    /// Whether it has this name, or its link has and no other device.
    pub fn is_called(&self, name: &str) -> bool {
        self.name == name || self.aliases().any(|alias| alias == name)
    }

    /// Its other names.
    pub fn aliases(&self) -> impl Iterator<Item = &'static str> + use<> {
        let link = self.link.and_then(|link| Link::by_name(link).ok());
        link.into_iter().flat_map(|link| [link.short, link.name])
    }
}

/// The options of a simulator.
#[derive(Debug)]
pub struct SimulateOptions {
    /// Where clients reach it.
    pub endpoint: Endpoint,
    /// How a connection is opened, for a device that is a TCP client.
    pub dialing: Dialing,
    /// A client that neither sends nor takes a byte for this long is disconnected.
    pub idle_timeout: Option<Duration>,
    /// What to do with the bytes of a session that ended.
    pub trace: TraceArgs,
    /// Settings other than the device's defaults.
    pub settings: Map<String, Value>,
    /// The socket of `--control`.
    pub control: Option<Control>,
}

/// Runs `device` on a line at `baud` until the process is interrupted. `name` is the name of the device, `trace` that of its
/// traces.
///
/// # Errors
/// When the endpoint cannot be opened; whatever `device` returns.
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

/// The connection of a device on a line that lasts, whether or not a client is there, until a fault ends it.
#[derive(Debug, Default)]
pub struct Attached {
    is_up: bool,
}

impl Attached {
    /// Called between two turns: ends the connection after [`Told::Close`], and makes one when the device can be
    /// reached again.
    pub fn keep_up<D: Simulated>(&mut self, closes: bool, line: &mut Line, device: &mut Simulator<D>) {
        if device.is_held() {
            line.pass();
        }
        let now = line.now();
        if closes {
            line.hang_up();
            device.handle_disconnected(now);
            self.is_up = false;
        }
        if !device.accepts(now) {
            line.discard();
        } else if !self.is_up && !line.hangs_up() {
            device.handle_connected(now);
            self.is_up = true;
        }
    }
}

/// Whether a client is connected and the device has power. Bytes to a device without power are lost.
pub fn is_there<D: Simulated>(line: &mut Line, device: &Simulator<D>, now: Duration) -> bool {
    let has_power = device.accepts(now);
    if !has_power {
        line.discard();
    }
    has_power && line.is_connected()
}

/// How often a stop, a client that comes or goes, and commands are looked for.
pub const LOOK: Duration = Duration::from_millis(10);

/// Runs a simulated device on a line until it is to stop, or until the line is gone for good. `handle` is given its events, and whether a
/// client has the other end open when that changes.
///
/// # Errors
/// What `handle` returns.
pub fn on_line<D: Simulated>(
    line: &mut Line,
    device: &mut Simulator<D>,
    stop: &AtomicBool,
    mut handle: impl FnMut(Result<Told<D::Event>, bool>) -> Result<()>,
) -> Result<()> {
    priority::raise(Rank::Hardware);
    let mut driver = Driver::new(line);
    let (mut connected, mut left) = (false, 0);
    while !stop.load(Ordering::Relaxed) {
        let line = driver.transport_mut();
        if device.is_held() {
            line.pass();
        }
        let now = line.now();
        let is_there = is_there(line, device, now);
        // The next client may be there already.
        let before = core::mem::replace(&mut left, line.left());
        let has_left = connected && before != left;
        if is_there != connected || has_left {
            connected = !connected;
            if connected {
                device.handle_connected(now);
            } else {
                device.handle_disconnected(now);
            }
            handle(Err(connected))?;
        }
        let mut closes = false;
        let goes_on = turn(&mut driver, device, Some(LOOK), |_, event| {
            closes |= matches!(event, Told::Close(_));
            handle(Ok(event))
        })?;
        if closes {
            driver.transport_mut().hang_up();
        }
        if !goes_on {
            break;
        }
    }
    Ok(())
}
