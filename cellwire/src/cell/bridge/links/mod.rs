//! The bridge's client of each link.

mod alter;
mod ball;
mod client;
mod kawasaki;
mod laser;
mod mma;
mod modbus;
mod viewer;

use anyhow::{Context, Result, bail, ensure};
use serde::de::DeserializeOwned;
use serde_json::{Map, Value as Json};

use super::end::End;
use super::hall::{Cell, Hall};
use super::metric::{COMMON, Definition};
use crate::links::by_name;
use crate::links::settings::{Refused, Setting};

/// A link's client.
#[allow(missing_debug_implementations, reason = "it holds what runs")]
pub struct Client {
    /// The metrics of its own.
    metrics: &'static [Definition],
    run: Box<dyn FnOnce(End) + Send>,
}

impl Client {
    fn new(metrics: &'static [Definition], run: impl FnOnce(End) + Send + 'static) -> Self {
        Self { metrics, run: Box::new(run) }
    }

    /// Every metric that it may report.
    pub fn definitions(&self) -> impl Iterator<Item = Definition> + use<> {
        COMMON.into_iter().chain(self.metrics.iter().copied())
    }

    /// Runs until the bridge ends.
    pub fn run(self, end: End) {
        (self.run)(end);
    }
}

/// The client of every cell, in the order of the cells.
///
/// # Errors
/// With the line of what is wrong.
pub fn clients(hall: &Hall) -> Result<Vec<Client>> {
    let of_cell = |(name, cell): (&String, &Cell)| {
        client(cell).map_err(|error| {
            let place = match error.downcast_ref::<Refused>() {
                Some(refused) => format!("cell.{name}.settings.{}", refused.name),
                None => format!("cell.{name}"),
            };
            hall.located(&place, error.context(format!("cell {name}")))
        })
    };
    hall.cell.iter().map(of_cell).collect()
}

/// The client of a cell's link, with the cell's settings. It connects when it is run.
///
/// # Errors
/// When the cell has no such link, address or setting.
fn client(cell: &Cell) -> Result<Client> {
    ensure!(
        cell.address.is_some() != cell.listen.is_some(),
        "give address (HOST:PORT, or the path of a serial port), or listen where the device connects to the PC"
    );
    match by_name(&cell.link)?.name() {
        "fanuc-hmi-modbus" => modbus::client(cell),
        "isra-ball" => ball::client(cell),
        "kawasaki-msg" => kawasaki::client(cell),
        "laser-eb90" => laser::client(cell),
        "mmacell-proto" => mma::client(cell),
        "val2-alter" => alter::client(cell),
        "val2-viewer" => viewer::client(cell),
        name => bail!("{name} has no client of the bridge"),
    }
}

/// What can be set of each link's client, by the name of the link.
pub fn settings() -> Vec<(&'static str, Vec<Setting>)> {
    vec![
        ("kawasaki-msg", kawasaki::settings()),
        ("val2-alter", alter::settings()),
        ("val2-viewer", viewer::settings()),
        ("isra-ball", ball::settings()),
        ("fanuc-hmi-modbus", modbus::settings()),
        ("laser-eb90", laser::settings()),
        ("mmacell-proto", mma::settings()),
    ]
}

/// The address of a device that does not connect by itself.
fn address(cell: &Cell) -> Result<String> {
    cell.address
        .clone()
        .context("this link's device does not connect by itself: give address instead of listen")
}

/// The one thing that a command orders, and its parameters.
fn order<T: DeserializeOwned>(order: &Map<String, Json>) -> Result<T, String> {
    serde_json::from_value(Json::Object(order.clone())).map_err(|error| error.to_string())
}
