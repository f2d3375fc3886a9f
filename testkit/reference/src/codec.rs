//! Every link's codec behind one trait: bytes in, JSON out, and back.

use anyhow::{Result, bail, ensure};
use robot_session::Encode as _;
use serde::Serialize;
use serde::de::{DeserializeOwned, DeserializeSeed as _};
use serde_json::{Map, Value};

use crate::json;

/// What a decoder makes of a stretch of bytes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Item {
    pub(crate) offset: u64,
    pub(crate) length: u64,
    /// The object of a message, or of an error, as JSON.
    pub(crate) content: Result<String, String>,
    /// It is given only because the stream ends.
    pub(crate) at_end: bool,
}

/// One side's codec.
pub(crate) trait Codec {
    fn push(&mut self, bytes: &[u8]) -> usize;
    fn finish(&mut self);
    /// The next item's content and where it ends.
    fn next(&mut self) -> Option<(Result<String, String>, u64)>;
    /// The bytes of a message object, or the object of an encoder's error.
    fn encode(&self, message: Value) -> Result<Result<Vec<u8>, String>>;
}

type Shown = Result<String, String>;

struct Of<D, S, E> {
    decoder: D,
    show: S,
    encode: E,
}

impl<D, S, E> Codec for Of<D, S, E>
where
    D: robot_session::Decoder<Error: Serialize>,
    S: for<'a> Fn(D::Frame<'a>) -> Shown,
    E: Fn(Value) -> Result<Result<Vec<u8>, String>>,
{
    fn push(&mut self, bytes: &[u8]) -> usize {
        self.decoder.push(bytes)
    }

    fn finish(&mut self) {
        self.decoder.finish();
    }

    fn next(&mut self) -> Option<(Shown, u64)> {
        let content = match self.decoder.next_frame()? {
            Ok(frame) => (self.show)(frame),
            Err(error) => Err(show(&error)),
        };
        Some((content, self.decoder.position()))
    }

    fn encode(&self, message: Value) -> Result<Result<Vec<u8>, String>> {
        (self.encode)(message)
    }
}

fn boxed<D, S, E>(decoder: D, show: S, encode: E) -> Box<dyn Codec>
where
    D: robot_session::Decoder<Error: Serialize> + 'static,
    S: for<'a> Fn(D::Frame<'a>) -> Shown + 'static,
    E: Fn(Value) -> Result<Result<Vec<u8>, String>> + 'static,
{
    Box::new(Of { decoder, show, encode })
}

fn show(value: &impl Serialize) -> String {
    json::text(value).unwrap_or_else(|error| format!("\"{error}\""))
}

/// An object that is no message of the link.
fn no_message<T>() -> Result<Result<T, String>> {
    Ok(Err("{\"kind\": \"message\"}".into()))
}

/// The codec of what `from` sends.
pub(crate) fn codec(link: &str, from: Option<&str>, options: &Map<String, Value>) -> Result<Box<dyn Codec>> {
    let settings = Value::Object(options.clone());
    Ok(match (link, from) {
        ("val2-alter", Some("robot")) => alter::<val2_alter::RobotMessage>(serde_json::from_value(settings)?),
        ("val2-alter", Some("host")) => alter::<val2_alter::HostMessage>(serde_json::from_value(settings)?),
        ("val2-viewer", _) => boxed(
            val2_viewer::Decoder::new(),
            |packet| Ok(show(&packet)),
            |message| {
                let Ok(packet) = serde_json::from_value::<val2_viewer::PosePacket>(message) else {
                    return no_message();
                };
                let mut bytes = vec![0; packet.encoded_len()];
                Ok(packet.encode(&mut bytes).map(|_| bytes).map_err(|error| show(&error)))
            },
        ),
        ("isra-ball", _) => boxed(
            isra_ball::Decoder::new(),
            |frame| Ok(show(&frame)),
            |message| {
                let Ok(packet) = serde_json::from_value::<isra_ball::Packet>(message) else {
                    return no_message();
                };
                Ok(packet.to_bytes().map(|bytes| bytes.to_vec()).map_err(|error| show(&error)))
            },
        ),
        ("laser-eb90", _) => laser(serde_json::from_value(settings)?),
        ("mmacell-proto", Some(from)) => mma(from, serde_json::from_value(settings)?)?,
        ("kawasaki-msg", _) => kawasaki(options)?,
        ("fanuc-hmi-modbus", Some(from)) => modbus(from, options)?,
        _ => bail!("{link} has no side {from:?}"),
    })
}

