//! mmacell-proto: its row of the table, its codec and its configurations.

mod codec;
mod ends;
mod open;
mod parts;
mod shadow;

use ::mmacell_proto::{CentralConfig, DeviceConfig, Dialect};

use crate::link::{Config, Link};
use crate::settings::{self, fields};

/// The link.
pub const LINK: Link = Link {
    name: "mmacell-proto",
    short: "mma",
    about: "The MM&A micro-manipulation cell",
    sides: &["central", "robot", "platform"],
    sender: |is_client, server_port| match server_port {
        _ if is_client => Some("central"),
        ::mmacell_proto::port::PLATFORM => Some("platform"),
        _ => Some("robot"),
    },
    traces: &[
        ("mma-robot", [Some("robot"), Some("central")]),
        ("mma-platform", [Some("platform"), Some("central")]),
    ],
    marks_begin: false,
    flow_control: None,
    configs: &[
        Config { name: "Dialect", fields: |given| fields(Dialect::STRICT, given) },
        Config { name: "CentralConfig", fields: |given| fields(CentralConfig::DEFAULT, given) },
        Config { name: "DeviceConfig", fields: |given| fields(DeviceConfig::DEFAULT, given) },
    ],
    settings: || settings::list(Dialect::STRICT),
    codec: codec::either,
    // The additions of a dialect have several forms, and a zero may have a minus.
    tolerates: |it| {
        let is_plus = |(read, written): (&u8, &u8)| read == written || (*read, *written) == (b'-', b'+');
        let same =
            |written: &[u8]| written.len() == it.bytes.len() && it.bytes.iter().zip(written).all(is_plus);
        it.written.is_some_and(|written| !it.settings.is_empty() || same(written))
    },
    clauses: &[
        ("unknown_command", "MM-13"),
        ("unexpected", "MM-25"),
        ("short", "MM-25"),
        ("trailing", "MM-25"),
        ("integer_range", "MM-12"),
        ("percent", "MM-13"),
        ("too_long", "MM-7"),
        ("incomplete", "MM-24"),
        ("error_zero", "MM-20"),
        ("unknown_reply", "MM-3"),
    ],
    parts: parts::parts,
    #[cfg(feature = "captures")]
    open: open::OPEN,
    #[cfg(feature = "captures")]
    shadow: shadow::shadow,
    ends: ends::ENDS,
};
