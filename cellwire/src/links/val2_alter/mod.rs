//! val2-alter in the tool: the simulated robot and its arm.

mod arm;
pub mod judge;
mod layout;
pub mod options;
mod pose;
pub mod puma;
mod robot_line;
pub mod script;

use crate::links::device::Device;
use cellwire_links::settings;

pub use arm::ArmConfig;
pub use layout::{Layout, Order};
pub use pose::Pose;

/// `cellwire simulate puma`.
pub const PUMA: Device = Device {
    name: "puma",
    about: "The PUMA 562 on its MARK III",
    settings: || settings::list(puma::PumaConfig::default()),
    simulate: puma::simulate,
};
