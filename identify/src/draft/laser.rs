//! The command words of a laser, by class.

use core::fmt::Write as _;
use std::time::Duration;

use anyhow::{Result, ensure};
use laser_eb90::ErrorCodes;
use serde_json::Value;

use super::{MIN_SIGHTINGS, SentMessage};

/// An answer that comes later comes after an execution.
const AT_ONCE: Duration = Duration::from_millis(150);
/// One answer may be late for other reasons.
const SHARE: usize = 2;
/// A capture without times only shows the sequence.
const NO_TIME: Duration = Duration::from_micros(1);

/// A command word, and the observations of it.
#[derive(Default)]
struct CommandWord {
    word: u16,
    times: usize,
    /// The number of times that the word was in a frame with others.
    together: usize,
    /// The times of the answers to the word alone.
    answers: Vec<Duration>,
    /// The number of answers with values.
    values: usize,
}

/// Returns the words of a conversation.
pub(super) fn draft(said: &[SentMessage]) -> Result<String> {
    let mut words: Vec<CommandWord> = Vec::new();
    let mut codes: Vec<(u16, usize)> = Vec::new();
    let mut asked: Option<(Vec<u16>, Duration)> = None;
    for SentMessage { side, message, time } in said {
        let found = words_of(message);
        if *side == "host" {
            for word in &found {
                let known = known(&mut words, *word);
                known.times += 1;
                known.together += usize::from(found.len() > 1);
            }
            asked = Some((found, *time));
            continue;
        }
        let (Some(first), Some((of, at))) = (found.first(), &asked) else { continue };
        if !of.contains(first) {
            match codes.iter_mut().find(|(code, _)| code == first) {
                Some((_, times)) => *times += 1,
                None => codes.push((*first, 1)),
            }
        } else if let [word] = of.as_slice() {
            let known = known(&mut words, *word);
            known.answers.push(time.saturating_sub(*at));
            let items = message.get("items").and_then(Value::as_array).map_or(0, Vec::len);
            known.values += usize::from(items > 1);
        }
        asked = None;
    }
    ensure!(!words.is_empty(), "no command words are in the capture: capture what the host sends, too");
    words.sort_by_key(|word| word.word);
    let mut text = String::from("# A draft from a capture: correct what has a ?.\n\n[words]\ncommands = [\n");
    for word in &words {
        let (class, why, doubt) = class(word);
        let number = word.word;
        writeln!(
            text,
            "  {{ first = {number}, last = {number}, class = \"{class}\" }}, # {doubt}{}, {why}",
            times(word.times)
        )?;
    }
    text.push_str("]\n\n[words.errors]\n");
    codes.sort_by_key(|(_, times)| core::cmp::Reverse(*times));
    errors(&mut text, codes, &words)?;
    Ok(text)
}

/// Writes the error codes: those that are a default by its name, the others by the names that are left.
fn errors(text: &mut String, codes: Vec<(u16, usize)>, words: &[CommandWord]) -> Result<()> {
    let ErrorCodes { bad_checksum, bad_frame, unknown_command, bad_batch, bad_parameters, queue_full } =
        ErrorCodes::default();
    // A machine that works answers a full queue most often.
    let defaults = [
        ("queue_full", queue_full),
        ("bad_checksum", bad_checksum),
        ("bad_frame", bad_frame),
        ("unknown_command", unknown_command),
        ("bad_batch", bad_batch),
        ("bad_parameters", bad_parameters),
    ];
    let is_default = |code: u16| defaults.iter().any(|(_, default)| *default == code);
    let is_taken =
        |code: u16| codes.iter().any(|(it, _)| *it == code) || words.iter().any(|it| it.word == code);
    let mut free = (queue_full..=u16::MAX).filter(|code| !is_default(*code) && !is_taken(*code));
    let mut others = codes.iter().filter(|(code, _)| !is_default(*code));
    for (name, default) in defaults {
        if let Some((code, count)) = codes.iter().find(|(code, _)| *code == default) {
            writeln!(text, "{name} = {code} # ? answered {}; the code is the default", times(*count))?;
        } else if let Some((code, count)) = others.next() {
            writeln!(text, "{name} = {code} # ? answered {}; its meaning is unknown", times(*count))?;
        } else if is_taken(default) {
            let code = free.next().unwrap_or_default();
            writeln!(text, "{name} = {code} # ? not in the capture, where the default is a command word")?;
        } else {
            writeln!(text, "# {name} = {default} is not in the capture: the default")?;
        }
    }
    for (code, count) in others {
        writeln!(text, "# ? {code} was answered {}: it fits no name", times(*count))?;
    }
    Ok(())
}

/// Returns a number of times as text.
fn times(count: usize) -> String {
    if count == 1 { "once".into() } else { format!("{count} times") }
}

/// Returns the class of a word, the reason, and whether it is a guess.
fn class(word: &CommandWord) -> (&'static str, String, &'static str) {
    let mut answers = word.answers.clone();
    answers.sort_unstable();
    let usual = answers.get(answers.len() / 2).copied();
    let late = answers.iter().filter(|it| **it > AT_ONCE).count() * SHARE > answers.len();
    let after = usual.map_or_else(String::new, |usual| format!("answered after {} ms", usual.as_millis()));
    match usual {
        _ if word.together > 0 => {
            ("interpreted", format!("{} of them in a frame with others", word.together), doubt(word.together))
        }
        Some(_) if word.values * SHARE > answers.len() => {
            ("query", format!("{after}, with values"), doubt(word.values))
        }
        Some(usual) if late && usual >= NO_TIME => ("immediate", after, doubt(answers.len())),
        None => ("interpreted", "never answered individually".into(), "? "),
        Some(usual) if usual >= NO_TIME => ("interpreted", after, "? "),
        Some(_) => ("interpreted", "its answers have no times".into(), "? "),
    }
}

fn doubt(seen: usize) -> &'static str {
    if seen < MIN_SIGHTINGS { "? " } else { "" }
}

fn known(words: &mut Vec<CommandWord>, word: u16) -> &mut CommandWord {
    let at = words.iter().position(|known| known.word == word).unwrap_or_else(|| {
        words.push(CommandWord { word, ..CommandWord::default() });
        words.len() - 1
    });
    #[expect(clippy::indexing_slicing, reason = "it is there, or was pushed")]
    &mut words[at]
}

/// Returns the command words of a frame: each instruction begins with a short of its own. A word is unsigned, a short is
/// signed.
fn words_of(message: &Value) -> Vec<u16> {
    let items = message.get("items").and_then(Value::as_array).into_iter().flatten();
    let shorts = items.filter_map(|item| item.get("i16")?.as_array());
    let words = shorts.filter(|values| values.len() == 1).filter_map(|values| values.first()?.as_i64());
    words.filter_map(|word| Some(i16::try_from(word).ok()?.cast_unsigned())).collect()
}
