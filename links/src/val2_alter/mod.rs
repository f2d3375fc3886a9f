//! val2-alter: its row of the table, its codec and its configurations.

mod codec;
mod ends;
mod options;

pub use options::mode;

use crate::link::Link;
use crate::settings;

/// The link.
pub const LINK: Link = Link {
    name: "val2-alter",
    about: "VAL II ALTER on a Unimation MARK III",
    sides: &["robot", "host"],
    // Serial device servers listen: the robot is connected to one.
    sender: |is_client, _server_port| if is_client { "host" } else { "robot" },
    traces: &[("robot", [Some("robot"), Some("host")]), ("host-robot", [Some("host"), Some("robot")])],
    settings: || settings::list(val2_alter::Framing::DEFAULT),
    codec: codec::either,
    ends: ends::ENDS,
};
