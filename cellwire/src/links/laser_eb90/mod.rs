//! laser-eb90 in the tool: its codec, the simulated controller, and a sheet to cut.

mod codec;
pub mod controller;
pub mod options;

use crate::links::codec::Codec;
use crate::links::device::{Device, SimulateOptions};
use crate::links::link::Link;
use crate::links::settings::{self, Setting};

use anyhow::Result;
use serde_json::{Map, Value};

/// The link.
#[derive(Debug)]
pub struct LaserEb90;

impl Link for LaserEb90 {
    fn name(&self) -> &'static str {
        "laser-eb90"
    }

    fn about(&self) -> &'static str {
        "A laser machining robot, EB 90 frames"
    }

    fn sides(&self) -> &'static [&'static str] {
        &["host", "controller"]
    }

    fn sender(&self, is_client: bool, _server_port: u16) -> &'static str {
        // Serial device servers listen: the robot is connected to one.
        if is_client { "host" } else { "controller" }
    }

    fn trace_sides(&self, name: &str) -> Option<[Option<&'static str>; 2]> {
        match name {
            "laser" => Some([Some("controller"), Some("host")]),
            "laser-host" => Some([Some("host"), Some("controller")]),
            _ => None,
        }
    }

    fn settings(&self) -> Vec<Setting> {
        settings::list(laser_eb90::Profile::default())
    }

    fn codec(&self, _side: &'static str, settings: &Map<String, Value>) -> Result<Box<dyn Codec>> {
        codec::either(settings)
    }

    fn devices(&self) -> &'static [&'static dyn Device] {
        &[&LaserDevice]
    }
}

#[derive(Debug)]
struct LaserDevice;

impl Device for LaserDevice {
    fn name(&self) -> &'static str {
        "laser"
    }

    fn about(&self) -> &'static str {
        "The controller of a laser robot"
    }

    fn settings(&self) -> Vec<Setting> {
        settings::list(options::LaserSettings::default())
    }

    fn simulate(&self, options: &SimulateOptions) -> Result<()> {
        controller::simulate(options)
    }
}
