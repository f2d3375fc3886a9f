//! The `message` object of a frame: `{"items":[{"f32":[…]},{"i16":[…]},{"u8":[…]},{"char":"…"}]}`.

use core::fmt;

use serde::de::{DeserializeSeed, Deserializer, Error as _, MapAccess, SeqAccess, Visitor};
use serde::ser::{Error as _, SerializeSeq, SerializeStruct, Serializer};
use serde::{Deserialize, Serialize};

use crate::error::{ConfigError, EncodeError};
use crate::frame::Frame;
use crate::items::{Item, Items, Number, Values};
use crate::payload::Payload;
use crate::words::{ErrorCodes, Range, Words};

/// Fails on a corrupt item; [`Items::check`] returns which error it is.
impl Serialize for Frame<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut object = serializer.serialize_struct("Frame", 1)?;
        object.serialize_field("items", &self.items())?;
        object.end()
    }
}

impl Serialize for Items<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut list = serializer.serialize_seq(None)?;
        for item in *self {
            list.serialize_element(&item.map_err(S::Error::custom)?)?;
        }
        list.end()
    }
}

impl<T: Number + Serialize> Serialize for Values<'_, T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut list = serializer.serialize_seq(Some(self.len()))?;
        for value in self.iter() {
            list.serialize_element(&value)?;
        }
        list.end()
    }
}

impl Serialize for Item<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::F32(values) => serializer.serialize_newtype_variant("Item", 0, "f32", values),
            Self::I16(values) => serializer.serialize_newtype_variant("Item", 1, "i16", values),
            Self::U8(values) => serializer.serialize_newtype_variant("Item", 2, "u8", values),
            Self::Char(values) => serializer.serialize_newtype_variant("Item", 3, "char", &Latin1(values)),
        }
    }
}

/// Bytes as a string of the characters U+0000 to U+00FF.
struct Latin1<'a>(&'a [u8]);

impl fmt::Display for Latin1<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|&byte| fmt::Write::write_char(f, char::from(byte)))
    }
}

impl Serialize for Latin1<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// Reads a `message` object into the payload: `(&mut payload).deserialize(deserializer)`.
///
/// A seed, because the bytes of a message follow from the payload's profile; nothing is allocated.
impl<'de> DeserializeSeed<'de> for &mut Payload<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_map(Object(self))
    }
}

struct Object<'p, 'b>(&'p mut Payload<'b>);

impl<'de> Visitor<'de> for Object<'_, '_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an object with one field `items`")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(), A::Error> {
        #[derive(Deserialize)]
        #[serde(field_identifier, rename_all = "lowercase")]
        enum Field {
            Items,
        }
        let Some(Field::Items) = map.next_key()? else { return Err(A::Error::missing_field("items")) };
        map.next_value_seed(List(self.0))?;
        match map.next_key::<Field>()? {
            None => Ok(()),
            Some(_) => Err(A::Error::duplicate_field("items")),
        }
    }
}

struct List<'p, 'b>(&'p mut Payload<'b>);

impl<'de> DeserializeSeed<'de> for List<'_, '_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_seq(self)
    }
}

impl<'de> Visitor<'de> for List<'_, '_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a list of items")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<(), A::Error> {
        while list.next_element_seed(OneItem(self.0))?.is_some() {}
        Ok(())
    }
}

struct OneItem<'p, 'b>(&'p mut Payload<'b>);

impl<'de> DeserializeSeed<'de> for OneItem<'_, '_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_map(self)
    }
}

