//! val2-alter: its row of the table, its codec and its configurations.

mod codec;
mod ends;
mod open;

use ::val2_alter::{ControllerConfig, Framing, HostConfig, Limits};

use crate::link::{Config, Link};
use crate::settings::{self, fields};

/// The link.
pub const LINK: Link = Link {
    name: "val2-alter",
    about: "VAL II ALTER on a Unimation MARK III",
    sides: &["robot", "host"],
    // Serial device servers listen: the robot is connected to one.
    sender: |is_client, _server_port| if is_client { "host" } else { "robot" },
    traces: &[("robot", [Some("robot"), Some("host")]), ("host-robot", [Some("host"), Some("robot")])],
    marks_begin: true,
    configs: &[
        Config { name: "Framing", fields: |given| fields(Framing::DEFAULT, given) },
        Config { name: "Limits", fields: |given| fields(Limits::default(), given) },
        Config { name: "HostConfig", fields: |given| fields(HostConfig::default(), given) },
        Config { name: "ControllerConfig", fields: |given| fields(ControllerConfig::default(), given) },
    ],
    settings: || settings::list(Framing::DEFAULT),
    codec: codec::either,
    tolerates: codec::tolerates,
    open: open::OPEN,
    ends: ends::ENDS,
};
