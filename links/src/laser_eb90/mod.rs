//! laser-eb90: its row of the table, its codec and its configurations.

mod codec;
mod ends;
mod open;
mod parts;
mod shadow;

use ::laser_eb90::{ControllerConfig, ErrorCodes, HostConfig, Profile};

use serde_json::json;

use crate::link::{Config, Link};
use crate::settings::{self, fields};

/// The link.
pub const LINK: Link = Link {
    name: "laser-eb90",
    short: "laser",
    about: "A laser machining robot, EB 90 frames",
    sides: &["host", "controller"],
    // Serial device servers listen: the robot is connected to one.
    sender: |is_client, _server_port| Some(if is_client { "host" } else { "controller" }),
    traces: &[
        ("laser", [Some("controller"), Some("host")]),
        ("laser-host", [Some("host"), Some("controller")]),
    ],
    marks_begin: true,
    flow_control: None,
    configs: &[
        Config { name: "Profile", fields: |given| fields(Profile::default(), given) },
        Config { name: "ErrorCodes", fields: |given| fields(ErrorCodes::default(), given) },
        Config { name: "HostConfig", fields: |given| fields(HostConfig::default(), given) },
        Config { name: "ControllerConfig", fields: |given| fields(ControllerConfig::default(), given) },
    ],
    settings: || settings::list(codec::Options::default()),
    codec: |_, settings| codec::either(settings),
    // Either tail; no items; a value that JSON cannot represent.
    tolerates: |it| match it.written {
        Some(_) => it.settings.get("tail").is_some_and(|tail| tail == "either"),
        None => it.message["items"] == json!([]) || it.message.to_string().contains("null"),
    },
    clauses: &[
        ("checksum", "LE-13"),
        ("flag", "LE-8"),
        ("tag", "LE-12"),
        ("item", "LE-15"),
        ("stuffing", "LE-9"),
        ("no_head", "LE-32"),
        ("incomplete", "LE-33"),
        ("too_long", "LE-14"),
    ],
    parts: parts::parts,
    #[cfg(feature = "captures")]
    open: open::OPEN,
    #[cfg(feature = "captures")]
    shadow: shadow::shadow,
    ends: ends::ENDS,
};
