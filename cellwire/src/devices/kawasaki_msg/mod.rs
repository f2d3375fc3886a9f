//! kawasaki-msg in the tool: both ends simulated, and a picture to draw.

mod control;
pub mod endpoint;
pub mod options;
pub mod peer_endpoint;
pub mod robot;
pub mod sheet;
pub mod simulate;

use crate::devices::device::Device;
use cellwire_links::settings;

/// `cellwire simulate kawasaki-robot`.
pub const ROBOT: Device = Device {
    name: "kawasaki-robot",
    link: None,
    about: "A Kawasaki robot that draws what a PC sends",
    settings: || settings::list(options::RobotSettings::default()),
    simulate: simulate::robot,
};

/// `cellwire simulate kawasaki-pc`.
pub const PC: Device = Device {
    name: "kawasaki-pc",
    link: None,
    about: "A PC with a picture for a Kawasaki robot",
    settings: || settings::list(options::PcSettings::default()),
    simulate: simulate::pc,
};
