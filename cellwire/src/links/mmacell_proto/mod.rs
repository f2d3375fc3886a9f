//! mmacell-proto in the tool: its codec, the simulated cell, and the central controller that runs the task in it.

pub mod axes;
mod codec;
pub mod connections;
pub mod options;
pub mod simulate;
pub mod station;

use crate::links::codec::Codec;
use crate::links::device::{Device, SimulateOptions};
use crate::links::link::Link;
use crate::links::settings::{self, Setting};
use anyhow::Result;
use serde_json::{Map, Value};

/// The link.
#[derive(Debug)]
pub struct MmacellProto;

impl Link for MmacellProto {
    fn name(&self) -> &'static str {
        "mmacell-proto"
    }

    fn about(&self) -> &'static str {
        "The MM&A micro-manipulation cell"
    }

    fn sides(&self) -> &'static [&'static str] {
        &["central", "robot", "platform"]
    }

    fn sender(&self, is_client: bool, server_port: u16) -> &'static str {
        match server_port {
            _ if is_client => "central",
            ::mmacell_proto::port::PLATFORM => "platform",
            _ => "robot",
        }
    }

    fn trace_sides(&self, name: &str) -> Option<[Option<&'static str>; 2]> {
        match name {
            "mma-robot" => Some([Some("robot"), Some("central")]),
            "mma-platform" => Some([Some("platform"), Some("central")]),
            _ => None,
        }
    }

    fn settings(&self) -> Vec<Setting> {
        settings::list(mmacell_proto::Dialect::STRICT)
    }

    fn codec(&self, side: &'static str, settings: &Map<String, Value>) -> Result<Box<dyn Codec>> {
        codec::either(side, settings)
    }

    fn devices(&self) -> &'static [&'static dyn Device] {
        &[&MmaRobotDevice, &MmaPlatformDevice]
    }
}

#[derive(Debug)]
struct MmaRobotDevice;

impl Device for MmaRobotDevice {
    fn name(&self) -> &'static str {
        "mma-robot"
    }

    fn about(&self) -> &'static str {
        "The robot of the MM&A cell"
    }

    fn settings(&self) -> Vec<Setting> {
        settings::list(options::DeviceSettings::default())
    }

    fn simulate(&self, options: &SimulateOptions) -> Result<()> {
        simulate::robot(options)
    }
}

#[derive(Debug)]
struct MmaPlatformDevice;

impl Device for MmaPlatformDevice {
    fn name(&self) -> &'static str {
        "mma-platform"
    }

    fn about(&self) -> &'static str {
        "The orientation platform of the MM&A cell"
    }

    fn settings(&self) -> Vec<Setting> {
        settings::list(options::DeviceSettings::default())
    }

    fn simulate(&self, options: &SimulateOptions) -> Result<()> {
        simulate::platform(options)
    }
}
