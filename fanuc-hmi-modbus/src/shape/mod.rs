//! The `message` object of a frame, which the tool prints and reads, and the vectors hold.

mod list;
mod objects;

use core::fmt;

use serde::de::{Error as _, IgnoredAny, MapAccess, Visitor};
use serde::ser::SerializeMap;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use list::{List, Number};
use objects::{Items, Object, Range, Record, Value};

use crate::error::EncodeError;
use crate::frame::{Frame, Side};
use crate::message::{
    Bits, DeviceIdentification, DeviceObjects, Group, PduBuf, Records, Reply, Request, Words, function, limit,
};

impl Serialize for Words<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.iter())
    }
}

impl Serialize for Bits<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.iter())
    }
}

impl<'a, T: Group<'a> + Serialize> Serialize for Records<'a, T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.iter())
    }
}

impl Serialize for Frame<Request<'_>> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = head(serializer, self.transaction, self.unit, self.pdu.function())?;
        match self.pdu {
            Request::ReadCoils { address, quantity }
            | Request::ReadDiscreteInputs { address, quantity }
            | Request::ReadHoldingRegisters { address, quantity }
            | Request::ReadInputRegisters { address, quantity } => {
                entries(&mut map, &[("address", address), ("quantity", quantity)])?;
            }
            Request::WriteCoil { address, value } => {
                map.serialize_entry("address", &address)?;
                map.serialize_entry("value", &value)?;
            }
            Request::WriteRegister { address, value } => {
                entries(&mut map, &[("address", address), ("value", value)])?;
            }
            Request::Diagnostics { subfunction, data } => {
                map.serialize_entry("subfunction", &subfunction)?;
                map.serialize_entry("values", &data)?;
            }
            Request::ReadExceptionStatus
            | Request::GetCommEventCounter
            | Request::GetCommEventLog
            | Request::ReportServerId => {}
            Request::ReadFileRecord(ranges) => map.serialize_entry("ranges", &ranges)?,
            Request::WriteFileRecord(records) => map.serialize_entry("records", &records)?,
            Request::ReadFifoQueue { address } => map.serialize_entry("address", &address)?,
            Request::ReadDeviceIdentification { category, object } => {
                entries(&mut map, &[("category", category.into()), ("object", object.into())])?;
            }
            Request::WriteCoils { address, values } => {
                map.serialize_entry("address", &address)?;
                map.serialize_entry("values", &values)?;
            }
            Request::WriteRegisters { address, values } => {
                map.serialize_entry("address", &address)?;
                map.serialize_entry("values", &values)?;
            }
            Request::MaskWriteRegister { address, and, or } => {
                entries(&mut map, &[("address", address), ("and", and), ("or", or)])?;
            }
            Request::ReadWriteRegisters { address, quantity, write_address, values } => {
                let words = [("address", address), ("quantity", quantity), ("write_address", write_address)];
                entries(&mut map, &words)?;
                map.serialize_entry("values", &values)?;
            }
            Request::Other { data, .. } => map.serialize_entry("data", data)?,
        }
        map.end()
    }
}

impl Serialize for Frame<Reply<'_>> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if let Some(pdu) = self.pdu.repeated() {
            return Frame { transaction: self.transaction, unit: self.unit, pdu }.serialize(serializer);
        }
        let mut map = head(serializer, self.transaction, self.unit, self.pdu.function())?;
        match self.pdu {
            Reply::Coils(bits) | Reply::DiscreteInputs(bits) => map.serialize_entry("bits", &bits)?,
            Reply::HoldingRegisters(words)
            | Reply::InputRegisters(words)
            | Reply::ReadWriteRegisters(words)
            | Reply::FifoQueue(words) => map.serialize_entry("registers", &words)?,
            Reply::ExceptionStatus(status) => map.serialize_entry("status", &status)?,
            Reply::CommEventCounter { status, events } => {
                entries(&mut map, &[("status", status), ("events", events)])?;
            }
            Reply::CommEventLog { status, events, messages, log } => {
                entries(&mut map, &[("status", status), ("events", events), ("messages", messages)])?;
                map.serialize_entry("log", log)?;
            }
            Reply::FileRecords(groups) => map.serialize_entry("contents", &groups)?,
            Reply::ServerId(id) => map.serialize_entry("id", id)?,
            Reply::DeviceIdentification(it) => {
                let numbers = [("category", it.category.into()), ("conformity", it.conformity.into())];
                entries(&mut map, &numbers)?;
                map.serialize_entry("more", &it.more)?;
                map.serialize_entry("next", &it.next)?;
                map.serialize_entry("objects", &it.objects)?;
            }
            Reply::WriteCoils { address, quantity } | Reply::WriteRegisters { address, quantity } => {
                entries(&mut map, &[("address", address), ("quantity", quantity)])?;
            }
            Reply::Exception { exception, .. } => map.serialize_entry("exception", &exception)?,
            Reply::Other { data, .. } => map.serialize_entry("data", data)?,
            _ => {}
        }
        map.end()
    }
}

