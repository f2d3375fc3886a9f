//! The properties of frames and telemetry block that the source leaves open.

use serde_json::Value;

use super::options::{Frames, ViewSettings};
use crate::link::{Carrier, DecidingMessage, OpenSettings, ShownSetting};
use crate::settings;

const BLOCK: &str = "a reply of the 37 registers of the telemetry block, of a robot that is not at its origin, or several while its counter counts";

pub(super) const OPEN: OpenSettings = OpenSettings {
    settings: &["framing", "word_order"],
    beside: &[("view", "telemetry")],
    places,
    place_names: &["unit", "address"],
    guess: None,
    deciding: &[
        DecidingMessage {
            side: "server",
            about: BLOCK,
            message: r#"{"transaction":1,"unit":1,"function":3,"telemetry":{"life_counter":100000,"override":100,"position":[123.456,-50.0,300.25],"wpr":[180.0,0.0,45.0],"quaternion":[0.0,0.9238795,0.3826834,0.0],"velocity":[12.5,0.0,-3.75],"quaternion_rate":[0.0,0.01,-0.02,0.0]}}"#,
        },
        DecidingMessage {
            side: "server",
            about: BLOCK,
            message: r#"{"unit":1,"function":3,"telemetry":{"life_counter":100000,"override":100,"position":[123.456,-50.0,300.25],"wpr":[180.0,0.0,45.0],"quaternion":[0.0,0.9238795,0.3826834,0.0],"velocity":[12.5,0.0,-3.75],"quaternion_rate":[0.0,0.01,-0.02,0.0]}}"#,
        },
    ],
    reads_more: &[],
    rust: |given, carrier| {
        let settings = settings::read("fanuc", ViewSettings::default(), given)?;
        let rtu = |baud: u32| format!("Framing::Rtu {{ silence: timing::silence({baud}) }}");
        let framing = match (settings.frames, carrier) {
            (Frames::Tcp, _) => "Framing::Tcp".into(),
            (Frames::Rtu, Carrier::Serial(Some(baud))) => rtu(baud),
            (Frames::Rtu, Carrier::Serial(None)) => format!("{} /* the line's rate */", rtu(19_200)),
            (Frames::Rtu, Carrier::Network) => "Framing::RTU_OVER_TCP".into(),
            (Frames::Rtu, Carrier::Unknown) => {
                format!("Framing::RTU_OVER_TCP /* on a serial line {} */", rtu(19_200))
            }
        };
        let timing = if framing.starts_with("Framing::Rtu {") { ", timing" } else { "" };
        let order = settings.word_order;
        Ok(format!(
            "use fanuc_hmi_modbus::{{Framing, WordOrder{timing}}};\n\npub fn framing() -> (Framing, WordOrder) {{\n    ({framing}, WordOrder::{order:?})\n}}"
        ))
    },
    sense: |before, message| {
        let counter =
            |message: &Value| u32::try_from(message.pointer("/telemetry/life_counter")?.as_u64()?).ok();
        match (counter(before), counter(message)) {
            // A robot that is off counts no more.
            (Some(before), Some(now)) if before != now && now.wrapping_sub(before) < MAX_GROWTH => COUNTS,
            (Some(before), Some(now)) if before != now => -COUNTS,
            _ => 0.0,
        }
    },
    notes,
};

/// Between two polls a life counter grows by less.
const MAX_GROWTH: u32 = 10_000;
/// Words in the wrong order count up so once in 2 to the power of twice this.
const COUNTS: f64 = 4.0;
/// The registers of the block.
const BLOCK_SIZE: u64 = 37;

/// Returns the values of a number in the requests for which `passes` is true, each once.
fn numbers(messages: &[(&'static str, Value)], name: &str, passes: impl Fn(&Value) -> bool) -> Vec<u64> {
    let mut found: Vec<u64> = Vec::new();
    for (_, message) in messages.iter().filter(|(side, message)| *side == "client" && passes(message)) {
        found.extend(message.get(name).and_then(Value::as_u64).filter(|value| !found.contains(value)));
    }
    found
}

/// Returns whether a request reads the telemetry block.
fn reads_block(request: &Value) -> bool {
    let number = |name| request.get(name).and_then(Value::as_u64);
    number("function") == Some(3) && number("quantity") == Some(BLOCK_SIZE)
}

/// Returns the unit that the client requests, and the address of the block, if there is only one.
fn places(messages: &[(&'static str, Value)]) -> Vec<ShownSetting> {
    let units = numbers(messages, "unit", |_| true);
    let addresses = numbers(messages, "address", reads_block);
    let only = |found: &[u64], name, why| match *found {
        [value] => Some((name, value, why)),
        _ => None,
    };
    let unit = only(&units, "unit", "every request is to this unit");
    unit.into_iter().chain(only(&addresses, "address", "the telemetry block is read there")).collect()
}

/// Returns notes about the address at which the block is read.
fn notes(messages: &[(&'static str, Value)]) -> Vec<String> {
    let found = numbers(messages, "address", reads_block);
    let read = |at: u64| {
        let why = match at {
            0 => "addresses count from 0, registers of $SNPX_ASG from 1",
            1 => {
                "either the block is assigned from register 2 on, or the client takes the number of a register for its address"
            }
            _ => "the register of $SNPX_ASG is one more",
        };
        format!("the block is read at address {at}: {why}")
    };
    found.into_iter().map(read).collect()
}
