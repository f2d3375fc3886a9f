//! mmacell-proto in the tool: the simulated cell, and the central controller that runs the task in it.

pub mod axes;
pub mod connections;
pub mod options;
pub mod simulate;
pub mod station;

use crate::links::device::Device;
use cellwire_links::settings;

/// `cellwire simulate mma-robot`.
pub const ROBOT: Device = Device {
    name: "mma-robot",
    about: "The robot of the MM&A cell",
    settings: || settings::list(options::DeviceSettings::default()),
    simulate: simulate::robot,
};

/// `cellwire simulate mma-platform`.
pub const PLATFORM: Device = Device {
    name: "mma-platform",
    about: "The orientation platform of the MM&A cell",
    settings: || settings::list(options::DeviceSettings::default()),
    simulate: simulate::platform,
};
