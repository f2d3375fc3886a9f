//! A simulated end of a link, and where its peer reaches it.

use std::time::Duration;

use anyhow::Result;
use serde_json::{Map, Value};

use crate::devices::control::Control;
pub use cellwire_io::endpoint::Endpoint;
use cellwire_io::tcp::Dialing;
use cellwire_io::tls::TlsArgs;
use cellwire_io::trace::TraceArgs;
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

/// The interval at which a stop, a client that comes or goes, and commands are looked for.
pub const POLL_INTERVAL: Duration = Duration::from_millis(10);
