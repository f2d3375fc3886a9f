//! fanuc-hmi-modbus: its row of the table, its codec and its configurations.

mod codec;
mod ends;
mod options;

pub use options::{Frames, ViewSettings, client_settings, frames, word_order};

use crate::link::Link;
use crate::settings;

/// The link.
pub const LINK: Link = Link {
    name: "fanuc-hmi-modbus",
    about: "FANUC's HMI Device Communication, Modbus",
    sides: &["client", "server"],
    sender: |is_client, _server_port| if is_client { "client" } else { "server" },
    traces: &[("fanuc", [Some("server"), Some("client")])],
    settings: || settings::list(options::ViewSettings::default()),
    codec: codec::either,
    ends: ends::ENDS,
};
