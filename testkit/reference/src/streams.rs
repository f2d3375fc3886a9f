//! `reference/streams/<link>.json`: byte streams and everything that a decoder makes of them.

use std::path::Path;

use anyhow::{Context, Result, ensure};
use cellwire_links::codec::StreamItem;
use cellwire_links::vectors::unhex;
use serde::Deserialize;
use serde_json::{Map, Value};

use crate::codec::{codec, read_every_way};
use crate::json::{self, Object};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Inputs {
    streams: Vec<Stream>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Stream {
    id: u32,
    comment: String,
    from: Option<String>,
    #[serde(default)]
    options: Map<String, Value>,
    /// `|` is an end.
    hex: String,
    clauses: Vec<String>,
}

/// Returns the text of a link's file, if it has streams.
pub(crate) fn file(root: &Path, link: &str) -> Result<Option<String>> {
    let Some(inputs) = crate::input::<Inputs>(root, "streams", link)? else { return Ok(None) };
    let mut lines = Vec::new();
    for (index, stream) in inputs.streams.iter().enumerate() {
        ensure!(stream.id as usize == index + 1, "stream {} of {link} is in place {}", stream.id, index + 1);
        lines.push(line(link, stream).with_context(|| format!("stream {} of {link}", stream.id))?);
    }
    Ok(Some(json::file(
        "streams.schema.json",
        &[("link", json::text(link)?), ("independent", crate::INDEPENDENT.into())],
        "streams",
        &lines,
    )))
}

fn line(link: &str, stream: &Stream) -> Result<String> {
    let parts = stream.hex.split('|').map(unhex).collect::<Result<Vec<_>>>()?;
    let make = || codec(link, stream.from.as_deref(), &stream.options);
    let items: Vec<String> = read_every_way(&make, &parts)?.iter().map(item).collect();
    let options = (!stream.options.is_empty()).then_some(&stream.options);
    Ok(Object::new()
        .value("id", &stream.id)?
        .value("comment", &stream.comment)?
        .optional("from", stream.from.as_ref())?
        .optional("options", options)?
        .value("hex", &stream.hex)?
        .value("clauses", &stream.clauses)?
        .raw("items", format_args!("[\n      {}\n    ]", items.join(",\n      ")))
        .end())
}

fn item(item: &StreamItem) -> String {
    let object = Object::new().raw("offset", item.offset).raw("length", item.length);
    let object = if item.at_end { object.raw("end", "true") } else { object };
    match &item.content {
        Ok(message) => object.raw("message", json::spaced(message)),
        Err(error) => object.raw("error", json::spaced(error)),
    }
    .end()
}
