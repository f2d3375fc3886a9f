//! val2-alter in the tool: its codec, the simulated robot and its arm.

mod arm;
mod codec;
pub mod judge;
mod layout;
pub mod options;
mod pose;
pub mod puma;
mod robot_line;
pub mod script;

use crate::links::codec::Codec;
use crate::links::device::{Device, SimulateOptions};
use crate::links::link::Link;
use crate::links::settings::{self, Setting};
use anyhow::Result;
use serde_json::{Map, Value};

pub use arm::ArmConfig;
pub use layout::{Layout, Order};
pub use pose::Pose;

/// The link.
#[derive(Debug)]
pub struct Val2Alter;

impl Link for Val2Alter {
    fn name(&self) -> &'static str {
        "val2-alter"
    }

    fn about(&self) -> &'static str {
        "VAL II ALTER on a Unimation MARK III"
    }

    fn sides(&self) -> &'static [&'static str] {
        &["robot", "host"]
    }

    fn sender(&self, is_client: bool, _server_port: u16) -> &'static str {
        // Serial device servers listen: the robot is connected to one.
        if is_client { "host" } else { "robot" }
    }

    fn trace_sides(&self, name: &str) -> Option<[Option<&'static str>; 2]> {
        match name {
            "robot" => Some([Some("robot"), Some("host")]),
            "host-robot" => Some([Some("host"), Some("robot")]),
            _ => None,
        }
    }

    fn settings(&self) -> Vec<Setting> {
        settings::list(val2_alter::Framing::DEFAULT)
    }

    fn codec(&self, side: &'static str, settings: &Map<String, Value>) -> Result<Box<dyn Codec>> {
        codec::either(side, settings)
    }

    fn devices(&self) -> &'static [&'static dyn Device] {
        &[&PumaDevice]
    }
}

#[derive(Debug)]
struct PumaDevice;

impl Device for PumaDevice {
    fn name(&self) -> &'static str {
        "puma"
    }

    fn about(&self) -> &'static str {
        "The PUMA 562 on its MARK III"
    }

    fn settings(&self) -> Vec<Setting> {
        settings::list(puma::PumaConfig::default())
    }

    fn simulate(&self, options: &SimulateOptions) -> Result<()> {
        puma::simulate(options)
    }
}
