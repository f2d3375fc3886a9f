//! kawasaki-msg: its row of the table, its codec and its configurations.

mod codec;
mod ends;
pub mod layout;
mod options;
pub mod plant;
mod roles;

pub use options::CodecSettings;

use crate::link::Link;
use crate::settings;

/// The link.
pub const LINK: Link = Link {
    name: "kawasaki-msg",
    about: "A Kawasaki robot and a PC",
    sides: &["pc", "robot"],
    // The robot opens the connection.
    sender: |is_client, _server_port| if is_client { "robot" } else { "pc" },
    traces: &[("kawasaki-robot", [Some("robot"), Some("pc")]), ("kawasaki-pc", [Some("pc"), Some("robot")])],
    settings: || settings::list(options::CodecSettings::default()),
    codec: |_, settings| codec::either(settings),
    ends: ends::ENDS,
};
