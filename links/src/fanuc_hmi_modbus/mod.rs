//! fanuc-hmi-modbus: its row of the table, its codec and its configurations.

mod codec;
mod ends;
mod keys;
mod open;
mod options;
mod parts;
mod shadow;

pub use keys::unknown_key;
pub use options::{
    ClientSettings, Frames, ViewSettings, client_settings, client_settings_of, frames, word_order,
};

use ::fanuc_hmi_modbus::{ClientConfig, ServerConfig};

use crate::link::{Config, Link};
use crate::settings::{self, fields};

/// The link.
pub const LINK: Link = Link {
    name: "fanuc-hmi-modbus",
    short: "fanuc",
    about: "FANUC's HMI Device Communication, Modbus",
    sides: &["client", "server"],
    sender: |is_client, _server_port| Some(if is_client { "client" } else { "server" }),
    traces: &[("fanuc", [Some("server"), Some("client")])],
    marks_begin: true,
    flow_control: None,
    configs: &[
        Config { name: "ClientConfig", fields: |given| fields(ClientConfig::default(), given) },
        Config { name: "ServerConfig", fields: |given| fields(ServerConfig::default(), given) },
    ],
    settings: || settings::list(options::ViewSettings::default()),
    codec: codec::either,
    // The unused bits of a write of coils; a request that only a server may refuse.
    tolerates: |it| match it.written {
        Some(written) => it.message["function"] == 15 && written.len() == it.bytes.len(),
        None => true,
    },
    clauses: &[
        ("pdu_length", "FM-32"),
        ("byte_count", "FM-12"),
        ("quantity", "FM-32"),
        ("coil_value", "FM-11"),
        ("more_follows", "FM-97"),
        ("reference_type", "FM-32"),
        ("function", "FM-32"),
        ("reply_byte_count", "FM-13"),
        ("mbap_length", "FM-28"),
        ("exception_length", "FM-89"),
        ("protocol", "FM-28"),
        ("crc", "FM-9"),
        ("too_long", "FM-6"),
        ("cut", "FM-27"),
        ("noise", "FM-27"),
    ],
    parts: parts::parts,
    #[cfg(feature = "captures")]
    open: open::OPEN,
    #[cfg(feature = "captures")]
    shadow: shadow::shadow,
    ends: ends::ENDS,
};
