//! What was seen at a machine, as vectors, streams and stories: the files of `reference/field/`.

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
    /// The link's name.
    pub link: String,
    /// What was recorded.
    pub source: String,
    /// Frames.
    #[serde(default)]
    pub vectors: Vec<Vector>,
    /// What a side sent.
    #[serde(default)]
    pub streams: Vec<Stream>,
    /// What an end was given and did.
    #[serde(default)]
    pub stories: Vec<Story>,
}

/// The bytes of a side, and what a decoder makes of them.
#[derive(Debug, Clone, Deserialize)]
pub struct Stream {
    /// Its number.
    pub id: u32,
    /// What it shows.
    pub comment: String,
    /// The side.
    pub from: Option<String>,
    /// Settings other than the link's defaults.
    #[serde(default)]
    pub options: Map<String, Value>,
    /// The bytes; `|` is an end.
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
    /// When it cannot be read, or is none.
    pub fn read(path: &Path) -> Result<Self> {
        let text = fs::read_to_string(path).with_context(|| path.display().to_string())?;
        serde_json::from_str(&text).with_context(|| path.display().to_string())
    }

    /// Checks everything in it; how much that was.
    ///
    /// # Errors
    /// What our decoders or ends make of it instead.
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
    /// Whether a decoder makes of the bytes, whole and byte by byte, what the stream says.
    ///
    /// # Errors
    /// What it makes instead.
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
