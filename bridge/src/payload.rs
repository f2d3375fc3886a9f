//! The payload of Sparkplug B, `sparkplug_b.proto`, as far as the bridge writes and reads it: fields that are not here are
//! skipped when a payload is read.

use prost::{Message, Oneof};

/// A message's payload.
#[derive(Clone, PartialEq, Message)]
pub struct Payload {
    /// The time at which the message was sent, in milliseconds since 1970 UTC.
    #[prost(uint64, optional, tag = "1")]
    pub timestamp: Option<u64>,
    /// The metrics of the message.
    #[prost(message, repeated, tag = "2")]
    pub metrics: Vec<Metric>,
    /// The number of the message, 0 to 255; `None` in messages that are not numbered.
    #[prost(uint64, optional, tag = "3")]
    pub seq: Option<u64>,
}

/// A named value.
#[derive(Clone, PartialEq, Message)]
pub struct Metric {
    /// The name of the metric; `None` if an alias stands for it.
    #[prost(string, optional, tag = "1")]
    pub name: Option<String>,
    /// The alias that stands for the name since the last birth; `None` without aliases.
    #[prost(uint64, optional, tag = "2")]
    pub alias: Option<u64>,
    /// The time at which the value was read, in milliseconds since 1970 UTC.
    #[prost(uint64, optional, tag = "3")]
    pub timestamp: Option<u64>,
    /// The number of a [`Kind`].
    #[prost(uint32, optional, tag = "4")]
    pub datatype: Option<u32>,
    /// Whether the value was stored without a connection: then it is not the current one.
    #[prost(bool, optional, tag = "5")]
    pub is_historical: Option<bool>,
    /// Whether there is no value.
    #[prost(bool, optional, tag = "7")]
    pub is_null: Option<bool>,
    /// The properties of the metric, such as its quality; `None` without any.
    #[prost(message, optional, tag = "9")]
    pub properties: Option<Properties>,
    /// The value of the type `datatype`; `None` if `is_null`.
    #[prost(oneof = "Value", tags = "10, 11, 12, 13, 14, 15")]
    pub value: Option<Value>,
}

/// Named properties of a metric: a key and a value each, in two lists.
#[derive(Clone, PartialEq, Message)]
pub struct Properties {
    /// The names of the properties.
    #[prost(string, repeated, tag = "1")]
    pub keys: Vec<String>,
    /// The values of the properties.
    #[prost(message, repeated, tag = "2")]
    pub values: Vec<Property>,
}

/// The value of a property, as far as the bridge has any: a number of 32 bits.
#[derive(Clone, PartialEq, Message)]
pub struct Property {
    /// Sparkplug's number of the value's type.
    #[prost(uint32, optional, tag = "1")]
    pub datatype: Option<u32>,
    /// The value of the property, a number of 32 bits.
    #[prost(uint32, optional, tag = "3")]
    pub value: Option<u32>,
}

/// The quality of a value, with Sparkplug's numbers; a value without this property is good.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum Quality {
    /// The device reports implausible values.
    Bad = 0,
    /// The device does not answer.
    Stale = 500,
}

/// The value of a metric.
#[derive(Clone, PartialEq, Oneof)]
pub enum Value {
    /// An integer of 32 bits and less.
    #[prost(uint32, tag = "10")]
    Int(u32),
    /// An integer of 64 bits.
    #[prost(uint64, tag = "11")]
    Long(u64),
    /// A number of single precision.
    #[prost(float, tag = "12")]
    Float(f32),
    /// A number of double precision.
    #[prost(double, tag = "13")]
    Double(f64),
    /// A truth value.
    #[prost(bool, tag = "14")]
    Boolean(bool),
    /// A text in UTF-8.
    #[prost(string, tag = "15")]
    String(String),
}

/// The data types that the bridge uses, with Sparkplug's numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum Kind {
    /// A signed number of 64 bits, as [`Value::Long`] in two's complement.
    Int64 = 4,
    /// A number of single precision, as [`Value::Float`].
    Float = 9,
    /// A number of double precision, as [`Value::Double`].
    Double = 10,
    /// A truth value, as [`Value::Boolean`].
    Boolean = 11,
    /// A text in UTF-8, as [`Value::String`].
    String = 12,
}

