//! Conversations at the limits of a shadow's knowledge and of its times, each with all complaints about it.

use core::time::Duration;
use std::collections::BTreeMap;

use cellwire_links::Link;
use cellwire_links::codec::{Item, Kind, Stream};
use cellwire_links::shadow::{Complaint, LineEvent, Setup, Watcher};
use cellwire_links::vectors::unhex;
use serde_json::{Map, Value};

/// Returns the file with the present complaints. A line `LINK CONFIGURATIONS SETTINGS` applies to the conversations after it,
/// each of which is a line of its own: the events, each with its millisecond. An event is `opened`, `closed`, `state`, a side
/// with its bytes or its message, or a name that a line `= NAME SIDE …` has given to bytes or a message.
fn said(file: &str) -> String {
    let (mut text, mut names) = (String::new(), BTreeMap::new());
    let mut setup = None::<(&Link, [Map<String, Value>; 2])>;
    for line in file.lines().filter(|line| !line.starts_with('>')) {
        text += &format!("{line}\n");
        match line.as_bytes().first() {
            Some(b'0'..=b'9') => {
                let (link, [configs, settings]) = setup.as_ref().unwrap();
                for said in conversation(link, configs, settings, &names, line) {
                    text += &format!("> {said}\n");
                }
            }
            Some(b'=') => drop(line[2..].split_once(' ').map(|(name, what)| names.insert(name, what))),
            Some(b'a'..=b'z') => {
                let (link, given) = line.split_once(' ').unwrap();
                let mut given = serde_json::Deserializer::from_str(given).into_iter::<Map<String, Value>>();
                let given = [(); 2].map(|()| given.next().unwrap().unwrap());
                setup = Some((Link::by_name(link).unwrap(), given));
            }
            _ => {}
        }
    }
    text
}

fn conversation(
    link: &Link,
    configs: &Map<String, Value>,
    settings: &Map<String, Value>,
    names: &BTreeMap<&str, &str>,
    line: &str,
) -> Vec<String> {
    let setup = Setup { settings, configs, baud: None, is_serial: false };
    let mut watcher = Watcher::new((link.shadow)(&setup).unwrap());
    let codec = |side| (link.codec)(side, settings).unwrap();
    let (mut streams, mut said) = (BTreeMap::<&str, Stream>::new(), Vec::new());
    for (ms, what) in line.split("; ").map(|event| event.split_once(' ').unwrap()) {
        let at = Duration::from_secs_f64(ms.parse::<f64>().unwrap() / 1e3);
        let mut see = |seen: &LineEvent<'_>| {
            said.extend(watcher.see(at, seen).iter().map(|it| shown(ms, it)));
        };
        if ["opened", "closed"].contains(&what) {
            streams.clear();
        }
        let Some((from, what)) = names.get(what).unwrap_or(&what).split_once(' ') else {
            match what {
                "opened" => see(&LineEvent::Opened),
                "closed" => see(&LineEvent::Closed),
                _ => {
                    said.extend(watcher.pass(at).iter().map(|it| shown(ms, it)));
                    said.push(format!("{ms} {}", watcher.state()));
                }
            }
            continue;
        };
        // The ends that only poll send no messages.
        let mut ends = link.sides.iter().copied().chain(["host", "workstation"]);
        let from = ends.find(|end| *end == from).unwrap();
        let bytes = match serde_json::from_str::<Value>(what) {
            Ok(message @ Value::Object(_)) => codec(from).encode(message).unwrap(),
            _ => unhex(what).unwrap(),
        };
        see(&LineEvent::Bytes { from, bytes: &bytes });
        if !link.sides.contains(&from) {
            continue;
        }
        let mut take = |Item { length, kind, json, .. }: Item<'_>| {
            let json = &serde_json::from_slice::<Value>(json)?;
            match kind {
                Kind::Message => see(&LineEvent::Message { from, length, message: json }),
                Kind::Error => see(&LineEvent::Corrupt { from, length, error: json }),
            }
            Ok(())
        };
        streams.entry(from).or_insert_with(|| Stream::new(codec(from))).push(&bytes, &mut take).unwrap();
    }
    said
}

fn shown(ms: &str, Complaint { end, kind, clause, text, .. }: &Complaint) -> String {
    format!("{ms} {end} {kind:?} {clause}: {text}")
}

#[test]
fn what_is_said_at_the_edges_is_listed() {
    let path = format!("{}/tests/it/shadow/edges.txt", env!("CARGO_MANIFEST_DIR"));
    let given = std::fs::read_to_string(&path).unwrap();
    let text = said(&given);
    if std::env::var_os("BLESS").is_some() {
        std::fs::write(&path, &text).unwrap();
    }
    assert_eq!(text, given, "set BLESS to write it");
}
