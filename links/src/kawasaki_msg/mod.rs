//! kawasaki-msg: its row of the table, its codec and its configurations.

mod bytes;
mod codec;
mod ends;
pub mod layout;
mod open;
mod options;
mod parts;
pub mod plant;
mod roles;
mod rust;
mod shadow;

pub use options::{CodecSettings, pc_settings, robot_settings};

use ::kawasaki_msg::{Limits, PcConfig, RecoveryLimits, RobotConfig};

use crate::link::{Config, Link};
use crate::settings::{self, fields};

/// The link.
pub const LINK: Link = Link {
    name: "kawasaki-msg",
    short: "kawasaki",
    about: "A Kawasaki robot and a PC",
    sides: &["pc", "robot"],
    // The robot opens the connection.
    sender: |is_client, _server_port| Some(if is_client { "robot" } else { "pc" }),
    traces: &[("kawasaki-robot", [Some("robot"), Some("pc")]), ("kawasaki-pc", [Some("pc"), Some("robot")])],
    marks_begin: true,
    flow_control: None,
    configs: &[
        Config { name: "Limits", fields: |given| fields(Limits::TCP, given) },
        Config { name: "RecoveryLimits", fields: |given| fields(RecoveryLimits::default(), given) },
        Config { name: "RobotConfig", fields: |given| fields(RobotConfig::tcp(), given) },
        Config { name: "PcConfig", fields: |given| fields(PcConfig::tcp(), given) },
    ],
    settings: || settings::list(options::CodecSettings::default()),
    codec: |_, settings| codec::either(settings),
    tolerates: codec::tolerates,
    clauses: &[
        ("length", "KM-11"),
        ("no_length", "KM-12"),
        ("no_name", "KM-31"),
        ("no_end_mark", "KM-34"),
        ("mark", "KM-13"),
        ("incomplete", "KM-32"),
        ("not_ascii", "KM-16"),
        ("garbage", "KM-31"),
        ("too_long", "KM-14"),
    ],
    parts: parts::parts,
    #[cfg(feature = "captures")]
    open: open::OPEN,
    #[cfg(feature = "captures")]
    shadow: shadow::shadow,
    ends: ends::ENDS,
};