fn alter<M>(framing: val2_alter::Framing) -> Box<dyn Codec>
where
    M: val2_alter::Message + Serialize + DeserializeOwned + 'static,
{
    boxed(
        val2_alter::Decoder::<M>::new(framing),
        |received| Ok(show(&received.message)),
        move |message| {
            let Ok(message) = serde_json::from_value::<M>(message) else { return no_message() };
            let mut frame = vec![0; val2_alter::Frame::MAX_LEN];
            Ok(match message.encode(framing, &mut frame) {
                Ok(length) => {
                    frame.truncate(length);
                    Ok(frame)
                }
                Err(error) => Err(show(&error)),
            })
        },
    )
}

fn laser(profile: laser_eb90::Profile) -> Box<dyn Codec> {
    boxed(
        laser_eb90::Decoder::new(&profile),
        |frame| Ok(show(&frame)),
        move |message| {
            let mut buffer = [0; laser_eb90::MAX_PAYLOAD];
            let mut payload = laser_eb90::Payload::new(&mut buffer, &profile);
            if payload.deserialize(message).is_err() {
                return no_message();
            }
            let frame = match payload.frame() {
                Ok(frame) => frame,
                Err(error) => return Ok(Err(show(&error))),
            };
            let mut bytes = vec![0; frame.encoded_len()];
            Ok(frame.encode(&mut bytes).map(|_| bytes).map_err(|error| show(&error)))
        },
    )
}

fn mma(from: &str, dialect: mmacell_proto::Dialect) -> Result<Box<dyn Codec>> {
    use mmacell_proto::{AnyPose, Command, Decoder, PlatformPose, Pose, Reply, RobotPose};
    fn written(message: &impl robot_session::Encode<Error: Serialize>) -> Result<Result<Vec<u8>, String>> {
        let mut bytes = vec![0; message.encoded_len()];
        Ok(message.encode(&mut bytes).map(|_| bytes).map_err(|error| show(&error)))
    }
    fn replies<P: Pose + Serialize + DeserializeOwned + 'static>(
        dialect: mmacell_proto::Dialect,
    ) -> Box<dyn Codec> {
        boxed(
            Decoder::new(dialect),
            move |line| match Reply::<P>::decode(line, &dialect) {
                Ok(reply) => Ok(show(&reply)),
                Err(error) => Err(show(&error)),
            },
            move |message| match serde_json::from_value::<Reply<P>>(message) {
                Ok(reply) => written(&reply.in_dialect(dialect)),
                Err(_) => no_message(),
            },
        )
    }
    Ok(match from {
        "central" => boxed(
            Decoder::new(dialect),
            move |line| match Command::<AnyPose>::decode(line, &dialect) {
                Ok(command) => Ok(show(&command)),
                Err(error) => Err(show(&error)),
            },
            move |message| match serde_json::from_value::<Command<AnyPose>>(message) {
                Ok(command) => written(&command.in_dialect(dialect)),
                Err(_) => no_message(),
            },
        ),
        "robot" => replies::<RobotPose>(dialect),
        "platform" => replies::<PlatformPose>(dialect),
        _ => bail!("mmacell-proto has no side {from}"),
    })
}

