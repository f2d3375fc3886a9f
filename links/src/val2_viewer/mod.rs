//! val2-viewer: its row of the table, its codec and its configurations.

mod codec;
mod ends;
mod options;

use crate::link::Link;
use crate::settings;

/// The link.
pub const LINK: Link = Link {
    name: "val2-viewer",
    about: "The graphics workstation that draws the robot of val2-alter",
    sides: &["host"],
    sender: |_is_client, _server_port| "host",
    traces: &[("viewer", [None, Some("host")]), ("host-viewer", [Some("host"), None])],
    settings: || settings::list(()),
    codec: |_, settings| codec::host(settings),
    ends: ends::ENDS,
};
