//! isra-ball in the tool: its codec, the simulated ball and the hand on it.

pub mod ball;
mod codec;
pub mod hand;

use crate::links::codec::Codec;
use crate::links::device::{Device, SimulateOptions};
use crate::links::link::Link;
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
        "The ISRA Robot Command Teach Ball; settings: of the demo baud"
    }

    fn sides(&self) -> &'static [&'static str] {
        &["ball"]
    }

    fn sender(&self, _is_client: bool, _server_port: u16) -> &'static str {
        "ball"
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
        "The ISRA Robot Command Teach Ball with a hand on it; settings: baud"
    }

    fn simulate(&self, options: &SimulateOptions) -> Result<()> {
        ball::simulate(options)
    }
}
