//! Every story in which both ends keep the rules, with one fault: each message dropped, repeated, late, changed, or corrupt.

use core::fmt::Write as _;
use core::time::Duration;
use std::collections::BTreeMap;

use cellwire_links::codec::items;
use cellwire_links::shadow::Kind;
use cellwire_links::{LINKS, Link};
use serde_json::Value;

use super::counts::{FAULTS as COUNTS, compare, keep};
use super::recorded::{LocatedComplaint, Recorded, RecordedBody, Story, stories};
use super::unseen::{REASONS, unseen};

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Fault {
    /// The message does not come.
    Dropped,
    /// The message comes twice.
    Repeated,
    /// The message and everything after it arrive later than any budget of the link allows.
    Delayed,
    /// One value of it is another.
    Changed,
    /// One bit of its bytes is another.
    Corrupt,
}

/// The order of the columns in `counts.rs`.
pub(crate) const FAULTS: [Fault; 5] =
    [Fault::Dropped, Fault::Repeated, Fault::Delayed, Fault::Changed, Fault::Corrupt];

/// One message of a story, and what was made of it.
pub(crate) struct Case<'a> {
    pub(crate) link: &'static Link,
    pub(crate) story: &'a Story,
    pub(crate) fault: Fault,
    /// The place of the message in the story.
    pub(crate) place: usize,
    /// The side that sends the message.
    pub(crate) from: &'static str,
    /// The message, if it is whole and alone.
    pub(crate) message: Option<Value>,
    /// The changed message.
    pub(crate) other: Option<Value>,
}

#[derive(Debug, Default, Clone, PartialEq, Eq)]
struct Count {
    all: u32,
    /// Complaints at the message, or at the first event after it that depends on it.
    found: u32,
    /// The part of `found` that is complained about later.
    later: u32,
    unseen: BTreeMap<&'static str, u32>,
}

#[test]
fn faults_are_found_where_they_can_be_seen() {
    let mut rows = String::new();
    for link in LINKS {
        let mut counts: BTreeMap<Fault, Count> = BTreeMap::new();
        let mut list = String::new();
        let stories = stories(link);
        let kept: Vec<&Story> = stories.iter().filter(|story| is_kept(link, story)).collect();
        for story in &kept {
            let before = story.say(link, &story.told);
            for place in 0..story.told.len() {
                let RecordedBody::Bytes(from, bytes) = &story.told[place].what else { continue };
                if bytes.is_empty() || !is_whole(link, story, from, bytes) {
                    continue;
                }
                for fault in FAULTS {
                    let message = alone(link, story, from, bytes);
                    let mut case = Case { link, story, fault, place, from, message, other: None };
                    let Some(told) = faulty(&mut case, bytes) else { continue };
                    let count = counts.entry(fault).or_default();
                    count.all += 1;
                    let found = first_new(&before, &story.say(link, &told));
                    let is_found = found.is_some() || is_error(link, story, &told);
                    count.found += u32::from(is_found);
                    // The message itself, the next message of either end, or the end of the story.
                    let is_there = |found: usize| found <= place + 2 || found >= told.len();
                    count.later += u32::from(found.is_some_and(|found| !is_there(found)));
                    let why = if is_found { None } else { unseen(&case) };
                    if let Some(why) = why {
                        *count.unseen.entry(why).or_default() += 1;
                    }
                    let outcome = match (found, why) {
                        (Some(found), _) => format!("at {found}"),
                        (None, Some(why)) => why.to_owned(),
                        (None, None) if is_found => "an error of the decoder".to_owned(),
                        (None, None) => {
                            let text = |it: Option<Value>| it.map_or_else(String::new, |it| it.to_string());
                            format!("MISSED {bytes:02X?} {} {}", text(case.message), text(case.other))
                        }
                    };
                    let _ = writeln!(list, "{} {fault:?} {place} {from}: {outcome}", story.id);
                }
            }
        }
        let count = |fault| counts.get(&fault).cloned().unwrap_or_default();
        let outcomes = FAULTS.map(|fault| {
            let Count { all, found, unseen, .. } = count(fault);
            let unseen: u32 = unseen.values().sum();
            if unseen == 0 {
                format!("{found}/{all}")
            } else {
                format!("{found}/{} + {unseen}", all - unseen)
            }
        });
        let unseen = REASONS.map(|why| {
            let counts = FAULTS.map(|fault| count(fault).unseen.get(why).copied().unwrap_or_default());
            for (fault, count) in FAULTS.into_iter().zip(counts).filter(|(_, count)| *count > 0) {
                let _ = writeln!(list, "{fault:?}: {count}, {why}");
            }
            counts.into_iter().sum::<u32>().to_string()
        });
        // A link that was just made has no row yet.
        if COUNTS.lines().any(|row| row.split(':').next() == Some(link.name)) {
            let _ = writeln!(
                rows,
                "{}: {} of {}; {}; {}; {}; {}",
                link.name,
                kept.len(),
                stories.len(),
                outcomes.join(", "),
                counts.values().map(|count| count.later).sum::<u32>(),
                unseen.join(" "),
                keep(&format!("{}-faults.txt", link.name), &list)
            );
        }
    }
    compare(&rows, COUNTS);
}

/// Returns whether both ends follow the rules in a story, and all its bytes are messages.
fn is_kept(link: &'static Link, story: &Story) -> bool {
    // A story may end before an answer has come.
    let is_early = |said: &LocatedComplaint| said.place < story.told.len();
    !story.say(link, &story.told).iter().any(is_early) && !is_error(link, story, &story.told)
}

