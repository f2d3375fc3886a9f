//! A conversation as a tap sees it, and the shadow's complaints about it.

use core::time::Duration;
use std::collections::BTreeMap;

use cellwire_links::Link;
use cellwire_links::codec::{Kind, Stream};
use cellwire_links::shadow::{Complaint, LineEvent, Setup, Watcher};
use cellwire_links::vectors::unhex;
use serde_json::{Map, Value, json};

/// A story of `reference/sessions`, as what passes between its ends.
#[derive(Debug, Clone)]
pub(crate) struct Story {
    pub(crate) id: u64,
    pub(crate) comment: String,
    /// The end that is driven: its session is ours.
    pub(crate) end: &'static str,
    pub(crate) config: Map<String, Value>,
    pub(crate) told: Vec<Recorded>,
    /// The end's driver is late somewhere, or cannot send: its bytes are later than its session requests.
    pub(crate) is_late: bool,
}

/// A recorded event of the conversation.
#[derive(Debug, Clone)]
pub(crate) struct Recorded {
    pub(crate) at: Duration,
    pub(crate) what: RecordedBody,
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) enum RecordedBody {
    Opened,
    Closed,
    Bytes(&'static str, Vec<u8>),
}

/// A complaint or a decoder error, and its place in the conversation.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct LocatedComplaint {
    pub(crate) place: usize,
    pub(crate) complaint: Complaint,
}

/// Returns the stories of a link.
pub(crate) fn stories(link: &Link) -> Vec<Story> {
    let path = format!("{}/../reference/sessions/{}.json", env!("CARGO_MANIFEST_DIR"), link.name);
    let file: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    file["stories"].as_array().unwrap().iter().map(|story| read(link, story)).collect()
}

fn read(link: &Link, story: &Value) -> Story {
    // The device of a story is a platform.
    let side = |name: &'static str| match (link.name, name) {
        ("mmacell-proto", "device") => "platform",
        ("val2-alter", "controller") => "robot",
        _ => name,
    };
    let end = link.end(story["end"].as_str().unwrap()).unwrap().name;
    let other = side(link.ends.iter().find(|other| other.name != end).unwrap().name);
    let end = side(end);
    let (mut told, mut due, mut is_late, mut is_connected) = (Vec::new(), None, false, false);
    for step in story["steps"].as_array().unwrap() {
        let at = step["at"].as_u64().unwrap();
        is_late |= step.get("hold").is_some() || due.is_some_and(|due| at > due);
        let at = Duration::from_nanos(at);
        let (call, argument) = step["do"].as_object().unwrap().iter().next().unwrap();
        match call.as_str() {
            "connected" | "disconnected" => {
                is_connected = call == "connected";
                told.push(Recorded {
                    at,
                    what: if is_connected { RecordedBody::Opened } else { RecordedBody::Closed },
                });
            }
            // Nothing passes without a connection.
            "input" if is_connected => {
                let bytes = unhex(argument.as_str().unwrap()).unwrap();
                told.push(Recorded { at, what: RecordedBody::Bytes(other, bytes) });
            }
            _ => {}
        }
        for bytes in step["transmit"].as_array().into_iter().flatten() {
            let bytes = unhex(bytes.as_str().unwrap()).unwrap();
            told.push(Recorded { at, what: RecordedBody::Bytes(end, bytes) });
        }
        due = step["deadline"].as_u64();
    }
    let (id, comment) = (story["id"].as_u64().unwrap(), story["comment"].as_str().unwrap().into());
    Story { id, comment, end, config: story["config"].as_object().unwrap().clone(), told, is_late }
}

impl Story {
    /// Returns the settings of the link's codec.
    pub(crate) fn settings(&self, link: &Link) -> Map<String, Value> {
        let known: Vec<String> = (link.settings)().into_iter().map(|setting| setting.name).collect();
        let mut settings = Map::new();
        for (name, value) in &self.config {
            match (name.as_str(), value) {
                ("profile", Value::Object(profile)) => settings.extend(profile.clone()),
                ("framing", Value::String(framing)) if framing.starts_with("rtu") => {
                    settings.insert("framing".into(), json!("rtu"));
                }
                _ if known.iter().any(|known| known == name) => {
                    drop(settings.insert(name.clone(), value.clone()))
                }
                _ => {}
            }
        }
        settings
    }

    /// Returns all complaints about a conversation with these events.
    pub(crate) fn say(&self, link: &Link, told: &[Recorded]) -> Vec<LocatedComplaint> {
        self.watch(link, told, &mut |_| ())
    }

    /// Watches the conversation; passes the shadow's state to `state` before each event and at the end.
    pub(crate) fn watch(
        &self,
        link: &Link,
        told: &[Recorded],
        state: &mut dyn FnMut(String),
    ) -> Vec<LocatedComplaint> {
        let end = match (link.name, self.end) {
            ("mmacell-proto", "platform") => "device",
            ("val2-alter", "robot") => "controller",
            (_, end) => end,
        };
        let configs = json!({end: self.config});
        let settings = self.settings(link);
        let (configs, is_serial) = (configs.as_object().unwrap(), self.config.get("framing").is_some());
        let setup = Setup { settings: &settings, configs, baud: None, is_serial };
        let mut watcher = Watcher::new((link.shadow)(&setup).unwrap());
        let make = |side| Stream::new((link.codec)(side, &settings).unwrap()).without(link.flow_control);
        let mut streams: BTreeMap<&str, Stream> = BTreeMap::new();
        let mut said = Vec::new();
        for (place, told) in told.iter().enumerate() {
            state(watcher.state());
            let mut see = |seen: &LineEvent<'_>| {
                let complaints = watcher.see(told.at, seen).into_iter();
                said.extend(complaints.map(|complaint| LocatedComplaint { place, complaint }));
            };
            let (from, bytes) = match &told.what {
                RecordedBody::Opened => {
                    streams.clear();
                    see(&LineEvent::Opened);
                    continue;
                }
                RecordedBody::Closed => {
                    streams.clear();
                    see(&LineEvent::Closed);
                    continue;
                }
                RecordedBody::Bytes(from, bytes) => (*from, bytes),
            };
            if bytes.is_empty() {
                continue;
            }
            see(&LineEvent::Bytes { from, bytes });
            if !link.sides.contains(&from) {
                continue;
            }
            let mut items = Vec::new();
            let stream = streams.entry(from).or_insert_with(|| make(from));
            let mut take = |item: cellwire_links::codec::Item<'_>| {
                items.push((item.length, item.kind, serde_json::from_slice::<Value>(item.json)?));
                Ok(())
            };
            stream.push(bytes, &mut take).unwrap();
            if self.config.get("datagrams").is_some() {
                stream.finish(&mut take).unwrap();
            }
            for (length, kind, json) in items {
                match kind {
                    Kind::Message => see(&LineEvent::Message { from, length, message: &json }),
                    Kind::Error => see(&LineEvent::Corrupt { from, length, error: &json }),
                }
            }
        }
        // Nothing more happens: report the messages that are missing by then.
        let complaints = watcher.pass(told.last().map_or(MAX_WAIT, |told| told.at + MAX_WAIT)).into_iter();
        said.extend(complaints.map(|complaint| LocatedComplaint { place: told.len(), complaint }));
        state(watcher.state());
        said
    }
}

/// Longer than any end waits.
const MAX_WAIT: Duration = Duration::from_secs(3600);
