//! val2-viewer in the tool: and the simulated graphics workstation.

pub mod options;
pub mod workstation;

use crate::links::device::Device;
use cellwire_links::settings;

/// `cellwire simulate viewer`.
pub const VIEWER: Device = Device {
    name: "viewer",
    about: "The graphics workstation that draws the PUMA",
    settings: || settings::list(options::ViewerSettings::default()),
    simulate: workstation::simulate,
};