fn head<S: Serializer>(
    serializer: S,
    transaction: Option<u16>,
    unit: u8,
    function: u8,
) -> Result<S::SerializeMap, S::Error> {
    let mut map = serializer.serialize_map(None)?;
    if let Some(transaction) = transaction {
        map.serialize_entry("transaction", &transaction)?;
    }
    map.serialize_entry("unit", &unit)?;
    map.serialize_entry("function", &function)?;
    Ok(map)
}

fn entries<M: SerializeMap>(map: &mut M, words: &[(&str, u16)]) -> Result<(), M::Error> {
    words.iter().try_for_each(|(key, word)| map.serialize_entry(key, word))
}

/// Reads the object of a request or of a reply, as its keys show.
impl<'de> Deserialize<'de> for Frame<PduBuf> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        FrameObject::deserialize(deserializer)?.0.map_err(D::Error::custom)
    }
}

/// The object of a frame, and the reason that the encoder refuses its message.
#[doc(hidden)]
#[derive(Debug)]
pub struct FrameObject(pub Result<Frame<PduBuf>, EncodeError>);

impl FrameObject {
    /// Returns the keys of a message of `side` besides transaction, unit and function.
    pub fn keys(function: u8, side: Side) -> impl Iterator<Item = impl fmt::Display> + Clone {
        Key::of(function, side).iter()
    }
}

impl<'de> Deserialize<'de> for FrameObject {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(FrameVisitor)
    }
}

struct FrameVisitor;

impl<'de> Visitor<'de> for FrameVisitor {
    type Value = FrameObject;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the object of a Modbus frame")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
        let mut given = ObjectValues::default();
        while let Some(key) = map.next_key::<Key>()? {
            let number = match key {
                Key::Unknown => {
                    map.next_value::<IgnoredAny>()?;
                    return Err(A::Error::custom("a key that no Modbus frame has"));
                }
                _ if key as usize >= Key::NUMBERS => {
                    let list = match key {
                        Key::Objects => map.next_value::<Items<Object<Value>>>()?.list,
                        Key::Ranges => map.next_value::<Items<Range>>()?.list,
                        Key::Records => map.next_value::<Items<Record>>()?.list,
                        Key::Contents => map.next_value::<Items<List>>()?.list,
                        _ => map.next_value()?,
                    };
                    if given.list.replace((key, list)).is_some() {
                        return Err(A::Error::custom(ShapeError::Extra));
                    }
                    continue;
                }
                Key::Transaction => map.next_value()?,
                Key::Unit
                | Key::Function
                | Key::Exception
                | Key::Category
                | Key::Object
                | Key::Conformity
                | Key::Next => Some(map.next_value::<u8>()?.into()),
                Key::Value | Key::More => Some(map.next_value::<Number>()?.0),
                _ => Some(map.next_value()?),
            };
            if let Some(place) = given.numbers.get_mut(key as usize) {
                *place = number;
            }
        }
        match given.frame() {
            Err(ShapeError::Encode(error)) => Ok(FrameObject(Err(error))),
            frame => frame.map(|frame| FrameObject(Ok(frame))).map_err(A::Error::custom),
        }
    }
}

/// The keys of an object: those with a number, then those with a list.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
enum Key {
    Transaction,
    Unit,
    Function,
    Exception,
    Address,
    Quantity,
    WriteAddress,
    And,
    Or,
    Subfunction,
    Category,
    Object,
    Conformity,
    More,
    Next,
    Status,
    Events,
    Messages,
    Value,
    Values,
    Bits,
    Registers,
    Id,
    Log,
    Ranges,
    Records,
    Contents,
    Objects,
    Data,
    #[serde(other)]
    Unknown,
}
impl Key {
    /// The keys with a number.
    const NUMBERS: usize = Self::Value as usize + 1;

