//! The `message` object of a frame, which the tool prints and reads, and the vectors hold.

use core::fmt;

use serde::de::{Error as _, IgnoredAny, MapAccess, SeqAccess, Unexpected, Visitor};
use serde::ser::SerializeMap;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::error::EncodeError;
use crate::frame::Frame;
use crate::message::{Bits, Exception, Pdu, PduBuf, Reply, Request, Words, function, limit};

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
        let mut map = head(serializer, self.transaction, self.unit, self.pdu.function())?;
        match self.pdu {
            Reply::Coils(bits) | Reply::DiscreteInputs(bits) => map.serialize_entry("bits", &bits)?,
            Reply::HoldingRegisters(words)
            | Reply::InputRegisters(words)
            | Reply::ReadWriteRegisters(words) => map.serialize_entry("registers", &words)?,
            Reply::WriteCoil { address, value } => {
                map.serialize_entry("address", &address)?;
                map.serialize_entry("value", &value)?;
            }
            Reply::WriteRegister { address, value } => {
                entries(&mut map, &[("address", address), ("value", value)])?;
            }
            Reply::WriteCoils { address, quantity } | Reply::WriteRegisters { address, quantity } => {
                entries(&mut map, &[("address", address), ("quantity", quantity)])?;
            }
            Reply::MaskWriteRegister { address, and, or } => {
                entries(&mut map, &[("address", address), ("and", and), ("or", or)])?;
            }
            Reply::Exception { exception, .. } => map.serialize_entry("exception", &exception)?,
            Reply::Other { data, .. } => map.serialize_entry("data", data)?,
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

/// Reads the object of a request or of a reply: its keys show which.
impl<'de> Deserialize<'de> for Frame<PduBuf> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        FrameObject::deserialize(deserializer)?.0.map_err(D::Error::custom)
    }
}

/// The object of a frame, and why the encoder refuses its message.
#[doc(hidden)]
#[derive(Debug)]
pub struct FrameObject(pub Result<Frame<PduBuf>, EncodeError>);

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
        let mut keys = Keys::default();
        while let Some(key) = map.next_key::<Key>()? {
            match key {
                Key::Transaction => keys.transaction = map.next_value()?,
                Key::Unit => keys.unit = Some(map.next_value()?),
                Key::Function => keys.function = Some(map.next_value()?),
                Key::Address => keys.address = Some(map.next_value()?),
                Key::Quantity => keys.quantity = Some(map.next_value()?),
                Key::WriteAddress => keys.write_address = Some(map.next_value()?),
                Key::And => keys.and = Some(map.next_value()?),
                Key::Or => keys.or = Some(map.next_value()?),
                Key::Value => keys.value = Some(map.next_value::<Number>()?.0),
                Key::Exception => keys.exception = Some(map.next_value()?),
                Key::Bits | Key::Registers | Key::Values | Key::Data => {
                    keys.list = Some((key, map.next_value()?));
                }
                Key::Unknown => {
                    map.next_value::<IgnoredAny>()?;
                    return Err(A::Error::custom("a key that no Modbus frame has"));
                }
            }
        }
        match keys.frame() {
            Err(ShapeError::Encode(error)) => Ok(FrameObject(Err(error))),
            frame => frame.map(|frame| FrameObject(Ok(frame))).map_err(A::Error::custom),
        }
    }
}

#[derive(Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Key {
    Transaction,
    Unit,
    Function,
    Address,
    Quantity,
    WriteAddress,
    And,
    Or,
    Value,
    Values,
    Bits,
    Registers,
    Data,
    Exception,
    #[serde(other)]
    Unknown,
}

#[derive(Default)]
struct Keys {
    transaction: Option<u16>,
    unit: Option<u8>,
    function: Option<u8>,
    address: Option<u16>,
    quantity: Option<u16>,
    write_address: Option<u16>,
    and: Option<u16>,
    or: Option<u16>,
    value: Option<u16>,
    exception: Option<Exception>,
    list: Option<(Key, List)>,
}

