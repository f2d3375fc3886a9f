//! The file of a site: the broker, and a table for each cell.

mod share;

use std::collections::BTreeMap;
use std::fmt::{self, Display};
use std::net::IpAddr;
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context, Result, anyhow, bail, ensure};
use serde::{Deserialize, Deserializer};
use serde_json::{Map, Value};

use crate::broker::{self, Password, Tls};
use crate::history;
use cellwire_io::input;
use cellwire_links::settings;
pub use share::ShareSettings;

/// A site.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Site {
    /// The broker that everything is sent to.
    pub broker: Broker,
    /// The store of the records that wait for the broker.
    pub store: StoreSettings,
    /// The address for monitoring the bridge.
    #[serde(default)]
    pub health: Health,
    /// The limits of commands from the broker.
    #[serde(default)]
    pub commands: Commands,
    /// The bridges that have cells in common; `None` without.
    pub share: Option<ShareSettings>,
    /// The cells, by their names.
    #[serde(default)]
    pub cell: BTreeMap<String, Cell>,
    #[serde(skip)]
    path: PathBuf,
    #[serde(skip)]
    text: String,
}

/// The broker.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Broker {
    /// The address HOST:PORT, or several: one after the other is tried.
    pub address: Addresses,
    /// The version of MQTT that the bridge speaks.
    #[serde(default)]
    pub mqtt: broker::Version,
    /// The name of Sparkplug's group.
    pub group: String,
    /// The name of Sparkplug's edge node: this bridge, and no other of the group.
    pub node: String,
    /// The client's name at the broker; `None`: GROUP-NODE.
    pub client: Option<String>,
    /// The user name at the broker; `None` without a login.
    pub user: Option<String>,
    /// A file with the password in its first line; `None` without a password.
    pub password_file: Option<PathBuf>,
    /// The TLS files; `None`: the connection is not encrypted.
    pub tls: Option<TlsFiles>,
    /// The keep-alive time: after 1.5 times this without a message the broker considers the bridge disconnected.
    #[serde(default = "keep_alive", deserialize_with = "time")]
    pub keep_alive: Duration,
    /// The host application without which nothing is sent; `None`: no host is waited for.
    pub primary_host: Option<String>,
    /// Unsafe settings that the bridge refuses otherwise.
    #[serde(default)]
    pub allow: Vec<Unsafe>,
    /// Whether numbers stand for the names of metrics after their birth.
    #[serde(default)]
    pub aliases: bool,
    /// The prefix of the topics on which each record is published as JSON, too: PREFIX/CELL; `None`: no record is.
    pub json: Option<String>,
    /// The QoS of records. 1: a record is kept until the broker has it. 0, as Sparkplug has it: until the socket has it.
    #[serde(default = "one")]
    pub qos: u8,
}

/// An unsafe setting that a file has to allow.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Unsafe {
    /// Others can read the password, or the key of the bridge's certificate.
    ReadableSecrets,
    /// The password goes to another computer without TLS.
    PasswordWithoutTls,
}

/// PEM files.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TlsFiles {
    /// The file with the certificates of the authorities that may vouch for the broker.
    pub ca: PathBuf,
    /// The file with the bridge's own certificate; `None` without one.
    pub certificate: Option<PathBuf>,
    /// The file with the key of the bridge's certificate; `None` without one.
    pub key: Option<PathBuf>,
}

/// The store.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StoreSettings {
    /// The file of the store.
    pub file: PathBuf,
    /// The maximum number of bytes of the records; the oldest are dropped for newer ones.
    #[serde(default = "quarter_of_gib", deserialize_with = "bytes")]
    pub bytes: u64,
}

/// The address of the health page and of the metrics.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Health {
    /// The address of `/metrics` and `/health`; a port alone is one of this computer's loopback address. `None`: no server.
    pub listen: Option<String>,
}

/// The commands that the bridge accepts.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Commands {
    /// The maximum difference of a command's time from now.
    #[serde(default = "half_a_minute", deserialize_with = "time")]
    pub max_age: Duration,
    /// The average number of commands per second that each cell takes.
    #[serde(default = "ten")]
    pub rate: f64,
    /// The number of commands at once that each cell takes, after a while without any.
    #[serde(default = "hundred")]
    pub burst: u32,
}

