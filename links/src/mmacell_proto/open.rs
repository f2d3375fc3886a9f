//! The properties of lines that the source leaves open.

use mmacell_proto::Dialect;

use crate::link::{Deciding, Open};
use crate::settings;

pub(super) const OPEN: Open = Open {
    settings: &["itr", "ovrd", "clos", "off", "lone_lf", "blank", "wide_integers"],
    beside: &[],
    guess: None,
    deciding: &[
        Deciding { side: "central", about: "a stop", message: r#"{"command":"STP"}"# },
        Deciding { side: "central", about: "an override", message: r#"{"command":"OVR","percent":50}"# },
        Deciding {
            side: "central",
            about: "a gripper that closes",
            message: r#"{"command":"HND","gripper":0,"open":false}"#,
        },
        Deciding {
            side: "central",
            about: "the servo motors switched off",
            message: r#"{"command":"SRV","on":false}"#,
        },
        Deciding {
            side: "robot",
            about: "an integer above 32767, such as an error number",
            message: r#"{"reply":"error","error":40000}"#,
        },
    ],
    reads_more: &[],
    rust: |given, _| {
        let dialect = settings::read("mma", Dialect::STRICT, given)?;
        Ok(format!("use mmacell_proto::Dialect;\n\npub fn dialect() -> Dialect {{\n    {dialect:?}\n}}"))
    },
    ..Open::NOTHING
};
