//! mmacell-proto: its row of the table, its codec and its configurations.

mod codec;
mod ends;
mod options;

use crate::link::Link;
use crate::settings;

/// The link.
pub const LINK: Link = Link {
    name: "mmacell-proto",
    about: "The MM&A micro-manipulation cell",
    sides: &["central", "robot", "platform"],
    sender: |is_client, server_port| match server_port {
        _ if is_client => "central",
        ::mmacell_proto::port::PLATFORM => "platform",
        _ => "robot",
    },
    traces: &[
        ("mma-robot", [Some("robot"), Some("central")]),
        ("mma-platform", [Some("platform"), Some("central")]),
    ],
    settings: || settings::list(mmacell_proto::Dialect::STRICT),
    codec: codec::either,
    ends: ends::ENDS,
};
