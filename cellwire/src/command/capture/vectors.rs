//! The messages of a stretch as vectors, and each side's bytes as a stream.

use anyhow::Result;
use cellwire_links::codec::{StreamItem, items};
use cellwire_links::reference::json::{Object, hex, spaced};
use serde_json::Value;

use super::VectorsArgs;
use super::message::Message;
use cellwire_io::output::{counted, remark};

pub(super) fn run(args: &VectorsArgs) -> Result<bool> {
    let of = &args.stretch.of;
    let (_, messages) = args.stretch.read()?;
    let options = Value::Object(of.settings()?);
    let options = options.as_object().is_some_and(|it| !it.is_empty()).then_some(options);
    let (mut vectors, mut streams, mut silent) = (Vec::new(), Vec::new(), 0);
    let mut known: Vec<&[u8]> = Vec::new();
    for message in &messages {
        let Some(side) = message.side else {
            silent += 1;
            continue;
        };
        let Ok(content) = &message.content else { continue };
        if known.contains(&&message.bytes[..]) {
            continue;
        }
        known.push(&message.bytes);
        let written = of.codec_of(side)?.encode(content.clone());
        let is_written = written.is_ok_and(|bytes| bytes == message.bytes);
        let object = Object::new()
            .raw("id", vectors.len() + 1)
            .value("comment", &format!("Message {}, {:.6} s", message.number, message.at.as_secs_f64()))?
            .value("from", side)?
            .optional("options", options.as_ref())?
            .value("hex", &hex(&message.bytes))?
            .value("result", if is_written { "valid" } else { "acceptable" })?
            .raw("message", spaced(&content.to_string()))
            .raw("clauses", "[]");
        vectors.push(object.end());
    }
    for side in of.link.sides {
        let its: Vec<&Message> = messages.iter().filter(|message| message.side == Some(*side)).collect();
        let (Some(first), Some(last)) = (its.first(), its.last()) else { continue };
        // After a gap another stream begins: an end stands for the gap.
        let mut parts: Vec<Vec<u8>> = vec![Vec::new()];
        for message in &its {
            if message.after_gap && parts.last().is_some_and(|part| !part.is_empty()) {
                parts.push(Vec::new());
            }
            if let Some(part) = parts.last_mut() {
                part.extend_from_slice(&message.bytes);
            }
        }
        let pieces: Vec<Vec<&[u8]>> = parts.iter().map(|part| vec![part.as_slice()]).collect();
        let found: Vec<String> = items(of.codec_of(side)?, &pieces)?.iter().map(item).collect();
        let digits: Vec<String> = parts.iter().map(|part| hex(part)).collect();
        let object = Object::new()
            .raw("id", streams.len() + 1)
            .value("comment", &format!("Messages {} to {} of one side", first.number, last.number))?
            .value("from", side)?
            .optional("options", options.as_ref())?
            .value("hex", &digits.join("|"))?
            .raw("clauses", "[]")
            .raw("items", format_args!("[\n      {}\n    ]", found.join(",\n      ")));
        streams.push(object.end());
    }
    if silent > 0 {
        remark(&format!("left out: {} of an end that sends no messages", counted(silent, "piece")));
    }
    let lists: Vec<(&str, Vec<String>)> = [("vectors", vectors), ("streams", streams)]
        .into_iter()
        .filter(|(_, items)| !items.is_empty())
        .collect();
    anyhow::ensure!(!lists.is_empty(), "the range has no messages of either side");
    args.out.write(of.link.name, &lists)?;
    Ok(true)
}

fn item(item: &StreamItem) -> String {
    let object = Object::new().raw("offset", item.offset).raw("length", item.length);
    let object = if item.at_end { object.raw("end", "true") } else { object };
    match &item.content {
        Ok(message) => object.raw("message", spaced(message)),
        Err(error) => object.raw("error", spaced(error)),
    }
    .end()
}
