//! isra-ball: its row of the table, its codec and its configurations.

mod codec;
mod ends;
mod options;

use crate::link::Link;
use crate::settings;

/// The link.
pub const LINK: Link = Link {
    name: "isra-ball",
    about: "The ISRA Robot Command Teach Ball",
    sides: &["ball"],
    sender: |_is_client, _server_port| "ball",
    traces: &[("ball", [Some("ball"), None]), ("host-ball", [None, Some("ball")])],
    settings: || settings::list(()),
    codec: |_, settings| codec::ball(settings),
    ends: ends::ENDS,
};
