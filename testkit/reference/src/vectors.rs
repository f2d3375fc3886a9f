//! `reference/vectors/<link>.json`: frames, each with its message or its error, and the messages that an encoder rejects.

use std::path::Path;

use anyhow::{Context, Result, bail, ensure};
use cellwire_links::vectors::{includes, unhex};
use serde::Deserialize;
use serde_json::{Map, Value};

use crate::codec::{codec, read_every_way};
use crate::json::{self, Object};
use crate::values;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Inputs {
    source: String,
    vectors: Vec<Vector>,
    #[serde(default)]
    refused: Vec<Refused>,
    #[serde(default)]
    values: Vec<values::Inputs>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Vector {
    id: u32,
    comment: String,
    from: Option<String>,
    #[serde(default)]
    options: Map<String, Value>,
    hex: String,
    /// The message that another decoder has made of the bytes; compared with that of our decoder.
    message: Option<Value>,
    error: Option<Value>,
    source: String,
    #[serde(default)]
    flags: Vec<String>,
    clauses: Vec<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Refused {
    id: u32,
    comment: String,
    from: Option<String>,
    #[serde(default)]
    options: Map<String, Value>,
    message: Value,
    clauses: Vec<String>,
}

/// Returns the text of a link's file.
pub(crate) fn file(root: &Path, link: &str) -> Result<String> {
    let inputs: Inputs =
        crate::input(root, "vectors", link)?.with_context(|| format!("{link} has no vectors"))?;
    let mut lines = Vec::new();
    for vector in &inputs.vectors {
        lines.push(line(link, vector).with_context(|| format!("vector {} of {link}", vector.id))?);
    }
    let mut refused = Vec::new();
    for vector in &inputs.refused {
        refused.push(refuse(link, vector).with_context(|| format!("refused {} of {link}", vector.id))?);
    }
    let mut head = vec![
        ("link", json::text(link)?),
        ("source", json::text(&inputs.source)?),
        ("independent", crate::INDEPENDENT.into()),
    ];
    if !refused.is_empty() {
        head.push(("refused", format!("[\n    {}\n  ]", refused.join(",\n    "))));
    }
    if !inputs.values.is_empty() {
        let mut values = Vec::new();
        for vector in &inputs.values {
            values.push(values::line(vector).with_context(|| format!("a value of {link}"))?);
        }
        head.push(("values", format!("[\n    {}\n  ]", values.join(",\n    "))));
    }
    Ok(json::file("vectors.schema.json", &head, "vectors", &lines))
}

fn line(link: &str, vector: &Vector) -> Result<String> {
    let bytes = unhex(&vector.hex)?;
    let make = || codec(link, vector.from.as_deref(), &vector.options);
    let items = read_every_way(&make, core::slice::from_ref(&bytes))?;
    let object = Object::new()
        .value("id", &vector.id)?
        .value("comment", &vector.comment)?
        .optional("from", vector.from.as_ref())?
        .optional("options", (!vector.options.is_empty()).then_some(&vector.options))?
        .value("hex", &vector.hex)?;
    let object = match items.as_slice() {
        [item] if item.content.is_ok() => {
            let message = item.content.clone().unwrap_or_default();
            let value: Value = serde_json::from_str(&message)?;
            if let Some(stated) = &vector.message {
                ensure!(*stated == value, "decodes to {message}, not to {stated}");
            }
            ensure!(vector.error.is_none(), "decodes to {message}, not to an error");
            let is_same = make()?.encode(value).is_ok_and(|encoded| encoded == bytes);
            let result = if is_same { "valid" } else { "acceptable" };
            let object = object.value("result", result)?;
            (if item.at_end { object.raw("end", "true") } else { object })
                .raw("message", json::spaced(&message))
        }
        items => {
            // A stated error may be any of the errors; otherwise the first one counts.
            let errors = items.iter().filter_map(|item| Some((item, item.content.as_ref().err()?)));
            let mut fitting = errors.filter(|(_, error)| {
                let error = serde_json::from_str(error).unwrap_or_default();
                vector.error.as_ref().is_none_or(|stated| includes(&error, stated))
            });
            let Some((item, error)) = fitting.next() else { bail!("gives {items:?}") };
            ensure!(vector.message.is_none(), "gives {error}, not a message");
            let first = items.first().is_some_and(|first| first == item);
            ensure!(first, "the error is not the first item: {items:?}");
            let object = object.value("result", "invalid")?;
            let object = if item.at_end { object.raw("end", "true") } else { object };
            object.raw("only", items.len() == 1).raw("error", json::spaced(error))
        }
    };
    Ok(object
        .value("source", &vector.source)?
        .optional("flags", (!vector.flags.is_empty()).then_some(&vector.flags))?
        .value("clauses", &vector.clauses)?
        .end())
}

fn refuse(link: &str, vector: &Refused) -> Result<String> {
    let codec = codec(link, vector.from.as_deref(), &vector.options)?;
    let Err(error) = codec.encode(vector.message.clone()) else { bail!("the encoder writes it") };
    Ok(Object::new()
        .value("id", &vector.id)?
        .value("comment", &vector.comment)?
        .optional("from", vector.from.as_ref())?
        .optional("options", (!vector.options.is_empty()).then_some(&vector.options))?
        .value("message", &vector.message)?
        .raw("error", json::spaced(error.json()))
        .value("clauses", &vector.clauses)?
        .end())
}
