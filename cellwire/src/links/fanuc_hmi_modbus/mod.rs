//! fanuc-hmi-modbus in the tool: its codec, the simulated controller, and a client for scripts.

pub mod background;
pub mod client;
mod codec;
pub mod controller;
pub mod faults;
pub mod inputs;
pub mod mapping;
pub mod options;
pub mod program;
pub mod robot;
pub mod simulate;
pub mod tables;

use crate::links::codec::Codec;
use crate::links::device::{Device, SimulateOptions};
use crate::links::link::Link;
use crate::links::settings::{self, Setting};

use anyhow::Result;
use serde_json::{Map, Value};

/// The link.
#[derive(Debug)]
pub struct FanucHmiModbus;

impl Link for FanucHmiModbus {
    fn name(&self) -> &'static str {
        "fanuc-hmi-modbus"
    }

    fn about(&self) -> &'static str {
        "FANUC's HMI Device Communication, Modbus"
    }

    fn sides(&self) -> &'static [&'static str] {
        &["client", "server"]
    }

    fn sender(&self, is_client: bool, _server_port: u16) -> &'static str {
        if is_client { "client" } else { "server" }
    }

    fn trace_sides(&self, name: &str) -> Option<[Option<&'static str>; 2]> {
        match name {
            "fanuc" => Some([Some("server"), Some("client")]),
            _ => None,
        }
    }

    fn settings(&self) -> Vec<Setting> {
        settings::list(options::ViewSettings::default())
    }

    fn codec(&self, side: &'static str, settings: &Map<String, Value>) -> Result<Box<dyn Codec>> {
        codec::either(side, settings)
    }

    fn devices(&self) -> &'static [&'static dyn Device] {
        &[&FanucDevice]
    }
}

#[derive(Debug)]
struct FanucDevice;

impl Device for FanucDevice {
    fn name(&self) -> &'static str {
        "fanuc"
    }

    fn about(&self) -> &'static str {
        "A FANUC controller with a moving robot, over Modbus"
    }

    fn settings(&self) -> Vec<Setting> {
        settings::list(options::FanucSettings::default())
    }

    fn simulate(&self, options: &SimulateOptions) -> Result<()> {
        simulate::simulate(options)
    }
}
