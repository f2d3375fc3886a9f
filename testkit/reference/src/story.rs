//! `reference/sessions/<link>.json`: stories of sessions, recorded from our own.

use core::time::Duration;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use anyhow::{Context, Result, bail, ensure};
use cellwire_links::reference::story::{OmittedActions, StoryInput, line as step_line};
use cellwire_links::vectors::unhex;
use serde::Deserialize;
use serde_json::{Map, Value};
use testkit::model::Cell;

use crate::codec::codec;
use crate::ends::{self, End, Step};
use crate::json::{self, Object};
use crate::states;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Inputs {
    /// Messages that scripts name.
    pub(crate) words: BTreeMap<String, StoryMessage>,
    pub(crate) ends: BTreeMap<String, EndInputs>,
    pub(crate) stories: Vec<Story>,
    /// Configurations that an end refuses.
    #[serde(default)]
    refused: Vec<RefusedConfig>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RefusedConfig {
    id: u32,
    comment: String,
    end: String,
    config: Map<String, Value>,
    clauses: Vec<String>,
}

/// A message object and its sender.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct StoryMessage {
    from: Option<String>,
    #[serde(default)]
    options: Map<String, Value>,
    message: Value,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct EndInputs {
    /// The machines of the end in `states/<link>.json`.
    pub(crate) machines: Vec<String>,
    /// The moves, times and configurations from which the exploration chooses.
    pub(crate) moves: Vec<String>,
    pub(crate) times: Vec<String>,
    pub(crate) configs: Vec<Map<String, Value>>,
    /// Cells that no story reaches, and why not.
    pub(crate) unreachable: BTreeMap<String, String>,
    /// Rules that no story needs, and why not.
    #[serde(default)]
    unneeded: BTreeMap<String, String>,
}

#[derive(Deserialize, Clone)]
#[serde(deny_unknown_fields)]
pub(crate) struct Story {
    pub(crate) id: u32,
    pub(crate) comment: String,
    pub(crate) end: String,
    #[serde(default)]
    pub(crate) config: Map<String, Value>,
    #[serde(default)]
    pub(crate) clauses: Vec<String>,
    pub(crate) script: Vec<String>,
}

/// A story as it was played.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct PlayedStory {
    steps: Vec<String>,
    pub(crate) cells: BTreeSet<String>,
}

