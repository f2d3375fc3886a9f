//! Drafts of settings that the bytes do not determine: the meanings of an installation's words, guessed from the times at which
//! they are sent, to be corrected by hand.

mod kawasaki;
mod laser;
#[cfg(test)]
mod tests;

use std::time::Duration;

use anyhow::{Result, bail};
use serde_json::{Map, Value, json};

use super::{Finding, Stream};
use cellwire_links::codec;

/// The least number of observations that count: a single one may be chance.
const MIN_SIGHTINGS: usize = 2;

/// A message of a conversation.
#[derive(Debug, Clone)]
struct SentMessage {
    side: &'static str,
    message: Value,
    /// When it began to arrive; zero if the capture has no times.
    time: Duration,
}

/// Returns the text of a settings file. A remark that begins with `?` marks an uncertain entry.
///
/// # Errors
/// If the link's source states the meanings of its words.
pub fn draft(finding: &Finding, streams: &[Stream]) -> Result<String> {
    match finding.link.name {
        "kawasaki-msg" => {
            let charset = finding.settings.get("charset").and_then(Value::as_str).unwrap_or("ascii");
            let settings = Map::from_iter([("charset".into(), json!(charset))]);
            kawasaki::draft(&said(finding, streams, &settings)?, charset)
        }
        "laser-eb90" => laser::draft(&said(finding, streams, &finding.settings)?),
        name => bail!("{name} has no words of an installation's own: there is nothing to draft"),
    }
}

/// Returns a text as a value of TOML, with an escape for each character that could end it or control a terminal.
pub fn toml_text(text: &str) -> String {
    let mut quoted = String::from("\"");
    for c in text.chars() {
        match c {
            '"' | '\\' => quoted.extend(['\\', c]),
            c if c.is_control() => quoted.push_str(&format!("\\u{:04X}", u32::from(c))),
            c => quoted.push(c),
        }
    }
    quoted.push('"');
    quoted
}

/// Returns the messages of both ends, in sequence.
fn said(finding: &Finding, streams: &[Stream], settings: &Map<String, Value>) -> Result<Vec<SentMessage>> {
    let mut all = Vec::new();
    for (stream, sides) in streams.iter().zip(&finding.senders) {
        let parts: Vec<Vec<&[u8]>> = stream.parts.iter().map(|part| vec![part.as_slice()]).collect();
        let mut found = Vec::new();
        for side in sides {
            for item in codec::items((finding.link.codec)(side, settings)?, &parts)? {
                let Ok(json) = item.content else { continue };
                let begin = usize::try_from(item.offset)?;
                // It is there when its last byte is.
                let end = begin + usize::try_from(item.length)?;
                let arrived = stream.arrivals.partition_point(|(place, _)| *place < end);
                let time = arrived.checked_sub(1).and_then(|at| stream.arrivals.get(at));
                let time = time.map_or(Duration::ZERO, |(_, time)| *time);
                found.push((begin, SentMessage { side, message: serde_json::from_str(&json)?, time }));
            }
        }
        found.sort_by_key(|(begin, _)| *begin);
        all.extend(found.into_iter().map(|(_, said)| said));
    }
    all.sort_by_key(|said| said.time);
    Ok(all)
}
