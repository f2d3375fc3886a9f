//! A record as it is in the store: numbers in place of the names of cell and metrics, and one time for all.

use std::collections::HashMap;

use anyhow::Result;
use prost::Message;

use crate::metric::Definition;
use crate::payload::{Kind, Metric, Quality, Value};
use crate::store::{Batch, Store};

/// The prefix in the store of the number of a word; the value is its kind, a space, and the name.
const PREFIX: &str = "word/";
/// The kind of a cell's name.
const CELL: u32 = 0;

/// The numbers of names, which are kept in the store. The number of a name never changes.
#[derive(Debug, Default)]
pub struct NameNumbers {
    numbers: HashMap<(u32, String), u32>,
    words: Vec<(u32, String)>,
}

/// A record.
#[derive(Debug, Clone, PartialEq)]
pub struct Record {
    /// The name of the cell.
    pub cell: String,
    /// The metrics that the cell reports.
    pub metrics: Vec<Metric>,
}

#[derive(Clone, PartialEq, Message)]
struct Compact {
    #[prost(uint32, tag = "1")]
    cell: u32,
    #[prost(uint64, tag = "2")]
    at: u64,
    #[prost(message, repeated, tag = "3")]
    items: Vec<Item>,
}

#[derive(Clone, PartialEq, Message)]
struct Item {
    #[prost(uint32, tag = "1")]
    word: u32,
    /// The quality of a metric without a value.
    #[prost(uint32, optional, tag = "2")]
    quality: Option<u32>,
    #[prost(oneof = "Value", tags = "10, 11, 12, 13, 14, 15")]
    value: Option<Value>,
}

impl NameNumbers {
    /// Reads the words of the store.
    ///
    /// # Errors
    /// If the store cannot be read.
    pub fn open(store: &Store) -> Result<Self> {
        let mut words = Self::default();
        let mut found: Vec<(u32, u32, String)> = Vec::new();
        for (key, value) in store.names(PREFIX)? {
            let number = key.strip_prefix(PREFIX).and_then(|number| number.parse().ok());
            let word = value.split_once(' ').and_then(|(kind, name)| Some((kind.parse().ok()?, name)));
            if let (Some(number), Some((kind, name))) = (number, word) {
                found.push((number, kind, name.to_owned()));
            }
        }
        found.sort_unstable();
        for (_, kind, name) in found {
            words.add(kind, &name);
        }
        Ok(words)
    }

    /// Gives numbers to a cell and its metrics.
    pub fn learn(&mut self, cell: &str, definitions: &[Definition], batch: &mut Batch) {
        let metrics = definitions.iter().map(|Definition { name, kind }| (kind.number(), *name));
        for (kind, name) in [(CELL, cell)].into_iter().chain(metrics) {
            if !self.numbers.contains_key(&(kind, name.to_owned())) {
                let number = self.add(kind, name);
                batch.names.push((format!("{PREFIX}{number}"), Some(format!("{kind} {name}"))));
            }
        }
    }

    fn add(&mut self, kind: u32, name: &str) -> u32 {
        let number = u32::try_from(self.words.len()).unwrap_or(u32::MAX);
        self.words.push((kind, name.to_owned()));
        self.numbers.insert((kind, name.to_owned()), number);
        number
    }

    /// Returns the record of a cell at this time, with metrics that were [learnt](Self::learn).
    pub fn pack(&self, cell: &str, at: u64, metrics: &[Metric]) -> Vec<u8> {
        let number =
            |kind, name: &str| self.numbers.get(&(kind, name.to_owned())).copied().unwrap_or(u32::MAX);
        let items = metrics.iter().map(|metric| Item {
            word: number(metric.datatype.unwrap_or_default(), metric.name.as_deref().unwrap_or_default()),
            quality: metric.quality(),
            value: metric.value.clone(),
        });
        Compact { cell: number(CELL, cell), at, items: items.collect() }.encode_to_vec()
    }

    /// Decodes a record; `None` if the bytes are not a record.
    pub fn unpack(&self, bytes: &[u8]) -> Option<Record> {
        let Compact { cell, at, items } = Compact::decode(bytes).ok()?;
        let word = |number: u32| self.words.get(number as usize);
        let metric = |Item { word: number, quality, value }| {
            let (kind, name) = word(number)?;
            let kind = Kind::of(*kind)?;
            Some(match quality.and_then(Quality::of) {
                Some(quality) if value.is_none() => Metric::null(name, kind, at, quality),
                _ => Metric::new(name, kind, at, value),
            })
        };
        let (_, cell) = word(cell).filter(|(kind, _)| *kind == CELL)?;
        Some(Record { cell: cell.clone(), metrics: items.into_iter().filter_map(metric).collect() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metric::{define, whole};

    #[test]
    fn a_record_is_what_it_was_also_after_another_start() {
        let folder = tempfile::tempdir().unwrap();
        let mut store = Store::open(&folder.path().join("store"), 1 << 20).unwrap();
        let definitions =
            [define("a/b", Kind::Int64), define("a/b", Kind::Float), define("c d", Kind::String)];
        let mut batch = Batch::default();
        let mut words = NameNumbers::default();
        words.learn("x", &definitions[..1], &mut batch);
        words.learn("y", &definitions, &mut batch);
        store.write(&batch, &|_| Vec::new()).unwrap();
        let metrics = vec![
            Metric::new("a/b", Kind::Int64, 7, Some(whole(-1))),
            Metric::new("a/b", Kind::Float, 7, Some(Value::Float(0.5))),
            Metric::null("c d", Kind::String, 7, Quality::Stale),
            Metric::null("c d", Kind::String, 7, Quality::Bad),
        ];
        let bytes = words.pack("y", 7, &metrics);
        assert!(bytes.len() < 60, "{}", bytes.len());
        let again = NameNumbers::open(&store).unwrap();
        assert_eq!(again.unpack(&bytes), Some(Record { cell: "y".into(), metrics }));
        let mut batch = Batch::default();
        let mut again = again;
        again.learn("y", &definitions, &mut batch);
        assert!(batch.names.is_empty());
        assert_eq!(again.unpack(&[0xFF]), None);
    }
}
