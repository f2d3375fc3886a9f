//! What the source leaves open of the characters. The names of a plant's messages are its table, no setting of the bytes.

use super::options::CodecSettings;
use crate::link::{Deciding, Open};
use crate::settings;

pub(super) const OPEN: Open = Open {
    settings: &["charset"],
    beside: &[],
    guess: None,
    deciding: &[Deciding {
        side: "pc",
        about: "a name or field with a letter beyond ASCII",
        message: r#"{"name":"Määrä","fields":["1"]}"#,
    }],
    reads_more: &[],
    rust: |given, _| {
        let settings = settings::read("kawasaki", CodecSettings::default(), given)?;
        let charset = settings.plant.charset;
        Ok(format!(
            "use kawasaki_msg::Charset;\n\npub fn charset() -> Charset {{\n    Charset::{charset:?}\n}}"
        ))
    },
    ..Open::NOTHING
};