/// A key that the function needs is missing, or the message is not allowed.
#[derive(Debug, thiserror::Error)]
enum ShapeError {
    #[error("a key is missing: {0}")]
    Missing(&'static str),
    #[error(transparent)]
    Encode(#[from] EncodeError),
    #[error("a value does not fit: {0}")]
    Range(&'static str),
    #[error("this function's messages have no such key")]
    Extra,
}

impl Keys {
    fn frame(mut self) -> Result<Frame<PduBuf>, ShapeError> {
        let unit = self.unit.ok_or(ShapeError::Missing("unit"))?;
        let pdu = self.pdu()?;
        let rest = [self.address, self.quantity, self.write_address, self.and, self.or, self.value];
        if rest.iter().any(Option::is_some) {
            return Err(ShapeError::Extra);
        }
        Ok(Frame { transaction: self.transaction, unit, pdu })
    }

    /// Takes the keys that the message has.
    fn pdu(&mut self) -> Result<PduBuf, ShapeError> {
        let code = self.function.ok_or(ShapeError::Missing("function"))?;
        if let Some(exception) = self.exception {
            if self.list.is_some() {
                return Err(ShapeError::Extra);
            }
            return buffer(&Reply::Exception { function: code, exception });
        }
        let mut bits = [false; List::MAX];
        let mut bytes = [0; limit::PDU];
        let empty = List::default();
        let given = self.list.take();
        let (key, list) = given.as_ref().map_or((Key::Unknown, &empty), |(key, list)| (*key, list));
        let words = Words::from(list.words());
        let of_bits = key == Key::Bits || (code, key) == (function::WRITE_COILS, Key::Values);
        let truths = if of_bits { list.to_bits(&mut bits)? } else { Bits::from(&[]) };
        match (code, key) {
            (function::READ_COILS, Key::Bits) => buffer(&Reply::Coils(truths)),
            (function::READ_DISCRETE_INPUTS, Key::Bits) => buffer(&Reply::DiscreteInputs(truths)),
            (function::READ_HOLDING_REGISTERS, Key::Registers) => buffer(&Reply::HoldingRegisters(words)),
            (function::READ_INPUT_REGISTERS, Key::Registers) => buffer(&Reply::InputRegisters(words)),
            (function::READ_WRITE_REGISTERS, Key::Registers) => buffer(&Reply::ReadWriteRegisters(words)),
            (function::WRITE_COILS, Key::Values) => {
                buffer(&Request::WriteCoils { address: self.address()?, values: truths })
            }
            (function::WRITE_REGISTERS, Key::Values) => {
                buffer(&Request::WriteRegisters { address: self.address()?, values: words })
            }
            (function::READ_WRITE_REGISTERS, Key::Values | Key::Unknown) => {
                buffer(&Request::ReadWriteRegisters {
                    address: self.address()?,
                    quantity: self.quantity()?,
                    write_address: self.write_address.take().ok_or(ShapeError::Missing("write_address"))?,
                    values: words,
                })
            }
            (function::WRITE_COIL, Key::Unknown) => {
                let value = self.value.take().ok_or(ShapeError::Missing("value"))?;
                let value = truth(value)?;
                buffer(&Request::WriteCoil { address: self.address()?, value })
            }
            (function::WRITE_REGISTER, Key::Unknown) => {
                let value = self.value.take().ok_or(ShapeError::Missing("value"))?;
                buffer(&Request::WriteRegister { address: self.address()?, value })
            }
            (function::MASK_WRITE_REGISTER, Key::Unknown) => buffer(&Request::MaskWriteRegister {
                address: self.address()?,
                and: self.and.take().ok_or(ShapeError::Missing("and"))?,
                or: self.or.take().ok_or(ShapeError::Missing("or"))?,
            }),
            (function::WRITE_COILS, Key::Unknown) => {
                buffer(&Reply::WriteCoils { address: self.address()?, quantity: self.quantity()? })
            }
            (function::WRITE_REGISTERS, Key::Unknown) => {
                buffer(&Reply::WriteRegisters { address: self.address()?, quantity: self.quantity()? })
            }
            (function::READ_COILS, Key::Unknown) => {
                buffer(&Request::ReadCoils { address: self.address()?, quantity: self.quantity()? })
            }
            (function::READ_DISCRETE_INPUTS, Key::Unknown) => {
                buffer(&Request::ReadDiscreteInputs { address: self.address()?, quantity: self.quantity()? })
            }
            (function::READ_HOLDING_REGISTERS, Key::Unknown) => buffer(&Request::ReadHoldingRegisters {
                address: self.address()?,
                quantity: self.quantity()?,
            }),
            (function::READ_INPUT_REGISTERS, Key::Unknown) => {
                buffer(&Request::ReadInputRegisters { address: self.address()?, quantity: self.quantity()? })
            }
            (function, Key::Data) => buffer(&Request::Other { function, data: list.to_bytes(&mut bytes)? }),
            (_, Key::Unknown) => Err(ShapeError::Missing("data")),
            _ => Err(ShapeError::Extra),
        }
    }

    fn address(&mut self) -> Result<u16, ShapeError> {
        self.address.take().ok_or(ShapeError::Missing("address"))
    }

    fn quantity(&mut self) -> Result<u16, ShapeError> {
        self.quantity.take().ok_or(ShapeError::Missing("quantity"))
    }
}

fn buffer(pdu: &impl Pdu) -> Result<PduBuf, ShapeError> {
    Ok(PduBuf::new(pdu)?)
}

fn truth(word: u16) -> Result<bool, ShapeError> {
    match word {
        0 => Ok(false),
        1 => Ok(true),
        _ => Err(ShapeError::Range("a bit is false, true, 0 or 1")),
    }
}

/// The longest list is one of 2000 bits.
struct List {
    items: [u16; Self::MAX],
    len: usize,
}

impl List {
    const MAX: usize = limit::READ_BITS as usize;

    fn words(&self) -> &[u16] {
        self.items.get(..self.len).unwrap_or_default()
    }

    fn to_bits<'b>(&self, out: &'b mut [bool]) -> Result<Bits<'b>, ShapeError> {
        for (bit, word) in out.iter_mut().zip(self.words()) {
            *bit = truth(*word)?;
        }
        Ok(Bits::from(out.get(..self.len).unwrap_or_default()))
    }

    fn to_bytes<'b>(&self, out: &'b mut [u8]) -> Result<&'b [u8], ShapeError> {
        let out = out.get_mut(..self.len).ok_or(ShapeError::Range("more data than a PDU holds"))?;
        for (byte, word) in out.iter_mut().zip(self.words()) {
            *byte = u8::try_from(*word).map_err(|_| ShapeError::Range("a byte is 0 to 255"))?;
        }
        Ok(out)
    }
}

