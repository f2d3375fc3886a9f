//! Every vector of `reference/vectors`, by the codec of its link: alone, between neighbours, and after a truncated
//! frame.

use std::collections::BTreeSet;

use cellwire_links::codec::items;
use cellwire_links::vectors::{Outcome, Vector, vectors};
use cellwire_links::{LINKS, Link};
use robot_session::contract::{after_a_cut, chunkings};
use serde_json::{Map, Value};
use val2_alter::{HostMessage, Message as _, RobotMessage};

/// The vectors that one codec reads.
struct Group {
    link: &'static Link,
    side: &'static str,
    options: Map<String, Value>,
    vectors: Vec<Vector>,
}

/// A message or an error, and its length. The position of an error depends on the bytes before it.
type Item = (Option<Value>, usize);

fn groups() -> Vec<Group> {
    let mut groups: Vec<Group> = Vec::new();
    for link in LINKS.iter().filter(|link| testkit::is_tested(link.name)) {
        let path = format!("{}/../reference/vectors/{}.json", env!("CARGO_MANIFEST_DIR"), link.name);
        let mut ids = BTreeSet::new();
        for vector in vectors(path).unwrap() {
            assert!(ids.insert(vector.id), "{} uses the number {} twice", link.name, vector.id);
            let (side, options) = (link.side(vector.from.as_deref()).unwrap(), vector.options.clone());
            let is_its = |group: &&mut Group| {
                (group.link.name, group.side, &group.options) == (link.name, side, &options)
            };
            match groups.iter_mut().find(is_its) {
                Some(group) => group.vectors.push(vector),
                None => groups.push(Group { link, side, options, vectors: vec![vector] }),
            }
        }
    }
    groups
}

impl Group {
    fn read(&self, pieces: &[&[u8]]) -> Vec<Item> {
        let codec = (self.link.codec)(self.side, &self.options).unwrap();
        let items = items(codec, &[pieces.to_vec()]).unwrap();
        items.iter().map(|item| (item.value().unwrap().ok(), item.length as usize)).collect()
    }

    fn valid(&self) -> impl Iterator<Item = &Vector> + Clone {
        self.vectors.iter().filter(|vector| vector.result == Outcome::Valid)
    }

    /// Returns whether this frame is found in the bytes of a corrupt one: for val2-alter, only if the source names every
    /// code in it.
    fn believes(&self, vector: &Vector) -> bool {
        let message = vector.message.clone().unwrap();
        match (self.link.name, self.side) {
            ("val2-alter", "robot") => {
                serde_json::from_value::<RobotMessage>(message).unwrap().is_plausible()
            }
            ("val2-alter", _) => serde_json::from_value::<HostMessage>(message).unwrap().is_plausible(),
            _ => true,
        }
    }

    fn name(&self, vector: &Vector) -> String {
        format!("{} {}", self.link.name, vector.id)
    }
}

fn item(vector: &Vector) -> Item {
    (vector.message.clone(), vector.bytes.len())
}

#[test]
fn alone_it_is_what_it_says_however_it_is_read() {
    for group in groups() {
        for vector in &group.vectors {
            for pieces in chunkings(&vector.bytes) {
                vector.check(group.link, &pieces).unwrap_or_else(|e| panic!("{}: {e}", group.name(vector)));
            }
        }
    }
}

#[test]
fn an_error_breaks_a_clause_that_its_vectors_show() {
    for link in LINKS.iter().filter(|link| testkit::is_tested(link.name)) {
        let mut kinds: BTreeSet<String> = BTreeSet::new();
        let groups = groups().into_iter().filter(|group| group.link.name == link.name);
        let vectors: Vec<Vector> = groups.flat_map(|group| group.vectors).collect();
        let kind = |vector: &Vector| Some(vector.error.as_ref()?["kind"].as_str()?.to_owned());
        kinds.extend(vectors.iter().filter_map(kind));
        for it in &kinds {
            let clause = link.clause(it).unwrap_or_else(|| panic!("{}: no clause of {it}", link.name));
            let mut shown = vectors.iter().filter(|vector| kind(vector).as_ref() == Some(it));
            assert!(
                shown.any(|it| it.clauses.iter().any(|it| it == clause)),
                "{}: {it}, {clause}",
                link.name
            );
        }
    }
}

#[test]
fn a_neighbour_on_either_side_changes_nothing() {
    for group in groups() {
        // With a neighbour after it, an incomplete vector is no longer incomplete.
        for (index, vector) in group.vectors.iter().enumerate().filter(|(_, vector)| !vector.end) {
            let alone = group.read(&[&vector.bytes]);
            for (number, good) in group.valid().enumerate() {
                let stream = [&good.bytes[..], &vector.bytes, &good.bytes, &good.bytes].concat();
                let expected = [&[item(good)], &alone[..], &[item(good), item(good)]].concat();
                // Whole with every neighbour; with one of them also byte by byte, and in two pieces at every seventh byte.
                let is_cut = number == index % group.valid().count();
                let ways = chunkings(&stream).enumerate();
                for (_, pieces) in ways.filter(|(n, _)| *n == 0 || is_cut && (*n == 1 || n % 7 == index % 7))
                {
                    let name = format!("{}, {} around it", group.name(vector), good.id);
                    assert_eq!(group.read(&pieces), expected, "{name}, in pieces: {pieces:02X?}");
                }
            }
        }
    }
}

#[test]
fn a_frame_that_is_cut_costs_itself_alone() {
    let mut streams = 0;
    // TCP loses no bytes: a frame that is cut there ends with its connection.
    let is_tcp = |group: &Group| group.link.name == "fanuc-hmi-modbus" && group.options.is_empty();
    for group in groups().into_iter().filter(|group| !is_tcp(group)) {
        let lost = usize::from(!group.link.marks_begin);
        for (index, cut) in group.valid().enumerate() {
            let believed = group.valid().filter(|good| group.believes(good));
            for good in believed.clone().cycle().skip(index).take(4.min(believed.count())) {
                for (stream, at) in after_a_cut(&cut.bytes, &good.bytes.repeat(lost + 1)).zip(1..) {
                    let name = format!("{} cut at {at}, {} behind it", group.name(cut), good.id);
                    let found = group.read(&[&stream]);
                    // The missing bytes equal the beginning of the next frame, or have the same sum, which is 0.
                    let is_whole = stream.starts_with(&cut.bytes)
                        || group.link.name == "isra-ball" && at == 10 && cut.bytes[11] == 0;
                    if is_whole {
                        assert!(found[0].0.is_some(), "{name}: {found:?}");
                        continue;
                    }
                    let (messages, errors): (Vec<_>, Vec<_>) =
                        found.into_iter().map(|(message, _)| message).partition(Option::is_some);
                    assert_eq!(messages, core::slice::from_ref(&good.message), "{name}");
                    let alone = group.read(&[&stream[..at]]).len();
                    // For laser-eb90, bytes in the truncated frame that look like a head may be one more.
                    let most = alone + usize::from(group.link.name == "laser-eb90");
                    assert!(errors.len() <= most, "{name}: {errors:?}, of {alone} without it");
                    streams += 1;
                }
            }
        }
    }
    // Of all links.
    assert!(streams > 30_000 || std::env::var("LINK").is_ok(), "{streams}");
}
