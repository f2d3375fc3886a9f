use anyhow::{Result, anyhow};
use fanuc_hmi_modbus::{Decoder, Frame, FrameObject, Framing, Reply, Side, TelemetryBlock, WordOrder};
use robot_session::Encode as _;
use serde::Deserialize as _;
use serde_json::{Map, Value};

use super::keys::unknown_key;
use super::options::ViewSettings;
#[cfg(feature = "arbitrary")]
use crate::codec::object;
use crate::codec::{Codec, EncodeError, Kind, Messages, bytes, codec, error, message, read};
use crate::json::value;
use crate::settings;

/// Returns the codec of a side's messages. The settings are those of [`ViewSettings`].
///
/// # Errors
/// If a setting is unknown or has no such value.
pub(super) fn either(side: &str, settings: &Map<String, Value>) -> Result<Box<dyn Codec>> {
    let settings = settings::read("fanuc", ViewSettings::default(), settings)?;
    let framing = settings.framing();
    let side = if side == "client" { Side::Client } else { Side::Server };
    let view = settings.telemetry.then_some(settings.word_order);
    Ok(codec(Decoder::new(framing, side), Modbus { framing, side, view }))
}

struct Modbus {
    framing: Framing,
    side: Side,
    /// Whether the telemetry block is shown as one, and in which word order.
    view: Option<WordOrder>,
}

impl Messages for Modbus {
    type Decoder = Decoder;

    fn show(&self, frame: Frame<&[u8]>, out: &mut Vec<u8>) -> Kind {
        if self.side == Side::Client {
            return match frame.request() {
                Ok(request) => message(&request, out),
                Err(found) => error(&found, out),
            };
        }
        let reply = match frame.reply() {
            Ok(reply) => reply,
            Err(found) => return error(&found, out),
        };
        if let (Some(order), Reply::HoldingRegisters(words)) = (self.view, reply.pdu)
            && words.len() == usize::from(TelemetryBlock::QUANTITY)
            && let (Some(block), Value::Object(mut object)) =
                (TelemetryBlock::from_words(&words, order), value(reply))
        {
            object.remove("registers");
            object.insert("telemetry".into(), value(block));
            return message(&object, out);
        }
        message(&reply, out)
    }

    fn encode(&self, mut message: Value) -> Result<Vec<u8>, EncodeError> {
        if let (Some(order), Value::Object(message)) = (self.view, &mut message)
            && let Some(block) = message.remove("telemetry")
        {
            let block: TelemetryBlock = read(block)?;
            message.insert("registers".into(), block.to_registers(order).as_slice().into());
        }
        let frame = FrameObject::deserialize(&message);
        let FrameObject(frame) = frame.map_err(|error| match unknown_key(&message, self.side) {
            Some(unknown) => anyhow!(unknown),
            None => anyhow::Error::new(error),
        })?;
        let frame = frame.map_err(EncodeError::refused)?;
        match (self.framing, frame.transaction) {
            (Framing::Tcp, None) => Err(anyhow!("a key is missing: transaction, or use --set framing=rtu"))?,
            (Framing::Tcp, Some(_)) | (_, None) => {}
            (_, Some(_)) => Err(anyhow!("an RTU frame has no transaction; use --set framing=tcp"))?,
        }
        let wire = bytes(frame.encoded_len(), |out| frame.encode(out))?;
        // An object may be a message of the other side.
        let read = match self.side {
            Side::Client => frame.pdu.request().map(drop),
            Side::Server => frame.pdu.reply().map(drop),
        };
        read.map_err(EncodeError::refused)?;
        Ok(wire)
    }

    #[cfg(feature = "arbitrary")]
    fn arbitrary(&self, u: &mut arbitrary::Unstructured<'_>) -> arbitrary::Result<Value> {
        let transaction = if self.framing == Framing::Tcp { Some(u.arbitrary()?) } else { None };
        let unit = u.arbitrary()?;
        match self.side {
            Side::Client => {
                object(&Frame { transaction, unit, pdu: u.arbitrary::<fanuc_hmi_modbus::Request<'_>>()? })
            }
            Side::Server => object(&Frame { transaction, unit, pdu: u.arbitrary::<Reply<'_>>()? }),
        }
    }
}
