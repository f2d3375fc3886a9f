//! laser-eb90 in the tool: the simulated controller, and a sheet to cut.

pub mod controller;
pub mod options;

use crate::links::device::Device;
use cellwire_links::settings;

/// `cellwire simulate laser`.
pub const LASER: Device = Device {
    name: "laser",
    about: "The controller of a laser robot",
    settings: || settings::list(options::LaserSettings::default()),
    simulate: controller::simulate,
};