    /// Returns the keys of a message of `side` besides transaction, unit and function.
    const fn of(code: u8, side: Side) -> &'static [Self] {
        match (code, side) {
            (1..=4, Side::Client) => &[Self::Address, Self::Quantity],
            (1 | 2, Side::Server) => &[Self::Bits],
            (3 | 4 | function::READ_WRITE_REGISTERS | function::READ_FIFO_QUEUE, Side::Server) => {
                &[Self::Registers]
            }
            (function::READ_FIFO_QUEUE, Side::Client) => &[Self::Address],
            (function::WRITE_COIL | function::WRITE_REGISTER, _) => &[Self::Address, Self::Value],
            (function::WRITE_COILS | function::WRITE_REGISTERS, Side::Client) => {
                &[Self::Address, Self::Values]
            }
            (function::WRITE_COILS | function::WRITE_REGISTERS, Side::Server) => {
                &[Self::Address, Self::Quantity]
            }
            (function::MASK_WRITE_REGISTER, _) => &[Self::Address, Self::And, Self::Or],
            (function::READ_WRITE_REGISTERS, Side::Client) => {
                &[Self::Address, Self::Quantity, Self::WriteAddress, Self::Values]
            }
            (function::DIAGNOSTICS, _) => &[Self::Subfunction, Self::Values],
            (
                function::READ_EXCEPTION_STATUS
                | function::GET_COMM_EVENT_COUNTER
                | function::GET_COMM_EVENT_LOG
                | function::REPORT_SERVER_ID,
                Side::Client,
            ) => &[],
            (function::READ_EXCEPTION_STATUS, Side::Server) => &[Self::Status],
            (function::GET_COMM_EVENT_COUNTER, Side::Server) => &[Self::Status, Self::Events],
            (function::GET_COMM_EVENT_LOG, Side::Server) => {
                &[Self::Status, Self::Events, Self::Messages, Self::Log]
            }
            (function::READ_FILE_RECORD, Side::Client) => &[Self::Ranges],
            (function::READ_FILE_RECORD, Side::Server) => &[Self::Contents],
            (function::WRITE_FILE_RECORD, _) => &[Self::Records],
            (function::REPORT_SERVER_ID, Side::Server) => &[Self::Id],
            (function::READ_DEVICE_IDENTIFICATION, Side::Client) => &[Self::Category, Self::Object],
            (function::READ_DEVICE_IDENTIFICATION, Side::Server) => {
                &[Self::Category, Self::Conformity, Self::More, Self::Next, Self::Objects]
            }
            _ => &[Self::Data],
        }
    }
}

impl fmt::Display for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.serialize(f)
    }
}

/// The values of an object.
#[derive(Default)]
struct ObjectValues {
    numbers: [Option<u16>; Key::NUMBERS],
    list: Option<(Key, List)>,
}