/// Returns the text of a link's file, if it has stories.
pub(crate) fn file(root: &Path, link: &str) -> Result<Option<String>> {
    let Some(inputs) = crate::input::<Inputs>(root, "stories", link)? else { return Ok(None) };
    let mut lines = Vec::new();
    let mut covered: BTreeMap<&str, BTreeSet<String>> = BTreeMap::new();
    let mut needed: BTreeMap<&str, BTreeSet<String>> = BTreeMap::new();
    for (index, story) in inputs.stories.iter().enumerate() {
        ensure!(story.id as usize == index + 1, "story {} of {link} is in place {}", story.id, index + 1);
        let context = || format!("story {} of {link}", story.id);
        let played = play(link, &inputs, story, None).with_context(context)?;
        let before = covered.entry(&story.end).or_default();
        let fresh: Vec<&String> = played.cells.iter().filter(|cell| !before.contains(*cell)).collect();
        let mut needs = Vec::new();
        for (index, rule) in ends::rules(link, &story.end)?.into_iter().enumerate() {
            // A script may name times that another way has passed already.
            if play(link, &inputs, story, Some(index)).map_or(true, |other| other.steps != played.steps) {
                needs.push(rule);
            }
        }
        lines.push(
            Object::new()
                .value("id", &story.id)?
                .value("comment", &story.comment)?
                .value("end", &story.end)?
                .value("config", &story.config)?
                .value("clauses", &story.clauses)?
                .value("covers", &fresh)?
                .value("needs", &needs)?
                .raw("steps", format_args!("[\n      {}\n    ]", played.steps.join(",\n      ")))
                .end(),
        );
        before.extend(played.cells);
        needed.entry(&story.end).or_default().extend(needs);
    }
    let mut counts = Object::new();
    for (end, about) in &inputs.ends {
        let reachable = reachable(link, &about.machines);
        let covered = covered.remove(end.as_str()).unwrap_or_default();
        let missing: Vec<&String> =
            reachable.difference(&covered).filter(|cell| !about.unreachable.contains_key(*cell)).collect();
        let wrong: Vec<&String> = about
            .unreachable
            .keys()
            .filter(|cell| covered.contains(*cell) || !reachable.contains(*cell))
            .collect();
        let count = reachable.intersection(&covered).count();
        let needed = needed.remove(end.as_str()).unwrap_or_default();
        let rules = ends::rules(link, end)?;
        let unneeded: Vec<_> = rules
            .iter()
            .filter(|rule| !needed.contains(*rule) && !about.unneeded.contains_key(*rule))
            .collect();
        eprintln!(
            "{link} {end}: {count} of {} cells covered, {} cannot be reached; {} of {} rules needed",
            reachable.len(),
            about.unreachable.len(),
            needed.len(),
            rules.len()
        );
        counts = counts.raw(
            end,
            Object::new()
                .raw("cells", reachable.len())
                .raw("unreachable", about.unreachable.len())
                .raw("reached", count)
                .raw("rules", rules.len())
                .raw("needed", needed.len())
                .end(),
        );
        if std::env::var_os("REFERENCE_DRAFT").is_none() {
            ensure!(missing.is_empty(), "{link} {end}: no story reaches {missing:#?}");
            ensure!(wrong.is_empty(), "{link} {end}: is reached, or is no cell: {wrong:?}");
            ensure!(unneeded.is_empty(), "{link} {end}: no story needs the rules {unneeded:?}");
        } else {
            eprintln!("missing {missing:#?}, reached {wrong:?}, unneeded {unneeded:?}");
        }
    }
    let mut head = vec![("link", json::text(link)?), ("ends", counts.end())];
    if !inputs.refused.is_empty() {
        head.push(("refused", refused(link, &inputs.refused)?));
    }
    Ok(Some(json::file("sessions.schema.json", &head, "stories", &lines)))
}

/// Returns the configurations that an end rejects.
fn refused(link: &str, configs: &[RefusedConfig]) -> Result<String> {
    let mut lines = Vec::new();
    for (index, refused) in configs.iter().enumerate() {
        let RefusedConfig { id, comment, end, config, clauses } = refused;
        ensure!(
            *id as usize == index + 1,
            "the refused configuration {id} of {link} is in place {}",
            index + 1
        );
        let is_refused = End::new(link, end, config, None).is_err();
        ensure!(is_refused, "the configuration {id} of {link} is not refused");
        lines.push(
            Object::new()
                .value("id", id)?
                .value("comment", comment)?
                .value("end", end)?
                .value("config", config)?
                .value("clauses", clauses)?
                .end(),
        );
    }
    Ok(format!("[\n    {}\n  ]", lines.join(",\n    ")))
}

/// Returns the cells of machines that are defined: `state: input`.
pub(crate) fn reachable(link: &str, machines: &[String]) -> BTreeSet<String> {
    let is_defined = |cell: &Cell| cell.to.is_some() && machines.iter().any(|machine| machine == cell.end);
    let cells = states::table(link).into_iter().filter(is_defined);
    cells.map(|cell| format!("{}: {}", cell.state, cell.input)).collect()
}

/// Plays a story; `without`: the number of the rule that the machine leaves out.
pub(crate) fn play(
    link: &str,
    inputs: &Inputs,
    story: &Story,
    without: Option<usize>,
) -> Result<PlayedStory> {
    let mut end = End::new(link, &story.end, &story.config, without)?;
    let (mut now, mut steps, mut cells) = (Duration::ZERO, Vec::new(), BTreeSet::new());
    for line in &story.script {
        let (at, omits, verb) = parse(&end, now, line)?;
        ensure!(at >= now, "{line}: the time goes back");
        now = at;
        let input = verb_of(link, inputs, verb).with_context(|| line.clone())?;
        let Step { done, cells: reached } = end.step(now, &input, omits)?;
        cells.extend(reached);
        steps.push(step_line(now, &input, omits, &done, end.deadline(), &end.state())?);
    }
    Ok(PlayedStory { steps, cells })
}

