//! Recordings from machines as vectors, streams and stories: the files of `reference/field/`.

use std::fs;
use std::path::Path;

use anyhow::{Context, Result, ensure};
use serde::Deserialize;
use serde_json::{Map, Value};

use super::story::Story;
use crate::codec::items;
use crate::link::Link;
use crate::vectors::{Vector, unhex};

/// A file.
#[derive(Debug, Clone, Deserialize)]
pub struct Field {
    /// The name of the link.
    pub link: String,
    /// A description of the recording.
    pub source: String,
    /// The frames, each with its object.
    #[serde(default)]
    pub vectors: Vec<Vector>,
    /// The recorded bytes, each stream of one side.
    #[serde(default)]
    pub streams: Vec<Stream>,
    /// The inputs of an end, and its actions.
    #[serde(default)]
    pub stories: Vec<Story>,
}

/// The bytes of a side, and the items that a decoder finds in them.
#[derive(Debug, Clone, Deserialize)]
pub struct Stream {
    /// The number of the stream.
    pub id: u32,
    /// A description of the stream.
    pub comment: String,
    /// The side that sent the bytes; `None` for the link's first.
    pub from: Option<String>,
    /// Settings other than the link's defaults.
    #[serde(default)]
    pub options: Map<String, Value>,
    /// The bytes in hex; `|` is an end of the stream.
    pub hex: String,
    items: Vec<Item>,
}

#[derive(Debug, Clone, Deserialize)]
struct Item {
    offset: u64,
    length: u64,
    #[serde(default)]
    end: bool,
    message: Option<Value>,
    error: Option<Value>,
}

impl Field {
    /// Reads a file.
    ///
    /// # Errors
    /// If it cannot be read, or does not contain such data.
    pub fn read(path: &Path) -> Result<Self> {
        let text = fs::read_to_string(path).with_context(|| path.display().to_string())?;
        serde_json::from_str(&text).with_context(|| path.display().to_string())
    }

    /// Checks all vectors, streams and stories; returns their number.
    ///
    /// # Errors
    /// The first difference from the results of our decoders and ends.
    pub fn check(&self) -> Result<usize> {
        let link = Link::by_name(&self.link)?;
        for vector in &self.vectors {
            vector.check(link, &[&vector.bytes]).with_context(|| format!("vector {}", vector.id))?;
        }
        for stream in &self.streams {
            stream.check(link).with_context(|| format!("stream {}", stream.id))?;
        }
        for story in &self.stories {
            story.check(link).with_context(|| format!("story {}", story.id))?;
        }
        Ok(self.vectors.len() + self.streams.len() + self.stories.len())
    }
}

impl Stream {
    /// Checks that a decoder returns the stream's items for the bytes, whole and byte by byte.
    ///
    /// # Errors
    /// The items that it returns instead.
    pub fn check(&self, link: &Link) -> Result<()> {
        let parts = self.hex.split('|').map(unhex).collect::<Result<Vec<_>>>()?;
        let whole: Vec<Vec<&[u8]>> = parts.iter().map(|part| vec![part.as_slice()]).collect();
        let bytes = parts.iter().map(|part| part.chunks(1).collect()).collect();
        let side = link.side(self.from.as_deref())?;
        for pieces in [whole, bytes] {
            let found = items((link.codec)(side, &self.options)?, &pieces)?;
            ensure!(
                found.len() == self.items.len(),
                "it has {} items, not {}",
                found.len(),
                self.items.len()
            );
            for (found, item) in found.iter().zip(&self.items) {
                let expected = item.message.clone().ok_or_else(|| item.error.clone().unwrap_or_default());
                let is_same = (found.offset, found.length, found.at_end)
                    == (item.offset, item.length, item.end)
                    && found.value()? == expected;
                ensure!(is_same, "at byte {} it is {found:?}", item.offset);
            }
        }
        Ok(())
    }
}