/// A key that the function needs is missing, or the message is not allowed.
#[derive(Debug, thiserror::Error)]
enum ShapeError {
    #[error("a key is missing: {0}")]
    Missing(Key),
    #[error(transparent)]
    Encode(#[from] EncodeError),
    #[error("a value does not fit: {0}")]
    Range(&'static str),
    #[error("this function's messages have no such key")]
    Extra,
}

impl ObjectValues {
    fn frame(&self) -> Result<Frame<PduBuf>, ShapeError> {
        let (unit, function) = (self.byte(Key::Unit)?, self.byte(Key::Function)?);
        let pdu = if self.has_only(&[Key::Exception]) {
            PduBuf::new(&Reply::Exception { function, exception: self.byte(Key::Exception)?.into() })?
        } else if self.has_only(&[Key::Data]) {
            PduBuf::new(&Request::Other { function, data: self.list().to_bytes(&mut [0; limit::PDU])? })?
        } else if self.has_only(Key::of(function, Side::Client)) {
            self.request(function)?
        } else if self.has_only(Key::of(function, Side::Server)) {
            self.reply(function)?
        } else {
            let mut keys = Key::of(function, Side::Client).iter();
            return Err(keys
                .find(|key| !self.has(**key))
                .map_or(ShapeError::Extra, |key| ShapeError::Missing(*key)));
        };
        Ok(Frame { transaction: self.number(Key::Transaction), unit, pdu })
    }

    fn request(&self, function: u8) -> Result<PduBuf, ShapeError> {
        let number = |key| self.number(key).unwrap_or_default();
        let (address, quantity, list) = (number(Key::Address), number(Key::Quantity), self.list());
        let (values, mut bytes) = (Words::from(list.words()), [0; limit::PDU]);
        Ok(match function {
            function::WRITE_COIL => {
                PduBuf::new(&Request::WriteCoil { address, value: truth(number(Key::Value))? })
            }
            function::WRITE_REGISTER => {
                PduBuf::new(&Request::WriteRegister { address, value: number(Key::Value) })
            }
            function::WRITE_COILS => {
                let mut bits = [false; List::MAX];
                let values = list.to_bits(&mut bits)?;
                PduBuf::new(&Request::WriteCoils { address, values })
            }
            function::WRITE_REGISTERS => PduBuf::new(&Request::WriteRegisters { address, values }),
            function::DIAGNOSTICS => {
                PduBuf::new(&Request::Diagnostics { subfunction: number(Key::Subfunction), data: values })
            }
            function::READ_FILE_RECORD => {
                let ranges = Records::from_wire(list.to_bytes(&mut bytes)?);
                PduBuf::new(&Request::ReadFileRecord(ranges))
            }
            function::WRITE_FILE_RECORD => {
                let records = Records::from_wire(list.to_bytes(&mut bytes)?);
                PduBuf::new(&Request::WriteFileRecord(records))
            }
            function::READ_FIFO_QUEUE => PduBuf::new(&Request::ReadFifoQueue { address }),
            function::READ_DEVICE_IDENTIFICATION => PduBuf::new(&Request::ReadDeviceIdentification {
                category: self.byte(Key::Category)?,
                object: self.byte(Key::Object)?,
            }),
            function::MASK_WRITE_REGISTER => {
                let (and, or) = (number(Key::And), number(Key::Or));
                PduBuf::new(&Request::MaskWriteRegister { address, and, or })
            }
            function::READ_WRITE_REGISTERS => {
                let write_address = number(Key::WriteAddress);
                PduBuf::new(&Request::ReadWriteRegisters { address, quantity, write_address, values })
            }
            1..=4 => PduBuf::new(&Request::read(function, address, quantity)),
            _ => PduBuf::new(&Request::bare(function)),
        }?)
    }

    fn reply(&self, function: u8) -> Result<PduBuf, ShapeError> {
        let number = |key| self.number(key).unwrap_or_default();
        let (address, quantity, list) = (number(Key::Address), number(Key::Quantity), self.list());
        let mut bytes = [0; limit::PDU];
        Ok(match function {
            function::READ_COILS | function::READ_DISCRETE_INPUTS => {
                PduBuf::new(&Reply::of_bits(function, list.to_bits(&mut [false; List::MAX])?))
            }
            function::WRITE_COILS => PduBuf::new(&Reply::WriteCoils { address, quantity }),
            function::WRITE_REGISTERS => PduBuf::new(&Reply::WriteRegisters { address, quantity }),
            function::REPORT_SERVER_ID => PduBuf::new(&Reply::ServerId(list.to_bytes(&mut bytes)?)),
            function::READ_EXCEPTION_STATUS => PduBuf::new(&Reply::ExceptionStatus(self.byte(Key::Status)?)),
            function::GET_COMM_EVENT_COUNTER => PduBuf::new(&Reply::CommEventCounter {
                status: number(Key::Status),
                events: number(Key::Events),
            }),
            function::GET_COMM_EVENT_LOG => PduBuf::new(&Reply::CommEventLog {
                status: number(Key::Status),
                events: number(Key::Events),
                messages: number(Key::Messages),
                log: list.to_bytes(&mut bytes)?,
            }),
            function::READ_FILE_RECORD => {
                PduBuf::new(&Reply::FileRecords(Records::from_wire(list.to_bytes(&mut bytes)?)))
            }
            function::READ_FIFO_QUEUE => PduBuf::new(&Reply::FifoQueue(Words::from(list.words()))),
            function::READ_DEVICE_IDENTIFICATION => {
                let objects = DeviceObjects::from_wire(list.to_bytes(&mut bytes)?);
                PduBuf::new(&Reply::DeviceIdentification(DeviceIdentification {
                    category: self.byte(Key::Category)?,
                    conformity: self.byte(Key::Conformity)?,
                    more: truth(number(Key::More))?,
                    next: self.byte(Key::Next)?,
                    objects,
                }))
            }
            _ => PduBuf::new(&Reply::of_words(function, Words::from(list.words()))),
        }?)
    }

    fn number(&self, key: Key) -> Option<u16> {
        *self.numbers.get(key as usize)?
    }

    fn byte(&self, key: Key) -> Result<u8, ShapeError> {
        let number = self.number(key).ok_or(ShapeError::Missing(key))?;
        u8::try_from(number).map_err(|_| ShapeError::Range("a byte is 0 to 255"))
    }

    fn list(&self) -> &List {
        self.list.as_ref().map_or(&List::EMPTY, |(_, list)| list)
    }

    fn has(&self, key: Key) -> bool {
        self.number(key).is_some() || self.list.as_ref().is_some_and(|(given, _)| *given == key)
    }

    /// Returns whether the message has these keys and no others.
    fn has_only(&self, keys: &[Key]) -> bool {
        let numbers = self.numbers.iter().skip(Key::Exception as usize).flatten().count();
        keys.iter().all(|key| self.has(*key)) && keys.len() == numbers + usize::from(self.list.is_some())
    }
}

fn truth(word: u16) -> Result<bool, ShapeError> {
    match word {
        0 => Ok(false),
        1 => Ok(true),
        _ => Err(ShapeError::Range("a bit is false, true, 0 or 1")),
    }
}
