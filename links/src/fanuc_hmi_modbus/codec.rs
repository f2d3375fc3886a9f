use anyhow::{Result, anyhow};
use fanuc_hmi_modbus::{Decoder, Frame, FrameObject, Framing, Reply, Side, TelemetryBlock, WordOrder};
use robot_session::Encode as _;
use serde_json::{Map, Value};

use super::options::ViewSettings;
#[cfg(feature = "arbitrary")]
use crate::codec::object;
use crate::codec::{Codec, EncodeError, Kind, Messages, bytes, codec, error, message, read};
use crate::json::value;
use crate::settings;

/// What a side sends. The settings are those of [`ViewSettings`].
///
/// # Errors
/// When a setting is none of these.
pub(super) fn either(side: &str, settings: &Map<String, Value>) -> Result<Box<dyn Codec>> {
    let settings = settings::read("fanuc-hmi-modbus", ViewSettings::default(), settings)?;
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
        let FrameObject(frame) = read(message)?;
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::items;
    use serde_json::{Map, json};

    fn options(settings: &[(&str, &str)]) -> Map<String, Value> {
        settings.iter().map(|(name, value)| ((*name).into(), (*value).into())).collect()
    }

    #[test]
    fn the_telemetry_view_shows_the_block_and_encodes_it_again() {
        for (order, counter) in [("low_first", 0x0001_86A0), ("high_first", 0x86A0_0001_u32)] {
            let options = options(&[("view", "telemetry"), ("word_order", order)]);
            let mut registers = vec![0; 37];
            registers[..5].copy_from_slice(&[0x86A0, 0x0001, 100, 0xE979, 0x42F6]);
            let plain = json!({"transaction": 1, "unit": 1, "function": 3, "registers": registers});
            let bytes = either("server", &options).unwrap().encode(plain).unwrap();
            let items = items(either("server", &options).unwrap(), &[vec![&bytes]]).unwrap();
            let message = items[0].value().unwrap().unwrap();
            assert_eq!(message["telemetry"]["life_counter"], counter);
            assert_eq!(message["telemetry"]["override"], 100);
            assert_eq!(message.get("registers"), None);
            assert_eq!(either("server", &options).unwrap().encode(message).unwrap(), bytes);
        }
    }

    #[test]
    fn other_replies_look_the_same_in_every_view() {
        let reply = json!({"unit": 1, "function": 3, "registers": [1, 2]});
        let options = options(&[("view", "telemetry"), ("framing", "rtu")]);
        let codec = || either("server", &options).unwrap();
        let bytes = codec().encode(reply.clone()).unwrap();
        let items = items(codec(), &[vec![&bytes]]).unwrap();
        assert_eq!(items[0].value().unwrap(), Ok(reply));
        assert_eq!(items.len(), 1);
    }

    #[test]
    fn what_is_asked_wrongly_is_said() {
        let error = |settings: &Map<String, Value>| either("client", settings).err().unwrap().to_string();
        assert_eq!(
            error(&options(&[("framing", "ascii")])),
            "framing=ascii: not one of the choices, give tcp, rtu"
        );
        assert_eq!(
            error(&options(&[("view", "x")])),
            "view=x: not one of the choices, give registers, telemetry"
        );
        let request = json!({"unit": 1, "function": 3, "address": 0, "quantity": 37});
        let tcp = either("client", &options(&[])).unwrap();
        let error = tcp.encode(request).unwrap_err().to_string();
        assert_eq!(error, "a key is missing: transaction, or use --set framing=rtu");
        let request = json!({"transaction": 1, "unit": 1, "function": 3, "address": 0, "quantity": 126});
        let error = tcp.encode(request).unwrap_err().to_string();
        assert_eq!(error, "quantity 126 in function 3 is not within 1 to 125");
        let request = json!({"transaction": 1, "unit": 1, "function": 3, "address": 65535, "quantity": 2});
        let error = tcp.encode(request).unwrap_err().to_string();
        assert_eq!(error, "2 items from address 65535 exceed address 65535");
    }
}