/// A cell.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cell {
    /// The name of the crate of the cell's link.
    pub link: String,
    /// The address of the cell's device: HOST:PORT, or the path of a serial port; `None` if the device connects.
    pub address: Option<String>,
    /// The address that the cell's device connects to; `None` if the bridge connects.
    pub listen: Option<String>,
    /// The pause between each new connection to `address`, or the opened serial port, and the first byte sent.
    #[serde(default, deserialize_with = "time")]
    pub connect_pause: Duration,
    /// Whether the cell takes commands.
    #[serde(default)]
    pub commands: bool,
    /// Whether several bridges share the cell.
    #[serde(default)]
    pub shared: bool,
    /// The settings of the link, as `--set` takes them.
    #[serde(default)]
    pub settings: Map<String, Value>,
    /// Report by exception: the change by which a metric, or those of a folder, are reported; `None`: every value is.
    pub dead_band: Option<BTreeMap<String, f64>>,
}

/// One address, or several.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(untagged, expecting = "give an address, or a list of addresses")]
pub enum Addresses {
    /// A single address.
    One(String),
    /// A list of addresses.
    Several(Vec<String>),
}

impl Addresses {
    /// Returns all addresses.
    pub fn all(&self) -> &[String] {
        match self {
            Self::One(address) => core::slice::from_ref(address),
            Self::Several(addresses) => addresses,
        }
    }
}

impl Display for Addresses {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.all().join(", "))
    }
}

impl Default for Commands {
    fn default() -> Self {
        Self { max_age: half_a_minute(), rate: ten(), burst: hundred() }
    }
}

/// The least bytes of the store's records.
const SMALLEST: u64 = 16 << 10;
/// The longest `max_age`: commands are remembered for longer.
const OLDEST: Duration = Duration::from_secs(3600);

impl Site {
    /// Reads the file, and checks everything but the links of the cells. Files that it names are beside it.
    ///
    /// # Errors
    /// With the line of the error.
    pub fn read(path: &Path) -> Result<Self> {
        let text = input::text(path)?;
        let mut site: Self = toml::from_str(&text)
            .map_err(|error| anyhow!("{}: {}", path.display(), error.to_string().trim_end()))?;
        (site.path, site.text) = (path.to_owned(), text);
        site.check().map_err(|(name, error)| site.located(&name, error))?;
        for name in site.cell.keys() {
            check_name(name).map_err(|error| {
                site.located(&format!("cell.{name}"), error.context(format!("cell {name}")))
            })?;
        }
        let folder = path.parent().unwrap_or(Path::new(""));
        let beside = |file: &mut PathBuf| *file = folder.join(&file);
        beside(&mut site.store.file);
        site.broker.password_file.iter_mut().for_each(beside);
        if let Some(tls) = &mut site.broker.tls {
            beside(&mut tls.ca);
            tls.certificate.iter_mut().chain(&mut tls.key).for_each(beside);
        }
        site.broker.check_secrets().map_err(|(name, error)| site.located(name, error))?;
        site.broker.login().map_err(|error| site.located("broker.password_file", error))?;
        site.broker.tls().map_err(|error| site.located("broker.tls", error))?;
        Ok(site)
    }

