//! What the source leaves open of the frames and the telemetry block.

use super::options::{Frames, ViewSettings};
use crate::link::{Deciding, Open};
use crate::settings;

const BLOCK: &str =
    "a reply of the 37 registers of the telemetry block, of a robot that is not at its origin";

pub(super) const OPEN: Open = Open {
    settings: &["framing", "word_order"],
    beside: &[("view", "telemetry")],
    guess: None,
    deciding: &[
        Deciding {
            side: "server",
            about: BLOCK,
            message: r#"{"transaction":1,"unit":1,"function":3,"telemetry":{"life_counter":100000,"override":100,"position":[123.456,-50.0,300.25],"wpr":[180.0,0.0,45.0],"quaternion":[0.0,0.9238795,0.3826834,0.0],"velocity":[12.5,0.0,-3.75],"quaternion_rate":[0.0,0.01,-0.02,0.0]}}"#,
        },
        Deciding {
            side: "server",
            about: BLOCK,
            message: r#"{"unit":1,"function":3,"telemetry":{"life_counter":100000,"override":100,"position":[123.456,-50.0,300.25],"wpr":[180.0,0.0,45.0],"quaternion":[0.0,0.9238795,0.3826834,0.0],"velocity":[12.5,0.0,-3.75],"quaternion_rate":[0.0,0.01,-0.02,0.0]}}"#,
        },
    ],
    reads_more: &[],
    rust: |given| {
        let settings = settings::read("fanuc-hmi-modbus", ViewSettings::default(), given)?;
        let framing = match settings.frames {
            Frames::Tcp => "Framing::Tcp",
            Frames::Rtu => "Framing::RTU_OVER_TCP",
        };
        Ok(format!("({framing}, WordOrder::{:?})", settings.word_order))
    },
};