impl Kind {
    /// Returns Sparkplug's number.
    pub fn number(self) -> u32 {
        self as u32
    }

    /// Returns the kind of this number.
    pub fn of(number: u32) -> Option<Self> {
        [Self::Int64, Self::Float, Self::Double, Self::Boolean, Self::String]
            .into_iter()
            .find(|kind| kind.number() == number)
    }
}

impl Quality {
    /// Returns the quality of this number.
    pub fn of(number: u32) -> Option<Self> {
        [Self::Bad, Self::Stale].into_iter().find(|quality| *quality as u32 == number)
    }
}

impl Metric {
    /// Makes a metric with its name, kind and value; without a value it is null.
    pub fn new(name: &str, kind: Kind, timestamp: u64, value: Option<Value>) -> Self {
        Self {
            name: Some(name.to_owned()),
            alias: None,
            timestamp: Some(timestamp),
            datatype: Some(kind.number()),
            is_historical: None,
            is_null: value.is_none().then_some(true),
            properties: None,
            value,
        }
    }

    /// Returns a metric without a value; the quality is the reason.
    pub fn null(name: &str, kind: Kind, timestamp: u64, quality: Quality) -> Self {
        // Int32.
        let quality = Property { datatype: Some(3), value: Some(quality as u32) };
        let properties = Properties { keys: vec!["Quality".into()], values: vec![quality] };
        Self { properties: Some(properties), ..Self::new(name, kind, timestamp, None) }
    }

    /// Returns the number of the quality of a metric without a value.
    pub fn quality(&self) -> Option<u32> {
        self.properties.as_ref()?.values.first()?.value
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The bytes by hand, from the numbers of the fields in the specification's section 6.4.
    #[test]
    fn a_payload_has_the_bytes_of_the_specification() {
        let metric = Metric::new("a", Kind::Int64, 5, Some(Value::Long(7)));
        let payload = Payload { timestamp: Some(300), metrics: vec![metric], seq: Some(255) };
        let bytes = [
            0x08, 0xAC, 0x02, // 1: timestamp 300
            0x12, 0x09, // 2: a metric of 9 bytes
            0x0A, 0x01, b'a', // 1: name
            0x18, 0x05, // 3: timestamp
            0x20, 0x04, // 4: datatype Int64
            0x58, 0x07, // 11: long_value
            0x18, 0xFF, 0x01, // 3: seq 255
        ];
        assert_eq!(payload.encode_to_vec(), bytes);
        assert_eq!(Payload::decode(&bytes[..]).unwrap(), payload);
    }

    #[test]
    fn a_null_has_its_quality() {
        let payload = Payload {
            metrics: vec![Metric::null("a", Kind::Float, 5, Quality::Stale)],
            ..Payload::default()
        };
        let bytes = [
            0x12, 0x1B, // 2: a metric of 27 bytes
            0x0A, 0x01, b'a', // 1: name
            0x18, 0x05, // 3: timestamp
            0x20, 0x09, // 4: datatype Float
            0x38, 0x01, // 7: is_null
            0x4A, 0x10, // 9: properties of 16 bytes
            0x0A, 0x07, b'Q', b'u', b'a', b'l', b'i', b't', b'y', // 1: key
            0x12, 0x05, // 2: a value of 5 bytes
            0x08, 0x03, // 1: type Int32
            0x18, 0xF4, 0x03, // 3: int_value 500
        ];
        assert_eq!(payload.encode_to_vec(), bytes);
    }

    #[test]
    fn what_the_bridge_does_not_know_is_skipped() {
        // uuid (4) and a metric with is_transient (6) and a value of bytes (16).
        let bytes = [0x12, 0x07, 0x30, 0x01, 0x82, 0x01, 0x02, 1, 2, 0x22, 0x01, b'u', 0x18, 0x03];
        let payload = Payload::decode(&bytes[..]).unwrap();
        assert_eq!(
            (payload.seq, payload.metrics.len(), payload.metrics[0].value.clone()),
            (Some(3), 1, None)
        );
        assert!(Payload::decode(&[0x12, 0x7F][..]).is_err());
    }
}
