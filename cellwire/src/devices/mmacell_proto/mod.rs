//! mmacell-proto in the tool: the simulated cell, and the central controller that runs the task in it.

pub mod simulate;

use crate::devices::device::Device;
use cellwire_links::settings;
use cellwire_sim::{MmaPlatform, MmaRobot};

/// `cellwire simulate mma-robot`.
pub const ROBOT: Device = Device {
    name: "mma-robot",
    link: None,
    about: "The robot of the MM&A cell",
    settings: || settings::list(MmaRobot::default()),
    simulate: simulate::robot,
};

/// `cellwire simulate mma-platform`.
pub const PLATFORM: Device = Device {
    name: "mma-platform",
    link: None,
    about: "The orientation platform of the MM&A cell",
    settings: || settings::list(MmaPlatform::default()),
    simulate: simulate::platform,
};
