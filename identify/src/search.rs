//! The search: every combination on a sample, those that explain enough of it exactly, and the remaining ones on all bytes.

use anyhow::Result;
use serde_json::{Map, Value};

use super::combination::{Combination, Level, Reading};
use super::echo::without_echo;
use super::evidence::{RULED_OUT_BITS, Random, evidence, rules_out};
use super::plausible::plausible;
use super::{DecidedBy, Finding, OpenSetting, OtherValue, Stream};
use cellwire_links::link::{Guess, Link};
use cellwire_links::settings::Setting;

/// The number of bytes of each stream that are read with every combination.
const SAMPLE: usize = 16 * 1024;
/// The number of combinations that are read exactly.
const MAX_EXACT: usize = 128;
/// The number of combinations that are read on all bytes.
const MAX_WHOLE: usize = 24;
/// Numbers that make no sense rule a combination out with this many bits.
const SENSE: f64 = 20.0;
/// The sense by which one message decides.
const SENSE_OF_ONE: f64 = 5.0;
/// The number of bytes that are shuffled to determine the readings by chance.
const SHUFFLED: usize = 64 * 1024;
const MAX_SHUFFLES: usize = 1024;

/// Finds the settings of a link that explain most of the bytes of a conversation; among them `echo`, if the line returns the
/// bytes of one end, and the link has that setting.
///
/// # Errors
/// Where a decoder makes no progress: it is a defect.
pub fn identify(link: &'static Link, streams: &[Stream]) -> Result<Finding> {
    let cleaned = if has_echo(link) { without_echo(streams) } else { None };
    let mut finding = read(link, cleaned.as_deref().unwrap_or(streams))?;
    if cleaned.is_some() && !finding.read.is_empty() {
        finding.settings.insert(ECHO.into(), true.into());
        finding.options.push(OpenSetting {
            name: ECHO.into(),
            value: true.into(),
            decided: DecidedBy::ByBytes,
        });
    }
    Ok(finding)
}

/// The setting of an end whose line returns its bytes.
const ECHO: &str = "echo";

fn has_echo(link: &Link) -> bool {
    let fields = link.configs.iter().filter_map(|config| (config.fields)(&Map::new()).ok()).flatten();
    fields.into_iter().any(|setting| setting.name == ECHO)
}

fn read(link: &'static Link, streams: &[Stream]) -> Result<Finding> {
    let sample = sample(streams);
    let mut kept = Vec::new();
    for given in candidates(link, &sample)? {
        let mut combination = Combination::new(link, given)?;
        let weight = combination.read(&sample, false)?.weight();
        kept.push((weight, combination));
    }
    kept.sort_by_key(|(weight, it)| (core::cmp::Reverse(*weight), changes(it)));
    let most = kept.first().map_or(0, |(weight, _)| *weight);
    kept.retain(|(weight, _)| weight * 2 >= most);
    kept.truncate(if most == 0 { 1 } else { MAX_EXACT });
    let mut read = Vec::new();
    for (_, mut combination) in kept {
        let reading = combination.read(&sample, true)?;
        read.push((combination, reading));
    }
    let mut likely = group(read);
    let bits = surely(likely.first_mut(), &sample)?;
    sensible(&mut likely);
    sort(&mut likely);
    if sample.iter().map(Stream::size).ne(streams.iter().map(Stream::size)) {
        confirm(&mut likely, streams)?;
        for it in likely.iter_mut().take(MAX_WHOLE) {
            it.reading = it.combination.read(streams, true)?;
        }
        likely.truncate(MAX_WHOLE);
        sort(&mut likely);
    }
    let first = likely.first().map(|it| it.combination.settings.clone()).unwrap_or_default();
    let mut first = Combination::new(link, first)?;
    let reading = first.read(streams, true)?;
    let options =
        if reading.pieces.is_empty() { Vec::new() } else { options(&mut first, &mut likely, &sample)? };
    Ok(Finding {
        link,
        settings: first.settings,
        options,
        messages: [
            reading.pieces.len(),
            reading.pieces.iter().filter(|piece| piece.level == Level::Written).count(),
        ],
        bytes: [reading.explained(), reading.bytes],
        bits,
        read: reading.pieces.iter().map(|piece| (piece.side, piece.value())).collect(),
        senders: reading.senders,
    })
}

