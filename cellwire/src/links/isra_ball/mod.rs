//! isra-ball in the tool: its codec, the simulated ball and the hand on it.

pub mod ball;
mod codec;
pub mod hand;
pub mod options;

use crate::links::codec::Codec;
use crate::links::device::{Device, SimulateOptions};
use crate::links::link::Link;
use crate::links::settings::{self, Setting};
use anyhow::Result;
use serde_json::{Map, Value};

/// The link.
#[derive(Debug)]
pub struct IsraBall;

impl Link for IsraBall {
    fn name(&self) -> &'static str {
        "isra-ball"
    }

    fn about(&self) -> &'static str {
        "The ISRA Robot Command Teach Ball"
    }

    fn sides(&self) -> &'static [&'static str] {
        &["ball"]
    }

    fn sender(&self, _is_client: bool, _server_port: u16) -> &'static str {
        "ball"
    }

    fn trace_sides(&self, name: &str) -> Option<[Option<&'static str>; 2]> {
        match name {
            "ball" => Some([Some("ball"), None]),
            "host-ball" => Some([None, Some("ball")]),
            _ => None,
        }
    }

    fn settings(&self) -> Vec<Setting> {
        settings::list(())
    }

    fn codec(&self, _side: &'static str, settings: &Map<String, Value>) -> Result<Box<dyn Codec>> {
        codec::ball(settings)
    }

    fn devices(&self) -> &'static [&'static dyn Device] {
        &[&BallDevice]
    }
}

#[derive(Debug)]
struct BallDevice;

impl Device for BallDevice {
    fn name(&self) -> &'static str {
        "ball"
    }

    fn about(&self) -> &'static str {
        "The ISRA Robot Command Teach Ball with a hand on it"
    }

    fn settings(&self) -> Vec<Setting> {
        settings::list(options::BallSettings::default())
    }

    fn simulate(&self, options: &SimulateOptions) -> Result<()> {
        ball::simulate(options)
    }
}