impl Default for List {
    fn default() -> Self {
        Self { items: [0; Self::MAX], len: 0 }
    }
}

impl<'de> Deserialize<'de> for List {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct ListVisitor;
        impl<'de> Visitor<'de> for ListVisitor {
            type Value = List;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a list of numbers or of bits")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<List, A::Error> {
                let mut list = List::default();
                while let Some(Number(word)) = seq.next_element()? {
                    let Some(item) = list.items.get_mut(list.len) else {
                        return Err(A::Error::invalid_length(list.len + 1, &self));
                    };
                    *item = word;
                    list.len += 1;
                }
                Ok(list)
            }
        }
        deserializer.deserialize_seq(ListVisitor)
    }
}

/// A register, a byte, or a bit.
struct Number(u16);

impl<'de> Deserialize<'de> for Number {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct NumberVisitor;
        impl Visitor<'_> for NumberVisitor {
            type Value = Number;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("0 to 65535, or true or false")
            }

            fn visit_bool<E: serde::de::Error>(self, bit: bool) -> Result<Number, E> {
                Ok(Number(bit.into()))
            }

            fn visit_u64<E: serde::de::Error>(self, word: u64) -> Result<Number, E> {
                let found = Unexpected::Unsigned(word);
                u16::try_from(word).map(Number).map_err(|_| E::invalid_value(found, &self))
            }
        }
        deserializer.deserialize_any(NumberVisitor)
    }
}
