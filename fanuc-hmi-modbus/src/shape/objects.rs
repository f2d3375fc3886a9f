//! Lists of objects. The value of an object of a device's identification is a text: a character stands for the byte of its
//! number.

use core::fmt::{self, Write as _};
use core::marker::PhantomData;

use serde::de::{Error as _, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::list::List;
use crate::message::DeviceObjects;
use crate::message::function::REFERENCE;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Object<V> {
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

/// A run of registers in a file, to be read.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Range {
    file: u16,
    record: u16,
    quantity: u16,
}

/// Registers of a file, to be written.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Record {
    file: u16,
    record: u16,
    values: List,
}

/// An item of a list, which has bytes on the wire.
pub(super) trait Item {
    /// The expected items, for errors.
    const WHAT: &'static str;

    /// Adds the item's bytes to a list; `None` if they do not fit.
    fn add(&self, list: &mut List) -> Option<()>;
}

impl Item for Object<Value> {
    const WHAT: &'static str = "a list of objects with id and text";

    fn add(&self, list: &mut List) -> Option<()> {
        let Self { id, text: Value(value) } = self;
        let head = [u16::from(*id), u16::try_from(value.len).ok()?];
        head.iter().chain(value.words()).try_for_each(|item| list.push(*item))
    }
}

impl Item for Range {
    const WHAT: &'static str = "a list of runs with file, record and quantity";

    fn add(&self, list: &mut List) -> Option<()> {
        list.push(REFERENCE.into())?;
        list.push_words(&[self.file, self.record, self.quantity])
    }
}

impl Item for Record {
    const WHAT: &'static str = "a list of records with file, record and values";

    fn add(&self, list: &mut List) -> Option<()> {
        let &Self { file, record, ref values } = self;
        Range { file, record, quantity: u16::try_from(values.len).ok()? }.add(list)?;
        list.push_words(values.words())
    }
}

/// The registers that were read.
impl Item for List {
    const WHAT: &'static str = "a list of lists of registers";

    fn add(&self, list: &mut List) -> Option<()> {
        list.push(u16::try_from(1 + 2 * self.len).ok()?)?;
        list.push(REFERENCE.into())?;
        list.push_words(self.words())
    }
}

/// The bytes of the items of a list.
pub(super) struct Items<T> {
    pub(super) list: List,
    of: PhantomData<T>,
}

impl<'de, T: Item + Deserialize<'de>> Deserialize<'de> for Items<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct ItemsVisitor<T>(PhantomData<T>);
        impl<'de, T: Item + Deserialize<'de>> Visitor<'de> for ItemsVisitor<T> {
            type Value = Items<T>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(T::WHAT)
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Items<T>, A::Error> {
                let mut list = List::EMPTY;
                while let Some(item) = seq.next_element::<T>()? {
                    item.add(&mut list).ok_or_else(|| A::Error::custom("more objects than a PDU holds"))?;
                }
                Ok(Items { list, of: PhantomData })
            }
        }
        deserializer.deserialize_seq(ItemsVisitor(PhantomData))
    }
}

/// The text of an object.
pub(super) struct Value(List);

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
