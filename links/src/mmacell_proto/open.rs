//! The properties of lines that the source leaves open.

use mmacell_proto::Dialect;

use crate::link::{DecidingMessage, OpenSettings};
use crate::settings;

pub(super) const OPEN: OpenSettings = OpenSettings {
    settings: &["itr", "ovrd", "clos", "off", "lone_lf", "blank", "wide_integers"],
    beside: &[],
    guess: None,
    deciding: &[
        DecidingMessage { side: "central", about: "a stop", message: r#"{"command":"STP"}"# },
        DecidingMessage {
            side: "central",
            about: "an override",
            message: r#"{"command":"OVR","percent":50}"#,
        },
        DecidingMessage {
            side: "central",
            about: "a gripper that closes",
            message: r#"{"command":"HND","gripper":0,"open":false}"#,
        },
        DecidingMessage {
            side: "central",
            about: "the servo motors switched off",
            message: r#"{"command":"SRV","on":false}"#,
        },
        DecidingMessage {
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
    ..OpenSettings::NOTHING
};
