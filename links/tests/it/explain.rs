//! Every vector of `reference/vectors`, explained: its parts are its bytes, each value has its own, and each clause is there.

use cellwire_links::explain::{Explanation, explain};
use cellwire_links::vectors::{Vector, vectors};
use cellwire_links::{LINKS, Link};
use serde_json::{Value, json};

/// Names of what depends on the values of a frame.
const DERIVED: [&str; 6] = ["checksum", "crc", "length", "count", "byte count", "select"];

fn of(link: &Link) -> Vec<Vector> {
    vectors(format!("{}/../reference/vectors/{}.json", env!("CARGO_MANIFEST_DIR"), link.name)).unwrap()
}

fn explained(link: &Link, vector: &Vector) -> Vec<Explanation> {
    let side = link.side(vector.from.as_deref()).unwrap();
    explain(link, side, &vector.options, &vector.bytes).unwrap()
}

/// Pushes the pointers of all values except null, lists and objects.
fn leaves(value: &Value, at: &str, all: &mut Vec<String>) {
    match value {
        Value::Object(map) => map.iter().for_each(|(key, value)| leaves(value, &format!("{at}/{key}"), all)),
        Value::Array(list) => {
            list.iter().enumerate().for_each(|(key, value)| leaves(value, &format!("{at}/{key}"), all));
        }
        Value::Null => {}
        _ => all.push(at.into()),
    }
}

#[test]
fn the_parts_of_a_message_are_its_bytes_and_its_values() {
    for link in LINKS {
        for vector in of(link) {
            let name = format!("{} {}", link.name, vector.id);
            let found = explained(link, &vector);
            let Some(message) = &vector.message else {
                let clause = link.clause(vector.error.unwrap()["kind"].as_str().unwrap());
                assert_eq!((found[0].clause, &found[0].parts[..]), (clause, &[][..]), "{name}");
                continue;
            };
            assert_eq!(found[0].message.as_ref(), Some(message), "{name}");
            let mut end = 0;
            for part in &found[0].parts {
                assert!(part.bytes.start == end || found[0].parts[0].bytes.end <= end, "{name}: {part:?}");
                assert!(part.bytes.start <= end && part.bytes.end >= end, "{name}: a gap, {part:?}");
                assert_ne!(part.name, "rest", "{name}");
                end = part.bytes.end;
                if part.name.starts_with('/') {
                    assert!(message.pointer(&part.name).is_some(), "{name}: no {}", part.name);
                }
            }
            assert_eq!(end, vector.bytes.len(), "{name}");
            let mut all = Vec::new();
            leaves(message, "", &mut all);
            for leaf in all {
                let parts = found[0].parts.iter().filter(|part| part.name == leaf).count();
                // The kind of a reply of ALTER's host follows from its length; an empty text has no bytes.
                let without = leaf == "/kind" && vector.from.as_deref() == Some("host")
                    || message.pointer(&leaf) == Some(&"".into());
                assert_eq!(parts, usize::from(!without), "{name}: {leaf}");
            }
        }
    }
}

#[test]
fn a_value_that_changes_changes_its_own_bytes() {
    for link in LINKS {
        let (mut parts, mut changed) = (0, 0);
        for vector in of(link).iter().filter(|vector| vector.message.is_some()) {
            let found = explained(link, vector).remove(0);
            let message = found.message.unwrap();
            let codec = vector.codec(link).unwrap();
            // Skip a message that would be written differently.
            if !codec.encode(message.clone()).is_ok_and(|bytes| bytes == vector.bytes) {
                continue;
            }
            for part in found.parts.iter().filter(|part| part.name.starts_with('/')) {
                parts += 1;
                let mut other = message.clone();
                let value = other.pointer_mut(&part.name).unwrap();
                *value = match &*value {
                    Value::Bool(on) => (!on).into(),
                    Value::Number(number) if number.is_i64() => (number.as_i64().unwrap() ^ 1).into(),
                    Value::Number(number) if number.as_f64() == Some(0.0) => 1.0.into(),
                    Value::Number(number) => (-number.as_f64().unwrap()).into(),
                    Value::String(text) => match text.strip_suffix(['0', 'a']) {
                        Some(begin) => format!("{begin}1").into(),
                        None => continue,
                    },
                    _ => continue,
                };
                let Ok(bytes) = codec.encode(other.clone()) else { continue };
                if bytes.len() != vector.bytes.len() || other["function"] != message["function"] {
                    continue;
                }
                let name = format!("{} {}: {}", link.name, vector.id, part.name);
                let differ: Vec<usize> =
                    (0..bytes.len()).filter(|at| bytes[*at] != vector.bytes[*at]).collect();
                assert!(differ.iter().any(|at| part.bytes.contains(at)), "{name}: {differ:?}, {part:?}");
                for at in differ {
                    let allowed = found.parts.iter().any(|it| {
                        it.bytes.contains(&at) && (it.name == part.name || DERIVED.contains(&&it.name[..]))
                    });
                    assert!(allowed, "{name}: byte {at}");
                }
                changed += 1;
            }
        }
        // Most of the others are texts with no digit at their end.
        assert!(changed * 4 > parts, "{}: {changed} of {parts}", link.name);
    }
}

#[test]
fn every_place_of_the_specification_is_there() {
    for link in LINKS {
        let path = format!("{}/../reference/{}.md", env!("CARGO_MANIFEST_DIR"), link.name);
        let text = std::fs::read_to_string(path).unwrap();
        let mut places: Vec<&str> = link.clauses.iter().map(|(_, clause)| *clause).collect();
        for vector in of(link) {
            let found = explained(link, &vector);
            places.extend(found.iter().flat_map(|it| &it.parts).map(|part| part.clause));
        }
        for place in places {
            let is_there = text.contains(&format!("**{place}**"))
                || text.lines().any(|line| {
                    let title = line.trim_start_matches('#').trim_start();
                    line.starts_with('#')
                        && title.strip_prefix(place).is_some_and(|rest| rest.starts_with(['.', ' ']))
                });
            assert!(is_there, "{}: {place}", link.name);
        }
    }
}

/// Behind it a request for registers has a quantity.
#[test]
fn the_address_of_a_queue_is_the_last_before_the_crc() {
    let (link, options) = (Link::by_name("fanuc-hmi-modbus").unwrap(), json!({"framing": "rtu"}));
    let options = options.as_object().unwrap();
    let codec = (link.codec)("client", options).unwrap();
    let bytes = codec.encode(json!({"unit": 1, "function": 24, "address": 1246})).unwrap();
    let found = explain(link, "client", options, &bytes).unwrap();
    let names: Vec<&str> = found[0].parts.iter().map(|part| part.name.as_str()).collect();
    assert_eq!(names, ["/unit", "/function", "/address", "crc"]);
}
