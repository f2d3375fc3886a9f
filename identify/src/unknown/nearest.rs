//! Finds the link that is nearest to unexplained bytes: its decoder finds the most beginnings of messages in them. Also returns
//! the decoder's errors.

use std::collections::HashMap;

use anyhow::Result;
use serde::Serialize;
use serde_json::{Map, Value};

use super::super::Stream;
use cellwire_links::codec;
use cellwire_links::link::Link;

/// The errors of a decoder for bytes in which it finds no beginning of a message.
const NO_BEGINNING: [&str; 9] = [
    "garbage",
    "start_mark",
    "noise",
    "no_head",
    "incomplete",
    "unknown_command",
    "unknown_reply",
    "too_long",
    "short",
];

/// The result for a link: its nearest settings, and the messages that begin like its own.
#[derive(Debug, Clone, Serialize)]
pub struct Nearest {
    /// The name of the link.
    pub link: &'static str,
    /// The settings with which the link is nearest, without the defaults.
    pub settings: Map<String, Value>,
    /// The side of the link that sends such messages.
    pub side: &'static str,
    /// The number of messages that begin like those of the link.
    pub begin: usize,
    /// The number of these messages that are whole.
    pub whole: usize,
    /// The kind of the most frequent error in the others; `None` without errors.
    pub wrong: Option<String>,
}

/// Returns the result for each link with its defaults, or one setting changed; the nearest first.
///
/// # Errors
/// If a decoder makes no progress: it is a defect.
pub fn nearest(links: &[&'static Link], streams: &[Stream]) -> Result<Vec<Nearest>> {
    let mut found = Vec::new();
    for link in links {
        let mut best: Option<Nearest> = None;
        for settings in one_changed(link) {
            for stream in streams {
                for side in stream.sides(link, &[]) {
                    let near = near(link, side, &settings, stream)?;
                    if near.begin > best.as_ref().map_or(0, |best| best.begin) {
                        best = Some(near);
                    }
                }
            }
        }
        found.extend(best);
    }
    found.sort_by_key(|near| core::cmp::Reverse(near.begin));
    Ok(found)
}

/// Returns the defaults, and the defaults with each open setting changed alone.
fn one_changed(link: &Link) -> Vec<Map<String, Value>> {
    let known = (link.settings)();
    let open = known.iter().filter(|setting| link.open.settings.contains(&setting.name.as_str()));
    let others = open.flat_map(|setting| {
        let values = setting.choices.iter().filter(|value| **value != setting.default);
        values.map(|value| Map::from_iter([(setting.name.clone(), value.clone())]))
    });
    core::iter::once(Map::new()).chain(others).collect()
}

fn near(
    link: &'static Link,
    side: &'static str,
    settings: &Map<String, Value>,
    stream: &Stream,
) -> Result<Nearest> {
    let parts: Vec<Vec<&[u8]>> = stream.parts.iter().map(|part| vec![part.as_slice()]).collect();
    let (mut whole, mut kinds) = (0, HashMap::<String, usize>::new());
    for item in codec::items((link.codec)(side, settings)?, &parts)? {
        match item.value()? {
            Ok(_) => whole += 1,
            Err(error) => {
                let kind = error.get("kind").and_then(Value::as_str).unwrap_or_default();
                if !NO_BEGINNING.contains(&kind) {
                    *kinds.entry(kind.to_owned()).or_default() += 1;
                }
            }
        }
    }
    let begin = whole + kinds.values().sum::<usize>();
    let wrong = kinds.into_iter().max_by_key(|(kind, count)| (*count, core::cmp::Reverse(kind.clone())));
    let wrong = wrong.map(|(kind, _)| kind);
    Ok(Nearest { link: link.name, settings: settings.clone(), side, begin, whole, wrong })
}