/// A combination that the bytes do not rule out.
struct Candidate {
    combination: Combination,
    reading: Reading,
    /// Neither do its numbers.
    makes_sense: bool,
}

/// Puts the combination first that explains most; of equals, the nearest to the defaults.
fn sort(likely: &mut [Candidate]) {
    use core::cmp::Reverse;
    likely
        .sort_by_key(|it| (Reverse(it.makes_sense), Reverse(it.reading.weight()), changes(&it.combination)));
}

/// Returns the beginnings of the streams.
fn sample(streams: &[Stream]) -> Vec<Stream> {
    let begin = |stream: &Stream| {
        let mut left = SAMPLE;
        let parts = stream.parts.iter().map(|part| {
            let taken: Vec<u8> = part.iter().copied().take(left).collect();
            left -= taken.len();
            taken
        });
        Stream { sender: stream.sender.clone(), parts: parts.collect(), arrivals: Vec::new() }
    };
    streams.iter().map(begin).collect()
}

/// Returns every combination of the settings that the source leaves open.
fn candidates(link: &Link, sample: &[Stream]) -> Result<Vec<Map<String, Value>>> {
    let open = link.open;
    let known = (link.settings)();
    let mut all = vec![Map::new()];
    for (name, value) in open.beside {
        all.iter_mut().for_each(|given| drop(given.insert((*name).into(), (*value).into())));
    }
    let guessed = |name: &str| open.guess.is_some_and(|guess| guess.setting == name);
    // The settings that a guess needs come first.
    let needed = |name: &&&str| open.guess.is_some_and(|guess| guess.with.contains(name));
    let first = open.settings.iter().filter(needed);
    for name in first.chain(open.settings.iter().filter(|name| !needed(name) && !guessed(name))) {
        let setting = known.iter().find(|setting| setting.name == *name);
        all = with_each(&all, name, setting.map_or(&[], |setting| &setting.choices));
        if open.guess.is_some_and(|guess| guess.with.last() == Some(name)) {
            all = guess(link, &all, sample);
        }
    }
    Ok(all)
}

fn with_each(all: &[Map<String, Value>], name: &str, values: &[Value]) -> Vec<Map<String, Value>> {
    let with = |given: &Map<String, Value>, value: &Value| {
        let mut given = given.clone();
        given.insert(name.into(), value.clone());
        given
    };
    all.iter().flat_map(|given| values.iter().map(|value| with(given, value)).collect::<Vec<_>>()).collect()
}

fn guess(link: &Link, all: &[Map<String, Value>], sample: &[Stream]) -> Vec<Map<String, Value>> {
    let Some(Guess { setting, values, .. }) = link.open.guess else { return all.to_vec() };
    let bytes: Vec<&[u8]> = sample.iter().flat_map(|stream| &stream.parts).map(Vec::as_slice).collect();
    all.iter()
        .flat_map(|given| with_each(core::slice::from_ref(given), setting, &values(given, &bytes)))
        .collect()
}

/// Returns the number of settings that are not at their defaults.
fn changes(combination: &Combination) -> usize {
    let known = (combination.link.settings)();
    let is_changed =
        |(name, value): (&String, &Value)| match known.iter().find(|setting| setting.name == *name) {
            Some(Setting { default, .. }) => match (value, default) {
                (Value::Object(value), Value::Object(default)) => {
                    value.iter().filter(|(name, value)| default.get(*name) != Some(value)).count()
                }
                _ => usize::from(value != default),
            },
            None => 1,
        };
    combination.settings.iter().map(is_changed).sum()
}

/// Returns the combination that no other one rules out, followed by those that it does not rule out.
fn group(mut read: Vec<(Combination, Reading)>) -> Vec<Candidate> {
    let key = |(combination, reading): &(Combination, Reading)| {
        (core::cmp::Reverse(reading.weight()), changes(combination))
    };
    read.sort_by_key(key);
    let mut best = 0;
    for at in 1..read.len() {
        if let Ok([other, so_far]) = read.get_disjoint_mut([at, best])
            && rules_out(&mut other.0, &other.1, &mut so_far.0, &so_far.1)
        {
            best = at;
        }
    }
    if read.is_empty() {
        return Vec::new();
    }
    let mut best = read.remove(best);
    read.retain_mut(|other| !rules_out(&mut best.0, &best.1, &mut other.0, &other.1));
    read.insert(0, best);
    let likely = |(combination, reading)| Candidate { combination, reading, makes_sense: true };
    read.into_iter().map(likely).collect()
}