fn kawasaki(options: &Map<String, Value>) -> Result<Box<dyn Codec>> {
    use kawasaki_msg::{Charset, Decoder, Message, Value as Field, Values};

    #[derive(serde::Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Object {
        name: String,
        #[serde(default)]
        header: Vec<String>,
        fields: Vec<String>,
    }

    let charset: Charset = match options.get("charset") {
        Some(charset) => serde_json::from_value(charset.clone())?,
        None => Charset::Ascii,
    };
    ensure!(options.keys().all(|key| key == "charset"), "kawasaki-msg has no such option: {options:?}");
    Ok(boxed(
        Decoder::new(charset),
        |message| Ok(show(&message)),
        move |message| {
            let Ok(object) = serde_json::from_value::<Object>(message) else { return no_message() };
            let header: Vec<_> = object.header.iter().map(|text| Field::Text(text)).collect();
            let fields: Vec<_> = object.fields.iter().map(|text| Field::Text(text)).collect();
            let message = Message {
                name: Field::Text(&object.name),
                header: Values::List(&header),
                fields: Values::List(&fields),
            };
            let mut wire = vec![0; message.encoded_len()];
            Ok(message.encode(charset, &mut wire).map(|_| wire).map_err(|error| show(&error)))
        },
    ))
}

fn modbus(from: &str, options: &Map<String, Value>) -> Result<Box<dyn Codec>> {
    use fanuc_hmi_modbus::{Decoder, Frame, Framing, PduBuf, Side};
    let framing = match options.get("framing").and_then(Value::as_str) {
        None | Some("tcp") => Framing::Tcp,
        Some("rtu") => Framing::Rtu { silence: core::time::Duration::from_micros(1750) },
        Some(other) => bail!("no framing {other}"),
    };
    let side = if from == "client" { Side::Client } else { Side::Server };
    Ok(boxed(
        Decoder::new(framing, side),
        move |frame: Frame<&[u8]>| {
            if side == Side::Client {
                return frame.request().map(|request| show(&request)).map_err(|error| show(&error));
            }
            frame.reply().map(|reply| show(&reply)).map_err(|error| show(&error))
        },
        move |message| {
            let Ok(frame) = serde_json::from_value::<Frame<PduBuf>>(message) else { return no_message() };
            if frame.transaction.is_some() != (framing == Framing::Tcp) {
                return no_message();
            }
            let mut bytes = vec![0; frame.encoded_len()];
            Ok(frame.encode(&mut bytes).map(|_| bytes).map_err(|error| show(&error)))
        },
    ))
}

/// Everything that a stream gives; after each part comes an end.
pub(crate) fn read(codec: &mut dyn Codec, parts: &[Vec<Vec<u8>>]) -> Result<Vec<Item>> {
    let (mut items, mut position) = (Vec::new(), 0);
    let mut drain = |codec: &mut dyn Codec, items: &mut Vec<Item>, at_end| {
        while let Some((content, end)) = codec.next() {
            items.push(Item { offset: position, length: end - position, content, at_end });
            position = end;
        }
    };
    for pieces in parts {
        for piece in pieces {
            let mut rest = piece.as_slice();
            while !rest.is_empty() {
                let taken = codec.push(rest);
                rest = rest.get(taken..).unwrap_or_default();
                let before = items.len();
                drain(codec, &mut items, false);
                ensure!(taken > 0 || items.len() > before, "the decoder neither takes nor gives anything");
            }
        }
        codec.finish();
        drain(codec, &mut items, true);
    }
    let total: usize = parts.iter().flatten().map(Vec::len).sum();
    ensure!(position == total as u64, "the items cover {position} of {total} bytes");
    Ok(items)
}

/// The items of a stream; the same for every division into reads.
pub(crate) fn read_every_way(
    make: &dyn Fn() -> Result<Box<dyn Codec>>,
    parts: &[Vec<u8>],
) -> Result<Vec<Item>> {
    let whole =
        |parts: &[Vec<u8>]| -> Vec<Vec<Vec<u8>>> { parts.iter().map(|part| vec![part.clone()]).collect() };
    let items = read(&mut *make()?, &whole(parts))?;
    for (index, part) in parts.iter().enumerate() {
        for pieces in testkit::chunking::chunkings(part).take(2 + 200) {
            let mut cut = whole(parts);
            if let Some(slot) = cut.get_mut(index) {
                *slot = pieces.iter().map(|piece| piece.to_vec()).collect();
            }
            let found = read(&mut *make()?, &cut)?;
            ensure!(
                found == items,
                "cut into {:?} bytes: {found:?}",
                pieces.iter().map(|p| p.len()).collect::<Vec<_>>()
            );
        }
    }
    Ok(items)
}
