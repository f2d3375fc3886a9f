//! laser-eb90: its row of the table, its codec and its configurations.

mod codec;
mod ends;
mod options;

use crate::link::Link;
use crate::settings;

/// The link.
pub const LINK: Link = Link {
    name: "laser-eb90",
    about: "A laser machining robot, EB 90 frames",
    sides: &["host", "controller"],
    // Serial device servers listen: the robot is connected to one.
    sender: |is_client, _server_port| if is_client { "host" } else { "controller" },
    traces: &[
        ("laser", [Some("controller"), Some("host")]),
        ("laser-host", [Some("host"), Some("controller")]),
    ],
    settings: || settings::list(laser_eb90::Profile::default()),
    codec: |_, settings| codec::either(settings),
    ends: ends::ENDS,
};
