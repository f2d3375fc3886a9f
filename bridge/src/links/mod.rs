//! The bridge's client of each link.

mod alter;
mod ball;
mod client;
mod kawasaki;
mod laser;
mod mma;
mod modbus;
mod paced;
mod port;
mod telemetry;
mod viewer;

use std::fmt;
use std::future::Future;
use std::pin::Pin;
use std::time::Duration;

use anyhow::{Context, Result, ensure};
use serde::de::DeserializeOwned;
use serde_json::{Map, Value as Json};

use super::bands::Bands;
use super::end::{End, Inbox};
use super::metric::{COMMON, Definition};
use super::site::{Cell, Site};
use cellwire_links::settings::{self, Configure, RefusedSetting, Setting};

/// A link's client.
pub struct Client {
    /// The metrics of the link's own.
    metrics: &'static [Definition],
    /// The changes by which the metrics are reported; `None`: every value is reported.
    pub bands: Option<Bands>,
    run: Box<dyn FnOnce(End, Inbox) -> CellTask + Send>,
}

/// A cell that runs until the bridge ends.
type CellTask = Pin<Box<dyn Future<Output = ()> + Send>>;

impl fmt::Debug for Client {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Client")
    }
}

impl Client {
    fn new<F>(metrics: &'static [Definition], run: impl FnOnce(End, Inbox) -> F + Send + 'static) -> Self
    where
        F: Future<Output = ()> + Send + 'static,
    {
        Self { metrics, bands: None, run: Box::new(|end, inbox| Box::pin(run(end, inbox))) }
    }

    /// Returns every metric that the client may report.
    pub fn definitions(&self) -> impl Iterator<Item = Definition> + use<> {
        COMMON.into_iter().chain(self.metrics.iter().copied())
    }

    /// Runs until the bridge ends.
    pub async fn run(self, end: End, inbox: Inbox) {
        (self.run)(end, inbox).await;
    }
}

/// Returns the client of every cell, in the order of the cells.
///
/// # Errors
/// With the line of the error.
pub fn clients(site: &Site) -> Result<Vec<Client>> {
    let of_cell = |(name, cell): (&String, &Cell)| {
        client(cell).map_err(|error| {
            let place = match error.downcast_ref::<RefusedSetting>() {
                Some(refused) => format!("cell.{name}.settings.{}", refused.name),
                None if error.is::<WrongBand>() => format!("cell.{name}.dead_band"),
                None => format!("cell.{name}"),
            };
            site.located(&place, error.context(format!("cell {name}")))
        })
    };
    site.cell.iter().map(of_cell).collect()
}

/// Makes the client of a cell's link, with the cell's settings. It connects when it is run.
///
/// # Errors
/// If the cell has no such link, address or setting.
pub fn client(cell: &Cell) -> Result<Client> {
    ensure!(
        cell.address.is_some() != cell.listen.is_some(),
        "give address (HOST:PORT or a serial port), or listen if the device connects to the PC"
    );
    ensure!(cell.connect_pause <= MAX_PAUSE, "connect_pause is longer than a minute");
    ensure!(
        cell.connect_pause.is_zero() || cell.address.is_some(),
        "connect_pause has no effect on a device that connects to the PC"
    );
    let name = cellwire_links::Link::by_name(&cell.link)?.name;
    let link = links().into_iter().find(|link| link.name == name);
    let mut client = (link.with_context(|| format!("the bridge does not support {name}"))?.client)(cell)?;
    if let Some(given) = &cell.dead_band {
        let definitions: Vec<_> = client.definitions().collect();
        client.bands = Some(Bands::of(given, &definitions).context(WrongBand)?);
    }
    Ok(client)
}

/// The longest pause after a connection.
const MAX_PAUSE: Duration = Duration::from_secs(60);

/// A dead band is wrong.
#[derive(Debug)]
struct WrongBand;

impl fmt::Display for WrongBand {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("dead_band")
    }
}

/// Returns the settings of each link's client, by the name of the link.
pub fn settings() -> Vec<(&'static str, Vec<Setting>)> {
    links().into_iter().map(|link| (link.name, link.settings)).collect()
}

/// The client of a cell, with the settings of the cell.
type MakeClient = dyn Fn(&Cell) -> Result<Client>;

/// A link that the bridge has a client of.
struct Link {
    name: &'static str,
    settings: Vec<Setting>,
    client: Box<MakeClient>,
}

fn links() -> [Link; 7] {
    [
        link("kawasaki-msg", kawasaki::client),
        link("val2-alter", alter::client),
        link("val2-viewer", viewer::client),
        link("isra-ball", ball::client),
        link("fanuc-hmi-modbus", modbus::client),
        link("laser-eb90", laser::client),
        link("mmacell-proto", mma::client),
    ]
}

fn link<S: Configure + Default + 'static>(
    name: &'static str,
    client: fn(&Cell, S) -> Result<Client>,
) -> Link {
    let client = move |cell: &Cell| client(cell, settings::read(name, S::default(), &cell.settings)?);
    Link { name, settings: settings::list(S::default()), client: Box::new(client) }
}

/// Parses the one thing that a command orders, and its parameters.
fn order<T: DeserializeOwned>(order: &Map<String, Json>) -> Result<T, String> {
    serde_json::from_value(Json::Object(order.clone())).map_err(|error| error.to_string())
}
