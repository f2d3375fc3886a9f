//! val2-alter: its row of the table, its codec and its configurations.

mod codec;
mod ends;
mod open;
mod parts;
mod shadow;

use ::val2_alter::{ControllerConfig, Framing, HostConfig, Limits};

use crate::link::{Config, Link};
use crate::settings::{self, fields};

/// The link.
pub const LINK: Link = Link {
    name: "val2-alter",
    short: "alter",
    about: "VAL II ALTER on a Unimation MARK III",
    sides: &["robot", "host"],
    // Serial device servers listen: the robot is connected to one.
    sender: |is_client, _server_port| Some(if is_client { "host" } else { "robot" }),
    traces: &[("robot", [Some("robot"), Some("host")]), ("host-robot", [Some("host"), Some("robot")])],
    marks_begin: true,
    flow_control: None,
    configs: &[
        Config { name: "Framing", fields: |given| fields(Framing::DEFAULT, given) },
        Config { name: "Limits", fields: |given| fields(Limits::default(), given) },
        Config { name: "HostConfig", fields: |given| fields(HostConfig::default(), given) },
        Config { name: "ControllerConfig", fields: |given| fields(ControllerConfig::default(), given) },
    ],
    settings: || settings::list(Framing::DEFAULT),
    codec: codec::either,
    tolerates: codec::tolerates,
    clauses: &[
        ("reply_length", "AL-23"),
        ("start_mark", "AL-33"),
        ("checksum", "AL-7"),
        ("end_mark", "AL-28"),
        ("incomplete", "AL-36"),
        ("too_long", "AL-9"),
        ("length", "AL-29"),
        ("control", "AL-13"),
        ("start_reply", "AL-22"),
        ("select", "AL-23"),
    ],
    parts: parts::parts,
    #[cfg(feature = "captures")]
    open: open::OPEN,
    #[cfg(feature = "captures")]
    shadow: shadow::shadow,
    ends: ends::ENDS,
};
