//! val2-viewer in the tool: its codec, and the simulated graphics workstation.

mod codec;
pub mod options;
pub mod workstation;

use crate::links::codec::Codec;
use crate::links::device::{Device, SimulateOptions};
use crate::links::link::Link;
use crate::links::settings::{self, Setting};
use anyhow::Result;
use serde_json::{Map, Value};

/// The link.
#[derive(Debug)]
pub struct Val2Viewer;

impl Link for Val2Viewer {
    fn name(&self) -> &'static str {
        "val2-viewer"
    }

    fn about(&self) -> &'static str {
        "The graphics workstation that draws the robot of val2-alter"
    }

    fn sides(&self) -> &'static [&'static str] {
        &["host"]
    }

    fn sender(&self, _is_client: bool, _server_port: u16) -> &'static str {
        "host"
    }

    fn trace_sides(&self, name: &str) -> Option<[Option<&'static str>; 2]> {
        match name {
            "viewer" => Some([None, Some("host")]),
            "host-viewer" => Some([Some("host"), None]),
            _ => None,
        }
    }

    fn settings(&self) -> Vec<Setting> {
        settings::list(())
    }

    fn codec(&self, _side: &'static str, settings: &Map<String, Value>) -> Result<Box<dyn Codec>> {
        codec::host(settings)
    }

    fn devices(&self) -> &'static [&'static dyn Device] {
        &[&ViewerDevice]
    }
}

#[derive(Debug)]
struct ViewerDevice;

impl Device for ViewerDevice {
    fn name(&self) -> &'static str {
        "viewer"
    }

    fn about(&self) -> &'static str {
        "The graphics workstation that draws the PUMA"
    }

    fn settings(&self) -> Vec<Setting> {
        settings::list(options::ViewerSettings::default())
    }

    fn simulate(&self, options: &SimulateOptions) -> Result<()> {
        workstation::simulate(options)
    }
}