    /// Returns the path of the file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns the first table that differs and is read at the start only.
    pub fn differs(&self, other: &Self) -> Option<&'static str> {
        [
            ("broker", self.broker == other.broker),
            ("store", self.store == other.store),
            ("health", self.health == other.health),
            ("commands", self.commands == other.commands),
            ("share", self.share == other.share),
        ]
        .into_iter()
        .find_map(|(name, is_same)| (!is_same).then_some(name))
    }

    /// Returns an error about the setting of this name, with its line in the file.
    pub fn located(&self, name: &str, error: anyhow::Error) -> anyhow::Error {
        match settings::line_of(&self.text, name) {
            Some(line) => anyhow!("{}, line {line}: {error:#}", self.path.display()),
            None => anyhow!("{}: {error:#}", self.path.display()),
        }
    }

    /// Checks the settings; an error has the name of the wrong one.
    fn check(&self) -> Result<(), (String, anyhow::Error)> {
        let wrong = |name: &str, why: &dyn Display| Err((name.to_owned(), anyhow!("{name}: {why}")));
        let broker = &self.broker;
        for (name, value) in [("broker.group", &broker.group), ("broker.node", &broker.node)] {
            if let Err(error) = check_name(value) {
                return wrong(name, &error);
            }
        }
        if let Err(error) = broker.places() {
            return wrong("broker.address", &error);
        }
        if let Some(Err(error)) = broker.json.as_deref().map(check_prefix) {
            return wrong("broker.json", &error);
        }
        if let Some(Err(error)) = broker.primary_host.as_deref().map(check_name) {
            return wrong("broker.primary_host", &error);
        }
        if broker.qos > 1 {
            return wrong("broker.qos", &"give 0 or 1");
        }
        if !(Duration::from_secs(5)..=Duration::from_secs(3600)).contains(&broker.keep_alive) {
            return wrong("broker.keep_alive", &"give 5s to 1h");
        }
        if broker.user.is_none() && broker.password_file.is_some() {
            return wrong("broker.password_file", &"broker.user is missing");
        }
        if broker.tls.as_ref().is_some_and(|tls| tls.certificate.is_some() != tls.key.is_some()) {
            return wrong("broker.tls", &"give certificate and key, or neither");
        }
        if self.store.bytes < SMALLEST {
            return wrong("store.bytes", &"give 16KiB or more");
        }
        if self.commands.max_age > OLDEST {
            return wrong("commands.max_age", &"give at most 1h");
        }
        let Commands { rate, burst, max_age } = self.commands;
        if !(rate > 0.0 && burst > 0) {
            return wrong("commands.rate", &"give rate and burst more than 0");
        }
        // Commands that may still be sent again.
        let most = history::MAX_ENTRIES as f64 / 2.0;
        if rate * 2.0 * max_age.as_secs_f64() + f64::from(burst) > most {
            let why = format!("more than the {most} remembered commands within twice max_age: give less");
            return wrong("commands.rate", &why);
        }
        match self.cell.is_empty() {
            true => wrong("cell", &"there is no cell: add a table [cell.NAME] for each"),
            false => share::check(self.share.as_ref(), broker, &self.cell),
        }
    }
}

impl Broker {
    /// Returns the addresses of the brokers.
    ///
    /// # Errors
    /// If an address is invalid.
    pub fn places(&self) -> Result<Vec<BrokerAddress>> {
        let places: Vec<BrokerAddress> =
            self.address.all().iter().map(|address| place(address)).collect::<Result<_>>()?;
        ensure!(!places.is_empty(), ADVICE);
        let is_secure = |place: &BrokerAddress| place.url.as_ref().is_none_or(|url| url.starts_with("wss:"));
        let scheme = "wss:// needs tls, ws:// must not have it";
        ensure!(
            places.iter().all(|place| place.url.is_none() || is_secure(place) == self.tls.is_some()),
            scheme
        );
        Ok(places)
    }

    /// Checks that unsafe secrets are allowed; an error has the name of the setting.
    fn check_secrets(&self) -> Result<(), (&'static str, anyhow::Error)> {
        let key = self.tls.as_ref().and_then(|tls| tls.key.as_ref());
        for (name, file) in [("broker.password_file", self.password_file.as_ref()), ("broker.tls", key)] {
            let Some(file) = file else { continue };
            if is_readable(file) && !self.allow.contains(&Unsafe::ReadableSecrets) {
                let file = file.display();
                let why =
                    anyhow!("{file} is world-readable: chmod 600 it, or set allow = [\"readable_secrets\"]");
                return Err((name, why));
            }
        }
        let is_local = |BrokerAddress { host, .. }: &BrokerAddress| {
            host == "localhost" || host.parse::<IpAddr>().is_ok_and(|address| address.is_loopback())
        };
        let is_here = self.places().is_ok_and(|places| places.iter().all(is_local));
        if self.password_file.is_some()
            && self.tls.is_none()
            && !is_here
            && !self.allow.contains(&Unsafe::PasswordWithoutTls)
        {
            let why = anyhow!(
                "the password would be sent to {} in clear text: set tls, or allow = [\"password_without_tls\"]",
                self.address
            );
            return Err(("broker.password_file", why));
        }
        Ok(())
    }

    /// Returns the user name and the password.
    ///
    /// # Errors
    /// If the password cannot be read.
    pub fn login(&self) -> Result<Option<(String, Password)>> {
        let Some(user) = &self.user else { return Ok(None) };
        let password = match &self.password_file {
            Some(file) => input::text(file)?.lines().next().unwrap_or_default().to_owned(),
            None => String::new(),
        };
        Ok(Some((user.clone(), Password(password))))
    }

