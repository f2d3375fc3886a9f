use anyhow::Result;
use mmacell_proto::{
    AnyPose, Command, DecodeError, Decoder, Dialect, Line, PlatformPose, Pose, Reply, RobotPose,
};
use robot_session::Encode as _;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};

use crate::codec::{Codec, EncodeError, Kind, Messages, bytes, codec, error, message, read};
use crate::settings;

/// Returns the codec of a side's messages.
///
/// # Errors
/// If a setting is not a field of `Dialect`.
pub(super) fn either(side: &str, settings: &Map<String, Value>) -> Result<Box<dyn Codec>> {
    let dialect = settings::read("mma", Dialect::STRICT, settings)?;
    let side = match side {
        "central" => Side {
            dialect,
            parse: parse_command,
            write: write_command,
            #[cfg(feature = "arbitrary")]
            make: |u| crate::codec::object(&u.arbitrary::<Command<AnyPose>>()?),
        },
        "robot" => Side {
            dialect,
            parse: parse_reply::<RobotPose>,
            write: write_reply::<RobotPose>,
            #[cfg(feature = "arbitrary")]
            make: |u| crate::codec::object(&u.arbitrary::<Reply<RobotPose>>()?),
        },
        _ => Side {
            dialect,
            parse: parse_reply::<PlatformPose>,
            write: write_reply::<PlatformPose>,
            #[cfg(feature = "arbitrary")]
            make: |u| crate::codec::object(&u.arbitrary::<Reply<PlatformPose>>()?),
        },
    };
    Ok(codec(Decoder::new(dialect), side))
}

/// The messages of one side: how they are parsed, written and made.
struct Side {
    dialect: Dialect,
    parse: fn(Line<'_>, &Dialect, &mut Vec<u8>) -> Kind,
    write: fn(Value, Dialect) -> Result<Vec<u8>, EncodeError>,
    #[cfg(feature = "arbitrary")]
    make: fn(&mut arbitrary::Unstructured<'_>) -> arbitrary::Result<Value>,
}

impl Messages for Side {
    type Decoder = Decoder;

    fn show(&self, line: Line<'_>, json: &mut Vec<u8>) -> Kind {
        (self.parse)(line, &self.dialect, json)
    }

    fn encode(&self, message: Value) -> Result<Vec<u8>, EncodeError> {
        (self.write)(message, self.dialect)
    }

    #[cfg(feature = "arbitrary")]
    fn arbitrary(&self, u: &mut arbitrary::Unstructured<'_>) -> arbitrary::Result<Value> {
        (self.make)(u)
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

fn write_command(message: Value, dialect: Dialect) -> Result<Vec<u8>, EncodeError> {
    let command = read::<Command<AnyPose>>(message)?.in_dialect(dialect);
    bytes(command.encoded_len(), |out| command.encode(out))
}

fn write_reply<P: Pose + DeserializeOwned>(message: Value, dialect: Dialect) -> Result<Vec<u8>, EncodeError> {
    let reply = read::<Reply<P>>(message)?.in_dialect(dialect);
    bytes(reply.encoded_len(), |out| reply.encode(out))
}
