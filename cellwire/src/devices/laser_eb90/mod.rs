//! laser-eb90 in the tool: the simulated controller, and a sheet to cut.

pub mod controller;

use crate::devices::device::Device;
use cellwire_links::settings;

/// `cellwire simulate laser`.
pub const LASER: Device = Device {
    name: "laser",
    link: Some("laser"),
    about: "The controller of a laser robot",
    settings: || settings::list(controller::LaserSettings::default()),
    simulate: controller::simulate,
};