/// Returns whether a decoder returns an error, including for the bytes in its buffer when the connection ends.
fn is_error(link: &Link, story: &Story, told: &[Recorded]) -> bool {
    link.sides.iter().any(|side| {
        let mut parts: Vec<Vec<&[u8]>> = vec![Vec::new()];
        for told in told {
            match &told.what {
                RecordedBody::Bytes(from, bytes) if from == side => parts.last_mut().unwrap().push(bytes),
                RecordedBody::Bytes(..) => {}
                RecordedBody::Opened | RecordedBody::Closed => parts.push(Vec::new()),
            }
        }
        let codec = || (link.codec)(side, &story.settings(link)).unwrap();
        let has_error = |part| items(codec(), &[part]).unwrap().iter().any(|item| item.content.is_err());
        parts.into_iter().any(has_error)
    })
}

/// Returns whether bytes are a message, or several, or a poll, rather than a part of a message.
fn is_whole(link: &Link, story: &Story, from: &str, bytes: &[u8]) -> bool {
    let codec = || (link.codec)(from, &story.settings(link)).unwrap();
    !link.sides.contains(&from)
        || items(codec(), &[vec![bytes]]).unwrap().iter().all(|item| item.content.is_ok() && !item.at_end)
}

/// Returns the message, if the bytes are exactly one.
fn alone(link: &Link, story: &Story, from: &str, bytes: &[u8]) -> Option<Value> {
    if !link.sides.contains(&from) {
        return None;
    }
    let codec = (link.codec)(from, &story.settings(link)).unwrap();
    match items(codec, &[vec![bytes]]).unwrap().as_slice() {
        [one] => one.value().unwrap().ok(),
        _ => None,
    }
}

/// Returns the story with the fault.
fn faulty(case: &mut Case<'_>, bytes: &[u8]) -> Option<Vec<Recorded>> {
    let mut told = case.story.told.clone();
    let place = case.place;
    match case.fault {
        Fault::Dropped => drop(told.remove(place)),
        Fault::Repeated => told.insert(place, told[place].clone()),
        Fault::Delayed => {
            let late = late(case.link);
            told[place..].iter_mut().for_each(|told| told.at += late);
        }
        Fault::Changed => {
            let message = case.message.as_ref()?;
            let codec = (case.link.codec)(case.from, &case.story.settings(case.link)).unwrap();
            let count = leaves(message);
            let (other, bytes) = (0..count).find_map(|leaf| {
                let other = change(message, (leaf + place) % count.max(1))?;
                let bytes = codec.encode(other.clone()).ok()?;
                Some((other, bytes))
            })?;
            case.other = Some(other);
            told[place].what = RecordedBody::Bytes(case.from, bytes);
        }
        Fault::Corrupt => {
            let mut bytes = bytes.to_vec();
            let at = place % bytes.len();
            bytes[at] ^= 1 << (place % 7);
            told[place].what = RecordedBody::Bytes(case.from, bytes);
        }
    }
    Some(told)
}

/// Returns a delay that is longer than any budget, and than any session assumes.
pub(crate) fn late(link: &Link) -> Duration {
    Duration::from_millis(match link.name {
        "laser-eb90" => 60_000,
        "isra-ball" | "val2-alter" => 200,
        "fanuc-hmi-modbus" => 13_000,
        _ => 12_000,
    })
}

/// Returns the place of the first new complaint.
fn first_new(before: &[LocatedComplaint], after: &[LocatedComplaint]) -> Option<usize> {
    let mut before: Vec<_> = before.iter().map(key).collect();
    let mut is_new = |said: &&LocatedComplaint| match before.iter().position(|known| *known == key(said)) {
        Some(place) => {
            before.remove(place);
            false
        }
        None => true,
    };
    after.iter().find(|said| is_new(said)).map(|said| said.place)
}

/// Returns the properties of a complaint apart from the times in its text.
fn key(said: &LocatedComplaint) -> (&'static str, &'static str, bool) {
    (said.complaint.end, said.complaint.clause, said.complaint.kind == Kind::Rule)
}

fn leaves(value: &Value) -> usize {
    match value {
        Value::Array(values) => values.iter().map(leaves).sum(),
        Value::Object(values) => values.values().map(leaves).sum(),
        _ => 1,
    }
}

/// Returns the value with another one at this leaf.
fn change(value: &Value, leaf: usize) -> Option<Value> {
    fn visit(value: &mut Value, leaf: &mut usize) -> bool {
        match value {
            Value::Array(values) => values.iter_mut().any(|value| visit(value, leaf)),
            Value::Object(values) => values.values_mut().any(|value| visit(value, leaf)),
            _ if *leaf > 0 => {
                *leaf -= 1;
                false
            }
            Value::Number(number) => {
                *value = match number.as_i64() {
                    Some(number) => (number ^ 1).into(),
                    None => (number.as_f64().unwrap() + 1.0).into(),
                };
                true
            }
            Value::Bool(flag) => {
                *flag = !*flag;
                true
            }
            Value::String(text) => {
                *text = match text.parse::<i64>() {
                    Ok(number) => (number ^ 1).to_string(),
                    Err(_) if text.is_empty() => "1".into(),
                    Err(_) => text.chars().rev().collect(),
                };
                true
            }
            _ => false,
        }
    }
    let (mut other, mut left) = (value.clone(), leaf);
    (visit(&mut other, &mut left) && other != *value).then_some(other)
}
