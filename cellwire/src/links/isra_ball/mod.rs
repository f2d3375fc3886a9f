//! isra-ball in the tool: the simulated ball and the hand on it.

pub mod ball;
pub mod hand;
pub mod options;

use crate::links::device::Device;
use cellwire_links::settings;

/// `cellwire simulate ball`.
pub const BALL: Device = Device {
    name: "ball",
    about: "The ISRA Robot Command Teach Ball with a hand on it",
    settings: || settings::list(options::BallSettings::default()),
    simulate: ball::simulate,
};