/// Marks those whose numbers and texts make no sense beside another's.
fn sensible(likely: &mut [Candidate]) {
    let makes_less = |it: &Candidate, other: &Candidate| {
        // Only over the bytes that both read: more messages are more significant.
        let same =
            it.reading.pieces.iter().filter_map(|piece| Some(other.reading.same(piece)?.sense - piece.sense));
        same.sum::<f64>() >= SENSE
    };
    let senseless: Vec<bool> =
        likely.iter().map(|it| likely.iter().any(|other| makes_less(it, other))).collect();
    likely.iter_mut().zip(senseless).for_each(|(it, senseless)| it.makes_sense = !senseless);
}

/// Rules out settings by other bytes than those of the sample, one setting at a time.
fn confirm(likely: &mut Vec<Candidate>, streams: &[Stream]) -> Result<()> {
    let Some(first) = likely.first() else { return Ok(()) };
    let (link, mut settings) = (first.combination.link, first.combination.settings.clone());
    let mut first = Combination::new(link, settings.clone())?;
    let mut reading = first.read(streams, true)?;
    let mut others: Vec<(String, Value)> = Vec::new();
    let all = likely.iter().flat_map(|it| &it.combination.settings);
    for (name, value) in all.filter(|(name, value)| settings.get(*name) != Some(*value)) {
        let other = (name.clone(), value.clone());
        if !others.contains(&other) {
            others.push(other);
        }
    }
    others.truncate(MAX_WHOLE);
    for (name, value) in others {
        let mut given = settings.clone();
        given.insert(name.clone(), value.clone());
        let mut other = Combination::new(link, given)?;
        let of_other = other.read(streams, true)?;
        if rules_out(&mut first, &reading, &mut other, &of_other) {
            likely.retain(|it| it.combination.settings.get(&name) != Some(&value));
        } else if rules_out(&mut other, &of_other, &mut first, &reading) {
            likely.retain(|it| it.combination.settings.get(&name) != settings.get(&name));
            (settings, first, reading) = (other.settings.clone(), other, of_other);
        }
    }
    Ok(())
}

/// Returns the certainty that these are messages: the same bytes in another order hold as many once in 2 to the power of this.
fn surely(best: Option<&mut Candidate>, sample: &[Stream]) -> Result<f64> {
    let Some(best) = best else { return Ok(0.0) };
    let found = best.reading.pieces.len();
    if found == 0 {
        return Ok(0.0);
    }
    let bytes: usize = sample.iter().map(Stream::size).sum();
    let times = (SHUFFLED / bytes).clamp(2, MAX_SHUFFLES);
    let (mut random, mut by_chance) = (Random(2), 0);
    for _ in 0..times {
        let mut shuffled = sample.to_vec();
        for part in shuffled.iter_mut().flat_map(|stream| &mut stream.parts) {
            for end in (1..part.len()).rev() {
                part.swap(end, random.below(end + 1));
            }
        }
        by_chance += best.combination.read(&shuffled, false)?.pieces.len();
    }
    let real = |count: usize| u32::try_from(count).map_or(f64::MAX, f64::from);
    let usual = (real(by_chance) + 0.5) / real(times);
    if real(found) <= usual {
        return Ok(0.0);
    }
    Ok((1..=found).map(|count| (real(count) / usual).log2()).sum::<f64>().max(0.0))
}