    /// Reads the certificates.
    ///
    /// # Errors
    /// If a file cannot be read, or has no certificate or key.
    pub fn tls(&self) -> Result<Option<Tls>> {
        let Some(files) = &self.tls else { return Ok(None) };
        let certificates = |path: &Path| -> Result<Vec<u8>> {
            let text = input::text(path)?;
            broker::check_certificates(&text).with_context(|| path.display().to_string())?;
            Ok(text.into_bytes())
        };
        let client = match (&files.certificate, &files.key) {
            (Some(certificate), Some(path)) => {
                let key = input::text(path)?;
                ensure!(
                    key.contains("PRIVATE KEY-----"),
                    "{} has no PRIVATE KEY in PEM format",
                    path.display()
                );
                Some((certificates(certificate)?, Password(key)))
            }
            _ => None,
        };
        Ok(Some(Tls { authorities: certificates(&files.ca)?, client }))
    }
}

const ADVICE: &str = "give HOST:PORT, such as broker.example:8883";

/// The address of a broker.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct BrokerAddress {
    /// The broker's name or address.
    pub host: String,
    /// The TCP port of the broker.
    pub port: u16,
    /// The whole URL, if the broker is reached over a WebSocket; otherwise `None`.
    pub url: Option<String>,
}

fn place(address: &str) -> Result<BrokerAddress> {
    let rest = ["ws://", "wss://"].iter().find_map(|scheme| address.strip_prefix(scheme));
    ensure!(
        rest.is_none() || cfg!(feature = "websocket"),
        "this bridge was built without WebSocket: build it with --features websocket"
    );
    let authority = rest.map_or(address, |rest| rest.split('/').next().unwrap_or_default());
    let (host, port) = authority.rsplit_once(':').context(ADVICE)?;
    ensure!(!host.is_empty(), ADVICE);
    let host = host.trim_matches(['[', ']']).to_owned();
    Ok(BrokerAddress { host, port: port.parse().context(ADVICE)?, url: rest.map(|_| address.to_owned()) })
}

/// Returns whether the file is world-readable. Whether it is readable at all is checked when it is read.
fn is_readable(file: &Path) -> bool {
    #[cfg(unix)]
    return file.metadata().is_ok_and(|found| {
        use std::os::unix::fs::PermissionsExt as _;
        found.permissions().mode() & 0o007 != 0
    });
    #[cfg(not(unix))]
    {
        let _ = file; // no bits say who may read it
        false
    }
}

/// Checks a name that is a level of a topic.
pub(crate) fn check_name(name: &str) -> Result<()> {
    ensure!(!name.is_empty() && name.len() <= 64, "give a name of 1 to 64 bytes");
    if let Some(bad) = name.chars().find(|c| matches!(c, '+' | '#' | '/') || c.is_control()) {
        bail!("a topic level must not have {bad:?}");
    }
    Ok(())
}

/// Checks the levels of a topic, which must not be Sparkplug's.
fn check_prefix(prefix: &str) -> Result<()> {
    ensure!(!prefix.starts_with("spBv1.0") && !prefix.starts_with('$'), "this topic prefix is reserved");
    prefix.split('/').try_for_each(check_name)
}

fn time<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Duration, D::Error> {
    let text = String::deserialize(deserializer)?;
    humantime::parse_duration(&text)
        .map_err(|_| serde::de::Error::custom("not a time with a unit, such as 15s"))
}

fn keep_alive() -> Duration {
    Duration::from_secs(15)
}

fn half_a_minute() -> Duration {
    Duration::from_secs(30)
}

fn ten() -> f64 {
    10.0
}

fn hundred() -> u32 {
    100
}

fn one() -> u8 {
    1
}

fn quarter_of_gib() -> u64 {
    256 << 20
}

fn bytes<'de, D: Deserializer<'de>>(deserializer: D) -> Result<u64, D::Error> {
    let text = String::deserialize(deserializer)?;
    let digits = text.trim_end_matches(|c: char| !c.is_ascii_digit());
    let unit = match text.get(digits.len()..).unwrap_or_default().trim_start() {
        "KiB" => Some(1 << 10),
        "MiB" => Some(1 << 20),
        "GiB" => Some(1 << 30),
        _ => None,
    };
    let bytes = unit.and_then(|unit: u64| digits.parse::<u64>().ok()?.checked_mul(unit));
    bytes.ok_or_else(|| serde::de::Error::custom("not a size with a unit, such as 256MiB"))
}
