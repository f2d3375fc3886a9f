//! isra-ball in the tool: the simulated ball and the hand on it.

pub mod ball;

use crate::devices::device::Device;
use cellwire_links::settings;
use cellwire_sim::TeachBall;

/// `cellwire simulate ball`.
pub const BALL: Device = Device {
    name: "ball",
    link: Some("ball"),
    about: "The ISRA Robot Command Teach Ball with a hand on it",
    settings: || settings::list(TeachBall::default()),
    simulate: ball::simulate,
};
