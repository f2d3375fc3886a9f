use anyhow::Result;
use mmacell_proto::{
    AnyPose, Command, DecodeError, Decoder, Dialect, Line, PlatformPose, Pose, Reply, RobotPose,
};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};

use crate::codec::{Codec, Kind, Messages, codec, error, message};
use crate::settings;

/// What a side sends.
///
/// # Errors
/// When a setting is no field of `Dialect`.
pub(super) fn either(side: &str, settings: &Map<String, Value>) -> Result<Box<dyn Codec>> {
    let dialect = settings::read("mmacell-proto", Dialect::STRICT, settings)?;
    let side = match side {
        "central" => Side { dialect, parse: parse_command, write: write_command },
        "robot" => Side { dialect, parse: parse_reply::<RobotPose>, write: write_reply::<RobotPose> },
        _ => Side { dialect, parse: parse_reply::<PlatformPose>, write: write_reply::<PlatformPose> },
    };
    Ok(codec(Decoder::new(dialect), side))
}

/// What one side sends: `parse` and `write` are of its messages.
struct Side {
    dialect: Dialect,
    parse: fn(Line<'_>, &Dialect, &mut Vec<u8>) -> Kind,
    write: fn(Value, Dialect) -> Result<Vec<u8>>,
}

impl Messages for Side {
    type Decoder = Decoder;

    fn show(&self, line: Line<'_>, json: &mut Vec<u8>) -> Kind {
        (self.parse)(line, &self.dialect, json)
    }

    fn encode(&self, message: Value) -> Result<Vec<u8>> {
        (self.write)(message, self.dialect)
    }
}

fn parse_command(line: Line<'_>, dialect: &Dialect, json: &mut Vec<u8>) -> Kind {
    show(Command::<AnyPose>::decode(line, dialect), json)
}

fn parse_reply<P: Pose + Serialize>(line: Line<'_>, dialect: &Dialect, json: &mut Vec<u8>) -> Kind {
    show(Reply::<P>::decode(line, dialect), json)
}

fn show<M: Serialize>(decoded: Result<M, DecodeError>, json: &mut Vec<u8>) -> Kind {
    match decoded {
        Ok(found) => message(&found, json),
        Err(found) => error(&found, json),
    }
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
