//! The properties of the framing that the source leaves open.

use val2_alter::Framing;

use crate::link::{DecidingMessage, OpenSettings};
use crate::settings;

pub(super) const OPEN: OpenSettings = OpenSettings {
    settings: &["leading_dle", "negated_sum", "stuffed_checksum", "ignore_spare_select"],
    beside: &[],
    guess: None,
    deciding: &[
        DecidingMessage {
            side: "robot",
            about: "a message whose checksum is neither 00h nor 80h",
            message: r#"{"kind":"start","mode":23,"data":[]}"#,
        },
        DecidingMessage {
            side: "robot",
            about: "a message whose checksum is 10h",
            message: r#"{"kind":"motion","phase":"running","error":0,"segment_status":2,"segment":110,"percent":32,"transform":null}"#,
        },
        DecidingMessage {
            side: "host",
            about: "a message whose checksum is 10h",
            message: r#"{"kind":"reply","exception":0,"values":[15,null,null,null,null,null]}"#,
        },
        DecidingMessage {
            side: "robot",
            about: "a message whose checksum is 10h",
            message: r#"{"kind":"motion","phase":"running","error":0,"segment_status":2,"segment":110,"percent":0,"transform":null}"#,
        },
        DecidingMessage {
            side: "host",
            about: "a message whose checksum is 10h",
            message: r#"{"kind":"reply","exception":0,"values":[239,null,null,null,null,null]}"#,
        },
    ],
    reads_more: &[("ignore_spare_select", "true", "a reply whose select byte has bit 6 or 7")],
    rust: |given, _| {
        let framing = settings::read("alter", Framing::DEFAULT, given)?;
        let framing = format!("{framing:?}").replace("leading_dle: ", "leading_dle: LeadingDle::");
        Ok(format!(
            "use val2_alter::{{Framing, LeadingDle}};\n\npub fn framing() -> Framing {{\n    {framing}\n}}"
        ))
    },
    ..OpenSettings::NOTHING
};
