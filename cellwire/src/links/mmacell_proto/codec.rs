use anyhow::{Context, Result};
use mmacell_proto::robot_session::Decoder as _;
use mmacell_proto::{
    AnyPose, Command, DecodeError, Decoder, Dialect, Line, PlatformPose, Pose, Reply, RobotPose,
};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};

use crate::links::codec::Codec;
use crate::links::settings::Settings;

/// The names of the settings: the fields of the crate's `Dialect`, each true or false.
pub(super) const DIALECT: [&str; 7] = ["itr", "ovrd", "clos", "off", "lone_lf", "blank", "wide_integers"];

/// What a side sends.
///
/// # Errors
/// When a setting is no field of `Dialect`.
pub(super) fn codec(side: &str, settings: &Map<String, Value>) -> Result<Box<dyn Codec>> {
    Settings::new("mmacell-proto", settings, &DIALECT)?;
    let dialect = dialect(settings)?;
    let side = match side {
        "central" => Side { parse: parse_command, write: write_command },
        "robot" => Side { parse: parse_reply::<RobotPose>, write: write_reply::<RobotPose> },
        _ => Side { parse: parse_reply::<PlatformPose>, write: write_reply::<PlatformPose> },
    };
    Ok(Box::new(Lines { decoder: Decoder::new(dialect), dialect, side }))
}

/// The dialect among some settings.
pub(super) fn dialect(settings: &serde_json::Map<String, Value>) -> Result<Dialect> {
    let known = settings.iter().filter(|(name, _)| DIALECT.contains(&name.as_str()));
    let known = known.map(|(name, value)| (name.clone(), value.clone())).collect();
    serde_json::from_value(Value::Object(known)).context("each of these settings is true or false")
}

struct Lines {
    decoder: Decoder,
    dialect: Dialect,
    side: Side,
}

struct Side {
    parse: fn(Line<'_>, &Dialect) -> Result<Value, DecodeError>,
    write: fn(Value, Dialect) -> Result<Vec<u8>>,
}

impl Codec for Lines {
    fn push(&mut self, bytes: &[u8]) -> usize {
        self.decoder.push(bytes)
    }

    fn next(&mut self) -> Option<Result<Value, Value>> {
        let line = self.decoder.next_frame()?;
        Some(line.and_then(|line| (self.side.parse)(line, &self.dialect)).map_err(json))
    }

    fn finish(&mut self) {
        self.decoder.finish();
    }

    fn position(&self) -> u64 {
        self.decoder.position()
    }

    fn encode(&self, message: Value) -> Result<Vec<u8>> {
        (self.side.write)(message, self.dialect)
    }
}

fn parse_command(line: Line<'_>, dialect: &Dialect) -> Result<Value, DecodeError> {
    Command::<AnyPose>::decode(line, dialect).map(json)
}

fn parse_reply<P: Pose + Serialize>(line: Line<'_>, dialect: &Dialect) -> Result<Value, DecodeError> {
    Reply::<P>::decode(line, dialect).map(json)
}

fn write_command(message: Value, dialect: Dialect) -> Result<Vec<u8>> {
    let command: Command<AnyPose> = serde_json::from_value(message)?;
    let mut bytes = Vec::new();
    command.in_dialect(dialect).append_to(&mut bytes)?;
    Ok(bytes)
}

fn write_reply<P: Pose + DeserializeOwned>(message: Value, dialect: Dialect) -> Result<Vec<u8>> {
    let reply: Reply<P> = serde_json::from_value(message)?;
    let mut bytes = Vec::new();
    reply.in_dialect(dialect).append_to(&mut bytes)?;
    Ok(bytes)
}

/// A value that is only ever made of numbers and names.
fn json(value: impl Serialize) -> Value {
    serde_json::to_value(value).unwrap_or_default()
}
