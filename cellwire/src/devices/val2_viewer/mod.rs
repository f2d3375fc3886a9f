//! val2-viewer in the tool: and the simulated graphics workstation.

pub mod workstation;

use crate::devices::device::Device;
use cellwire_links::settings;
use cellwire_sim::Viewer;

/// `cellwire simulate viewer`.
pub const VIEWER: Device = Device {
    name: "viewer",
    link: Some("viewer"),
    about: "The graphics workstation that draws the PUMA",
    settings: || settings::list(Viewer::default()),
    simulate: workstation::simulate,
};