/// Parses `TIME [hold] [keep] VERB…`; the time is in milliseconds: `28.5`, after the last step `+28.5`, or the deadline
/// `due`, `due+1`, `due-1`.
fn parse<'a>(end: &End, now: Duration, line: &'a str) -> Result<(Duration, OmittedActions, &'a str)> {
    let (time, verb) = line.split_once(' ').with_context(|| format!("{line}: no verb"))?;
    let due = || end.deadline().filter(|due| *due < Duration::MAX).map_or(now, |due| due.max(now));
    let at = match (time.strip_prefix("due"), time.strip_prefix('+')) {
        (Some(""), _) => due(),
        (Some(offset), _) => match offset.strip_prefix('-') {
            Some(before) => due().saturating_sub(milliseconds(before)?).max(now),
            None => due().saturating_add(milliseconds(offset.trim_start_matches('+'))?),
        },
        (None, Some(later)) => now.saturating_add(milliseconds(later)?),
        (None, None) => milliseconds(time)?,
    };
    let (transmit, verb) = verb.strip_prefix("hold ").map_or((false, verb), |verb| (true, verb));
    let (events, verb) = verb.strip_prefix("keep ").map_or((false, verb), |verb| (true, verb));
    Ok((at, OmittedActions { transmit, events }, verb))
}

fn milliseconds(text: &str) -> Result<Duration> {
    let (whole, fraction) = text.split_once('.').unwrap_or((text, ""));
    ensure!(fraction.len() <= 6, "{text}: finer than a nanosecond");
    let fraction: u64 = format!("{fraction:0<6}").parse().with_context(|| text.to_owned())?;
    let whole: u64 = whole.parse().with_context(|| format!("{text} is no time in milliseconds"))?;
    Ok(Duration::from_millis(whole) + Duration::from_nanos(fraction))
}

/// Returns the input of a step.
fn verb_of(link: &str, inputs: &Inputs, verb: &str) -> Result<StoryInput> {
    let (name, rest) = verb.split_once(' ').unwrap_or((verb, ""));
    let bytes = match name {
        "connected" => return Ok(StoryInput::Connected),
        "disconnected" => return Ok(StoryInput::Disconnected),
        "timeout" => return Ok(StoryInput::Timeout),
        "transmitted" => return Ok(StoryInput::Transmitted),
        "nothing" => return Ok(StoryInput::Nothing),
        "call" if !rest.starts_with('{') => {
            return Ok(StoryInput::Call { name: rest.to_owned(), argument: Value::Null });
        }
        "call" => {
            let call: Map<String, Value> = serde_json::from_str(rest)?;
            let (name, argument) = call.into_iter().next().context("a call has one key")?;
            return Ok(StoryInput::Call { name, argument });
        }
        "in" => unhex(rest)?,
        // Each character is the byte of its number.
        "text" => rest.chars().map(u8::try_from).collect::<Result<_, _>>()?,
        "say" => {
            let mut bytes = Vec::new();
            for word in rest.split(' ') {
                bytes.extend(said(link, inputs, word)?);
            }
            bytes
        }
        "bad" => {
            let mut bytes = said(link, inputs, rest)?;
            if let Some(last) = bytes.last_mut() {
                *last ^= 1;
            }
            bytes
        }
        "cut" => {
            let (count, word) = rest.split_once(' ').context("cut COUNT WORD")?;
            let mut bytes = said(link, inputs, word)?;
            bytes.truncate(count.parse()?);
            bytes
        }
        "rest" => {
            let (count, word) = rest.split_once(' ').context("rest COUNT WORD")?;
            said(link, inputs, word)?.split_off(count.parse()?)
        }
        _ => bail!("no such verb"),
    };
    Ok(StoryInput::Input(bytes))
}

fn said(link: &str, inputs: &Inputs, word: &str) -> Result<Vec<u8>> {
    let word = inputs.words.get(word).with_context(|| format!("no word {word}"))?;
    let encoded = codec(link, word.from.as_deref(), &word.options)?.encode(word.message.clone());
    encoded.with_context(|| format!("{} is not written", word.message))
}
