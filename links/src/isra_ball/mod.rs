//! isra-ball: its row of the table, its codec and its configurations.

mod codec;
mod ends;

mod parts;
mod shadow;

use ::isra_ball::{BallConfig, HostConfig};

use crate::link::{Config, Link};
use crate::settings::{self, fields};

/// The link.
pub const LINK: Link = Link {
    name: "isra-ball",
    short: "ball",
    about: "The ISRA Robot Command Teach Ball",
    sides: &["ball"],
    // The host polls.
    sender: |is_client, _server_port| if is_client { None } else { Some("ball") },
    traces: &[("ball", [Some("ball"), None]), ("host-ball", [None, Some("ball")])],
    marks_begin: true,
    flow_control: None,
    configs: &[
        Config { name: "HostConfig", fields: |given| fields(HostConfig::default(), given) },
        Config { name: "BallConfig", fields: |given| fields(BallConfig::default(), given) },
    ],
    settings: || settings::list(()),
    codec: |_, settings| codec::ball(settings),
    // Two reserved states of the values have one name; only one layout of the data is known.
    tolerates: |it| match it.written {
        Some(written) => it.message["status"] == "reserved" && it.bytes.len() == written.len(),
        None => it.message.get("data").is_some(),
    },
    clauses: &[("checksum", "IB-6"), ("incomplete", "IB-17"), ("noise", "IB-15")],
    parts: parts::parts,
    #[cfg(feature = "captures")]
    open: crate::link::OpenSettings::NOTHING,
    #[cfg(feature = "captures")]
    shadow: shadow::shadow,
    ends: ends::ENDS,
};