/// Returns the open settings one by one, and those in a table by themselves.
fn options(first: &mut Combination, likely: &mut [Candidate], sample: &[Stream]) -> Result<Vec<OpenSetting>> {
    let link = first.link;
    let mut options = Vec::new();
    for setting in link.open.settings {
        let Some(value) = first.settings.get(*setting).cloned() else { continue };
        let Value::Object(table) = value else {
            options.push(option(first, likely, setting, None)?);
            continue;
        };
        for name in table.keys() {
            let mut found = option(first, likely, setting, Some(name))?;
            if let Some(undecided) = any(first, setting, name, sample)? {
                found.decided = undecided;
            } else if let DecidedBy::Not { others, .. } = &mut found.decided {
                // Where another combination has it at a value that explains nothing, any would do there.
                let of = |it: &Candidate| it.combination.settings.get(*setting)?.get(name).cloned();
                for it in likely.iter_mut().filter(|it| {
                    it.makes_sense && of(it).is_some_and(|it| others.iter().any(|other| other.value == it))
                }) {
                    if any(&mut it.combination, setting, name, sample)?.is_some() {
                        others.clear();
                        break;
                    }
                }
            }
            options.push(found);
        }
    }
    Ok(options)
}

/// Returns an open setting, or an open value of its table.
fn option(
    first: &mut Combination,
    likely: &[Candidate],
    setting: &str,
    inner: Option<&str>,
) -> Result<OpenSetting> {
    let of = |settings: &Map<String, Value>| {
        let value = settings.get(setting)?;
        inner.map_or(Some(value), |inner| value.get(inner)).cloned()
    };
    let value = of(&first.settings).unwrap_or_default();
    let chosen = likely.iter().find(|it| it.combination.settings == first.settings).map(|it| &it.reading);
    let mut others: Vec<OtherValue> = Vec::new();
    for it in likely.iter().filter(|it| it.makes_sense) {
        let Some(other) = of(&it.combination.settings).filter(|other| *other != value) else { continue };
        let less =
            |of: fn(&Reading) -> u64| chosen.map_or(0, |chosen| of(chosen).saturating_sub(of(&it.reading)));
        let fewer = less(Reading::explained);
        let inexact = if fewer == 0 { less(Reading::weight) } else { 0 };
        // The combinations that explain most come first.
        if !others.iter().any(|known| known.value == other) {
            others.push(OtherValue { value: other, fewer, inexact });
        }
    }
    let by_bytes = likely.iter().all(|it| of(&it.combination.settings).is_none_or(|other| other == value));
    let decided = match others.first() {
        None if by_bytes => DecidedBy::ByBytes,
        None => DecidedBy::ByValues,
        Some(OtherValue { value: other, .. }) => {
            let settings = likely.iter().map(|it| &it.combination.settings);
            // The settings most similar to the first.
            let nearest = settings.filter(|it| of(it).as_ref() == Some(other)).min_by_key(|it| {
                it.iter().filter(|(name, value)| first.settings.get(*name) != Some(value)).count()
            });
            let message = match nearest.cloned() {
                Some(settings) => deciding(first, &mut Combination::new(first.link, settings)?),
                None => None,
            };
            let message = message.or_else(|| reads_more(first.link, setting));
            DecidedBy::Not { others, message }
        }
    };
    let name = inner.map_or_else(|| setting.to_owned(), |inner| format!("{setting}.{inner}"));
    Ok(OpenSetting { name, value, decided })
}

/// Returns a value of a table of bytes that has no effect: any other byte would do.
fn any(first: &mut Combination, setting: &str, name: &str, sample: &[Stream]) -> Result<Option<DecidedBy>> {
    let Some(Value::Object(table)) = first.settings.get(setting).cloned() else { return Ok(None) };
    let Some(free) = (0..=u8::MAX).find(|byte| table.values().all(|used| used != byte)) else {
        return Ok(None);
    };
    let mut settings = first.settings.clone();
    let mut other = table;
    other.insert(name.into(), free.into());
    settings.insert(setting.into(), other.into());
    let mut other = Combination::new(first.link, settings)?;
    let (reading, of_other) = (first.read(sample, true)?, other.read(sample, true)?);
    if evidence(first, &reading, &mut other, &of_other) >= RULED_OUT_BITS {
        return Ok(None);
    }
    Ok(Some(DecidedBy::Not { others: Vec::new(), message: deciding(first, &mut other) }))
}

