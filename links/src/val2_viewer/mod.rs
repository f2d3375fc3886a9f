//! val2-viewer: its row of the table, its codec and its configurations.

mod codec;
mod ends;

mod parts;
mod shadow;

use ::val2_viewer::{HostConfig, WorkstationConfig};

use crate::link::{Config, Link};
use crate::settings::{self, fields};

/// The link.
pub const LINK: Link = Link {
    name: "val2-viewer",
    short: "viewer",
    about: "The graphics workstation that draws the robot of val2-alter",
    sides: &["host"],
    // The workstation polls.
    sender: |is_client, _server_port| if is_client { Some("host") } else { None },
    traces: &[("viewer", [None, Some("host")]), ("host-viewer", [Some("host"), None])],
    marks_begin: true,
    flow_control: Some([::val2_viewer::XON, ::val2_viewer::XOFF]),
    configs: &[
        Config { name: "HostConfig", fields: |given| fields(HostConfig::default(), given) },
        Config { name: "WorkstationConfig", fields: |given| fields(WorkstationConfig::default(), given) },
    ],
    settings: || settings::list(()),
    codec: |_, settings| codec::host(settings),
    tolerates: |_| false,
    clauses: &[
        ("checksum", "VV-12"),
        ("format", "VV-12"),
        ("number", "VV-12"),
        ("too_long", "VV-14"),
        ("incomplete", "VV-15"),
        ("noise", "VV-14"),
    ],
    parts: parts::parts,
    #[cfg(feature = "captures")]
    open: crate::link::OpenSettings::NOTHING,
    #[cfg(feature = "captures")]
    shadow: shadow::shadow,
    ends: ends::ENDS,
};
