//! kawasaki-msg in the tool: its codec, both ends simulated, and a picture to draw.

mod codec;
pub mod layout;
pub mod meeting;
pub mod options;
pub mod pc;
mod peer;
pub mod plant;
pub mod robot;
mod roles;
pub mod sheet;
pub mod simulate;

use crate::links::codec::Codec;
use crate::links::device::{Device, SimulateOptions};
use crate::links::link::Link;
use crate::links::settings::{self, Setting};
use anyhow::Result;
use serde_json::{Map, Value};

/// The link.
#[derive(Debug)]
pub struct KawasakiMsg;

impl Link for KawasakiMsg {
    fn name(&self) -> &'static str {
        "kawasaki-msg"
    }

    fn about(&self) -> &'static str {
        "A Kawasaki robot and a PC"
    }

    fn sides(&self) -> &'static [&'static str] {
        &["pc", "robot"]
    }

    fn sender(&self, is_client: bool, _server_port: u16) -> &'static str {
        // The robot opens the connection.
        if is_client { "robot" } else { "pc" }
    }

    fn trace_sides(&self, name: &str) -> Option<[Option<&'static str>; 2]> {
        match name {
            "kawasaki-robot" => Some([Some("robot"), Some("pc")]),
            "kawasaki-pc" => Some([Some("pc"), Some("robot")]),
            _ => None,
        }
    }

    fn settings(&self) -> Vec<Setting> {
        settings::list(options::CodecSettings::default())
    }

    fn codec(&self, _side: &'static str, settings: &Map<String, Value>) -> Result<Box<dyn Codec>> {
        codec::either(settings)
    }

    fn devices(&self) -> &'static [&'static dyn Device] {
        &[&RobotDevice, &PcDevice]
    }
}

#[derive(Debug)]
struct RobotDevice;

impl Device for RobotDevice {
    fn name(&self) -> &'static str {
        "kawasaki-robot"
    }

    fn about(&self) -> &'static str {
        "A Kawasaki robot that draws what a PC sends"
    }

    fn settings(&self) -> Vec<Setting> {
        settings::list(options::RobotSettings::default())
    }

    fn simulate(&self, options: &SimulateOptions) -> Result<()> {
        simulate::robot(options)
    }
}

#[derive(Debug)]
struct PcDevice;

impl Device for PcDevice {
    fn name(&self) -> &'static str {
        "kawasaki-pc"
    }

    fn about(&self) -> &'static str {
        "A PC with a picture for a Kawasaki robot"
    }

    fn settings(&self) -> Vec<Setting> {
        settings::list(options::PcSettings::default())
    }

    fn simulate(&self, options: &SimulateOptions) -> Result<()> {
        simulate::pc(options)
    }
}