/// Returns the bytes that are read with one value only, if every value writes the same.
fn reads_more(link: &Link, setting: &str) -> Option<String> {
    let found = link.open.reads_more.iter().find(|(name, ..)| *name == setting);
    found.map(|(.., about)| (*about).to_owned())
}

/// Returns a message that only one of two combinations writes as it was read, or can read.
fn deciding(first: &mut Combination, other: &mut Combination) -> Option<String> {
    let decides = |side: &str, message: &Value, a: &mut Combination, b: &mut Combination| {
        let Some(bytes) = a.encode(side, message.clone()) else { return false };
        let read = b.within(side, &bytes);
        read.level < Level::Written || plausible(message) - plausible(&read.message) >= SENSE_OF_ONE
    };
    let found = first.link.open.deciding.iter().find(|it| {
        let message = serde_json::from_str(it.message).unwrap_or_default();
        decides(it.side, &message, first, other) || decides(it.side, &message, other, first)
    });
    found.map(|it| it.about.to_owned())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use serde_json::json;

    use super::super::Sender;
    use super::*;

    #[test]
    fn all_bytes_rule_out_what_those_of_the_sample_do_not() {
        let link = Link::by_name("val2-alter").unwrap();
        // The checksum of every third is 10h.
        let motion = |segment: u8, percent: u8| {
            json!({"kind": "motion", "phase": "running", "error": 0, "segment_status": 2, "segment": segment,
                "percent": percent, "transform": null})
        };
        let messages = vec![[motion(1, 50), motion(110, 32), motion(1, 50)]; 5].concat();
        let given = |is: bool| Map::from_iter([("stuffed_checksum".to_owned(), json!(is))]);
        for stuffed in [false, true] {
            let codec = (link.codec)("robot", &given(stuffed)).unwrap();
            let bytes = messages.iter().flat_map(|it| codec.encode(it.clone()).unwrap()).collect();
            let stream = Stream { sender: Sender::Unknown, parts: vec![bytes], arrivals: Vec::new() };
            let likely = |is: bool| Candidate {
                combination: Combination::new(link, given(is)).unwrap(),
                reading: Reading::default(),
                makes_sense: true,
            };
            let mut likely = vec![likely(false), likely(true)];
            confirm(&mut likely, &[stream]).unwrap();
            let left: Vec<_> = likely.iter().map(|it| it.combination.settings.clone()).collect();
            assert_eq!(left, [given(stuffed)]);
        }
    }

    #[test]
    fn what_makes_no_sense_does_not_say_that_any_value_would_do() {
        let link = Link::by_name("laser-eb90").unwrap();
        let given = |tag: u8, checksum: &str| {
            let tags = json!({"f32": 240, "i16": 241, "u8": tag, "char": 243});
            Map::from_iter([("tags".to_owned(), tags), ("checksum".to_owned(), json!(checksum))])
        };
        let frames = |tag: u8| {
            let codec = (link.codec)("host", &given(tag, "u8")).unwrap();
            (0..6u8).flat_map(move |at| codec.encode(json!({"items": [{"u8": [49, at]}]})).unwrap())
        };
        let bytes = frames(242).chain(frames(7)).collect();
        let stream = Stream { sender: Sender::Unknown, parts: vec![bytes], arrivals: Vec::new() };
        let combination = |tag: u8, checksum: &str| Combination::new(link, given(tag, checksum)).unwrap();
        let likely = |tag: u8, checksum: &str, makes_sense: bool| {
            let combination = combination(tag, checksum);
            Candidate { combination, reading: Reading::default(), makes_sense }
        };
        for (makes_sense, expected) in [(false, vec![json!(7)]), (true, Vec::new())] {
            // With a checksum of 16 bits no frame is read, with any tags.
            let mut likely =
                [likely(242, "u8", true), likely(7, "u8", true), likely(7, "u16_le", makes_sense)];
            let open = options(&mut combination(242, "u8"), &mut likely, core::slice::from_ref(&stream));
            let open = open.unwrap().into_iter().find(|it| it.name == "tags.u8").unwrap();
            let DecidedBy::Not { others, .. } = open.decided else { panic!("{open:?}") };
            assert_eq!(others.into_iter().map(|it| it.value).collect::<Vec<_>>(), expected);
        }
    }
}
