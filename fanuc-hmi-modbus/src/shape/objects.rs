//! The objects of a device's identification, with their values as text: a character stands for the byte of its number.

use core::fmt::{self, Write as _};

use serde::de::{Error as _, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::List;
use crate::message::DeviceObjects;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Object<V> {
    id: u8,
    text: V,
}

impl Serialize for DeviceObjects<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.iter().map(|(id, value)| Object { id, text: Text(value) }))
    }
}

struct Text<'a>(&'a [u8]);

impl fmt::Display for Text<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| f.write_char(char::from(*byte)))
    }
}

impl Serialize for Text<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// The bytes of the objects in the next value of a map.
pub(super) fn read<'de, A: MapAccess<'de>>(map: &mut A) -> Result<List, A::Error> {
    map.next_value::<Objects>().map(|objects| objects.0)
}

struct Objects(List);

impl<'de> Deserialize<'de> for Objects {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct ObjectsVisitor;
        impl<'de> Visitor<'de> for ObjectsVisitor {
            type Value = Objects;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a list of objects with id and text")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Objects, A::Error> {
                let mut list = List::EMPTY;
                while let Some(Object { id, text: Value(value) }) = seq.next_element()? {
                    let length = u16::try_from(value.len).unwrap_or_default();
                    for item in [u16::from(id), length].iter().chain(value.words()) {
                        list.push(*item).ok_or_else(|| A::Error::custom("more objects than a PDU holds"))?;
                    }
                }
                Ok(Objects(list))
            }
        }
        deserializer.deserialize_seq(ObjectsVisitor)
    }
}

struct Value(List);

impl<'de> Deserialize<'de> for Value {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct ValueVisitor;
        impl Visitor<'_> for ValueVisitor {
            type Value = Value;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a text of at most 255 characters up to U+00FF")
            }

            fn visit_str<E: serde::de::Error>(self, text: &str) -> Result<Value, E> {
                let mut list = List::EMPTY;
                for character in text.chars() {
                    let byte = u8::try_from(character).ok().filter(|_| list.len < 255);
                    byte.and_then(|byte| list.push(byte.into()))
                        .ok_or_else(|| E::invalid_value(serde::de::Unexpected::Str(text), &self))?;
                }
                Ok(Value(list))
            }
        }
        deserializer.deserialize_str(ValueVisitor)
    }
}
