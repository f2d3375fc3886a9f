//! The text of a draft. Contents of the capture are escaped, in values and in comments.

use core::fmt::Write as _;

use anyhow::Result;
use cellwire_links::kawasaki_msg::layout::MAX_TEXT;

use super::super::MIN_SIGHTINGS;
use super::message::accepted;
use super::{Guess, Kind, UsedNames, number};

/// The most decimals of a number.
const MAX_PLACES: usize = 6;

/// The greatest number of a field without a range, in units of its last decimal.
const WIDEST: f64 = 9_999_999.0;

/// The fields of a drawing's line, as the simulated ends and pictures have them.
const LINE: [&str; 5] = ["kind", "x1", "y1", "x2", "y2"];

/// Returns the draft: `work` has the indices of a job's own fields, `left` the messages without a role.
pub(super) fn draft(
    guesses: &[Guess<'_>],
    job: &Kind,
    work: &[usize],
    left: &[&Kind],
    acks: Option<i64>,
    (fields, charset): (&UsedNames<'_>, &str),
) -> Result<String> {
    let mut text = String::from("# A draft from a capture: correct what has a ?.\n\n");
    let is_latin1 =
        |name: &str, values: &[String]| !name.is_ascii() || values.iter().any(|it| !it.is_ascii());
    let letters = fields
        .kinds
        .iter()
        .flat_map(|kind| kind.all.iter().filter(|(_, values)| is_latin1(&kind.name, values)));
    let doubt = match letters.count() {
        0 => " # ? no other letter is in the capture",
        1 => " # ? one message has other letters",
        MIN_SIGHTINGS.. => "",
    };
    writeln!(text, "charset = \"{charset}\"{doubt}")?;
    match acks {
        Some(every) => writeln!(text, "acks = {every} # ? most acknowledged jobs have such numbers")?,
        None => writeln!(text, "# acks = 1 # ? no job is acknowledged in the capture")?,
    }
    let highest = fields.jobs.iter().max().copied().unwrap_or_default();
    writeln!(text, "# max_number = 9999 # ? the highest in the capture is {highest}")?;
    // The job's own fields.
    let is_divided = guesses.first().is_some_and(|job| job.header.is_sure && job.fields.is_sure);
    let is_line = is_line(job, work);
    for (count, at) in work.iter().enumerate() {
        match LINE.get(count).filter(|_| is_line) {
            Some(name) => {
                writeln!(text, "\n[[job]]\nname = \"{name}\" # ? it looks like a line of a drawing")?
            }
            None => writeln!(text, "\n[[job]]\nname = \"field_{}\" # ? its name in your tables", count + 1)?,
        }
        text += &own_field(job, *at, is_divided);
    }
    for message in accepted(guesses, fields, charset) {
        text += &message.text();
    }
    for kind in left {
        let (name, side, count) = (kind.name.escape_debug(), kind.side, kind.all.len());
        writeln!(text, "\n# ? {name} is sent by the {side}, {count} times: it fits no role")?;
    }
    Ok(text)
}

/// Returns whether a job's own fields are five whole numbers, the first of them 1 or 2: a line of a drawing.
fn is_line(job: &Kind, work: &[usize]) -> bool {
    let is_whole = |at: &usize| job.values(*at).all(|value| number(value).is_some());
    let is_kind = |at: &usize| job.numbers(*at).iter().all(|kind| (1..=2).contains(kind));
    work.len() == LINE.len() && work.iter().all(is_whole) && work.first().is_some_and(is_kind)
}

/// Returns the kind of a job's own field, without a range, so that jobs other than those of the capture are accepted.
fn own_field(job: &Kind, at: usize, is_divided: bool) -> String {
    let decimals = job.values(at).filter_map(|value| value.split_once('.')).map(|(_, places)| places.len());
    let numbers: Vec<f64> = job.values(at).filter_map(|value| value.trim().parse().ok()).collect();
    let (low, high) =
        numbers.iter().fold((f64::MAX, f64::MIN), |(low, high), it| (low.min(*it), high.max(*it)));
    let places = decimals.max();
    let is_number = |places: usize| {
        let scale = 10_f64.powi(i32::try_from(places).unwrap_or(i32::MAX));
        places <= MAX_PLACES && low.abs().max(high.abs()) * scale <= WIDEST
    };
    let texts = job.all.len() - numbers.len();
    if texts > 0 || !is_number(places.unwrap_or_default()) {
        let lengths = || job.values(at).map(|value| value.chars().count());
        let (shortest, longest) = (lengths().min().unwrap_or_default(), lengths().max().unwrap_or_default());
        let doubt = match texts {
            _ if !is_divided => " # ? it may be a part of the message",
            1 => " # ? one value is not a number",
            _ => "",
        };
        let limit = match longest {
            0..=MAX_TEXT => "",
            _ => "; such a job cannot be read",
        };
        return format!(
            "kind = \"text\"{doubt}\n# length = [0, {MAX_TEXT}] # in the capture {shortest} to {longest}{limit}\n"
        );
    }
    let doubt = "# ? a text may look like a number";
    match places {
        None => format!(
            "kind = \"whole\" {doubt}\n# range = [{low}, {high}] # in the capture; without it any number\n"
        ),
        Some(places) => format!(
            "kind = \"decimal\" {doubt}\nplaces = {places} # ? the most in the capture\n# range = [{low:?}, {high:?}] # in the capture; without it any number\n"
        ),
    }
}
