//! val2-alter in the tool: the simulated robot, and the measure of its host.

mod control;
pub mod judge;
pub mod options;
pub mod puma;
mod robot_line;
pub mod script;

use crate::devices::device::Device;
use cellwire_links::settings;

/// `cellwire simulate puma`.
pub const PUMA: Device = Device {
    name: "puma",
    link: Some("alter"),
    about: "The PUMA 562 on its MARK III",
    settings: || settings::list(puma::PumaConfig::default()),
    simulate: puma::simulate,
};
