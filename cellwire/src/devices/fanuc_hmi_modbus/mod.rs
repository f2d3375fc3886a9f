//! fanuc-hmi-modbus in the tool: the simulated controller, and a client for scripts.

pub mod client;
mod control;
pub mod inputs;
pub mod mapping;
pub mod options;
pub mod program;
pub mod robot;
mod signal;
pub mod simulate;

use crate::devices::device::Device;
use cellwire_links::settings;

/// `cellwire simulate fanuc`.
pub const FANUC: Device = Device {
    name: "fanuc",
    link: Some("fanuc"),
    about: "A FANUC controller with a moving robot, over Modbus: telemetry in holding registers 0 to 36, and R[n], which holds n",
    settings: || settings::list(options::FanucSettings::default()),
    simulate: simulate::simulate,
};
