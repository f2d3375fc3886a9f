//! toy-link: its row of the table, its codec and its ends.

mod codec;
mod ends;
mod parts;
mod shadow;

use ::toy_link::{DeviceConfig, HostConfig};

use crate::link::{Config, Link};
use crate::settings::{self, fields};

/// The link.
pub const LINK: Link = Link {
    name: "toy-link",
    short: "toy",
    about: "A link of lines",
    sides: &["host", "device"],
    sender: |is_client, _server_port| Some(if is_client { "host" } else { "device" }),
    traces: &[],
    marks_begin: false,
    flow_control: None,
    configs: &[
        Config { name: "HostConfig", fields: |given| fields(HostConfig::default(), given) },
        Config { name: "DeviceConfig", fields: |given| fields(DeviceConfig::default(), given) },
    ],
    settings: || settings::list(()),
    codec: codec::either,
    tolerates: |_| false,
    clauses: &[
        ("letter", "XX-1"),
        ("number", "XX-3"),
        ("separator", "XX-2"),
        ("too_long", "XX-4"),
        ("incomplete", "XX-4"),
    ],
    parts: parts::parts,
    #[cfg(feature = "captures")]
    open: crate::link::OpenSettings::NOTHING,
    #[cfg(feature = "captures")]
    shadow: shadow::shadow,
    ends: ends::ENDS,
};