impl<'de> Visitor<'de> for OneItem<'_, '_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an item: an object with one field, `f32`, `i16`, `u8` or `char`")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(), A::Error> {
        #[derive(Deserialize)]
        #[serde(field_identifier, rename_all = "lowercase")]
        enum Field {
            F32,
            I16,
            U8,
            Char,
        }
        let payload = self.0;
        let Some(field) = map.next_key()? else { return Err(A::Error::custom("an item without a type")) };
        let written = match field {
            Field::F32 => {
                let Numbers(values, count) = map.next_value()?;
                payload.f32(values.get(..count).unwrap_or_default()).map(drop)
            }
            Field::I16 => {
                let Numbers(values, count) = map.next_value()?;
                payload.i16(values.get(..count).unwrap_or_default()).map(drop)
            }
            Field::U8 => {
                let Numbers(values, count) = map.next_value()?;
                payload.u8(values.get(..count).unwrap_or_default()).map(drop)
            }
            Field::Char => {
                let Text(values, count) = map.next_value()?;
                payload.char(values.get(..count).unwrap_or_default()).map(drop)
            }
        };
        written.map_err(A::Error::custom)?;
        match map.next_key::<Field>()? {
            None => Ok(()),
            Some(_) => Err(A::Error::custom("an item holds values of one type")),
        }
    }
}

/// Up to 255 numbers, and their count.
struct Numbers<T>([T; MAX_VALUES], usize);

const MAX_VALUES: usize = 255;

impl<'de, T: Deserialize<'de> + Copy + Default> Deserialize<'de> for Numbers<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Read<T>(Numbers<T>);

        impl<'de, T: Deserialize<'de> + Copy + Default> Visitor<'de> for Read<T> {
            type Value = Numbers<T>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a list of up to 255 numbers")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Numbers<T>, A::Error> {
                let Self(Numbers(mut values, mut count)) = self;
                while let Some(value) = list.next_element()? {
                    let slot = values.get_mut(count).ok_or_else(|| too_many::<A::Error>(count))?;
                    *slot = value;
                    count += 1;
                }
                Ok(Numbers(values, count))
            }
        }

        deserializer.deserialize_seq(Read(Numbers([T::default(); MAX_VALUES], 0)))
    }
}

/// Up to 255 characters, each a byte, and their count.
struct Text([u8; MAX_VALUES], usize);

impl<'de> Deserialize<'de> for Text {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Read;

        impl Visitor<'_> for Read {
            type Value = Text;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a string of up to 255 characters U+0000 to U+00FF")
            }

            fn visit_str<E: serde::de::Error>(self, text: &str) -> Result<Text, E> {
                let mut values = [0; MAX_VALUES];
                let mut count = 0;
                for c in text.chars() {
                    let slot = values.get_mut(count).ok_or_else(|| too_many::<E>(count))?;
                    *slot = u8::try_from(c)
                        .map_err(|_| E::custom(format_args!("{c:?} is no character U+0000 to U+00FF")))?;
                    count += 1;
                }
                Ok(Text(values, count))
            }
        }

        deserializer.deserialize_str(Read)
    }
}

fn too_many<E: serde::de::Error>(count: usize) -> E {
    E::custom(EncodeError::TooManyValues { count: count + 1 })
}

impl Serialize for Words {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut object = serializer.serialize_struct("Words", 2)?;
        object.serialize_field("commands", self.ranges())?;
        object.serialize_field("errors", self.errors())?;
        object.end()
    }
}

impl<'de> Deserialize<'de> for Words {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Object {
            commands: Ranges,
            #[serde(default)]
            errors: ErrorCodes,
        }
        let Object { commands, errors } = Object::deserialize(deserializer)?;
        let mut words = Self::without_commands(errors).map_err(D::Error::custom)?;
        for range in commands.0.into_iter().flatten() {
            words.add(range).map_err(D::Error::custom)?;
        }
        Ok(words)
    }
}

struct Ranges([Option<Range>; Words::MAX_RANGES]);

impl<'de> Deserialize<'de> for Ranges {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Read;

        impl<'de> Visitor<'de> for Read {
            type Value = Ranges;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a list of ranges of command words")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Ranges, A::Error> {
                let mut ranges = Ranges([None; Words::MAX_RANGES]);
                let mut slots = ranges.0.iter_mut();
                while let Some(range) = list.next_element()? {
                    let limit = Words::MAX_RANGES;
                    let full = || A::Error::custom(ConfigError::TooManyRanges { limit });
                    *slots.next().ok_or_else(full)? = Some(range);
                }
                Ok(ranges)
            }
        }

        deserializer.deserialize_seq(Read)
    }
}
