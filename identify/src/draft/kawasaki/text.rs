//! The text of a draft. What a capture holds is escaped, in values and in comments.

use core::fmt::Write as _;

use super::super::{TWICE, toml_text};
use super::{Fields, Guess, Kind, Line};

/// The roles that a plant may lack.
const OPTIONAL: [&str; 3] = ["job_ack", "pause", "order_interrupt"];

/// The draft: `work` are the places of a job's own fields, `left` the messages without a role.
pub(super) fn draft(
    guesses: &[Guess<'_>],
    job: &Kind,
    work: &[usize],
    left: &[&Kind],
    acks: Option<i64>,
    fields: &Fields<'_>,
) -> String {
    let mut text = String::from("# A draft from a capture: correct what has a ?.\n\n");
    let is_latin1 =
        |name: &str, values: &[String]| !name.is_ascii() || values.iter().any(|it| !it.is_ascii());
    let letters = fields
        .kinds
        .iter()
        .flat_map(|kind| kind.all.iter().filter(|(_, values)| is_latin1(&kind.name, values)));
    let (charset, doubt) = match letters.count() {
        0 => ("ascii", " # ? no other letter is in the capture"),
        1 => ("latin1", " # ? one message has other letters"),
        TWICE.. => ("latin1", ""),
    };
    let mut line = |line: core::fmt::Arguments<'_>| {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{line}");
    };
    line(format_args!("charset = \"{charset}\"{doubt}"));
    match acks {
        Some(every) => line(format_args!("acks = {every} # ? most acknowledged jobs have such numbers")),
        None => line(format_args!("# acks = 1 # ? no job is acknowledged in the capture")),
    }
    let highest = fields.jobs.iter().max().copied().unwrap_or_default();
    line(format_args!("# max_number = 9999 # ? the highest in the capture is {highest}"));
    // Which of a job's values are its own fields.
    let is_divided = guesses.first().is_some_and(|job| job.header.is_sure && job.fields.is_sure);
    for (count, at) in work.iter().enumerate() {
        line(format_args!("\n[[job]]\nname = \"field_{}\" # ? its name in your tables", count + 1));
        own_field(job, *at, is_divided, &mut line);
    }
    for guess in guesses {
        message(guess, &mut line);
    }
    for kind in left {
        let (name, side, count) = (kind.name.escape_debug(), kind.side, kind.all.len());
        line(format_args!("\n# ? {name} is sent by the {side}, {count} times: it fits no role"));
    }
    text
}

fn own_field(job: &Kind, at: usize, is_divided: bool, line: &mut impl FnMut(core::fmt::Arguments<'_>)) {
    let decimals = job.values(at).filter_map(|value| value.split_once('.')).map(|(_, places)| places.len());
    let numbers: Vec<f64> = job.values(at).filter_map(|value| value.trim().parse().ok()).collect();
    let texts = job.all.len() - numbers.len();
    if texts > 0 {
        let longest = job.values(at).map(|value| value.chars().count()).max().unwrap_or_default();
        let doubt = match texts {
            _ if !is_divided => " # ? it may be a part of the message",
            1 => " # ? one value is not a number",
            _ => "",
        };
        line(format_args!("kind = \"text\"{doubt}\nlength = [0, {longest}] # ? the longest in the capture"));
        return;
    }
    let (low, high) =
        numbers.iter().fold((f64::MAX, f64::MIN), |(low, high), it| (low.min(*it), high.max(*it)));
    let doubt = "# ? a text may look like a number";
    match decimals.max() {
        None => {
            line(format_args!("kind = \"whole\" {doubt}\nrange = [{low}, {high}] # ? that of the capture"))
        }
        Some(places) => line(format_args!(
            "kind = \"decimal\" {doubt}\nplaces = {places} # ? the most in the capture\nrange = [{low:?}, {high:?}] # ? that of the capture"
        )),
    }
}

fn message(guess: &Guess<'_>, line: &mut impl FnMut(core::fmt::Arguments<'_>)) {
    let Guess { role, kind, why, is_sure, header, fields } = guess;
    line(format_args!("\n[messages.{role}]"));
    let Some(kind) = kind else {
        let lacks = if OPTIONAL.contains(role) { "sent = false " } else { "" };
        let then =
            if *role == "order_interrupt" { "; without it the PC needs takeover = \"end\"" } else { "" };
        return line(format_args!("{lacks}# ? not in the capture{then}"));
    };
    let doubt = if *is_sure { "" } else { "? " };
    line(format_args!("name = {} # {doubt}{} of them: {why}", toml_text(&kind.name), kind.all.len()));
    for (key, Line { fields, is_sure }) in [("header", header), ("fields", fields)] {
        let list: Vec<String> = fields.iter().map(|field| toml_text(field)).collect();
        let doubt = if *is_sure { "" } else { " # ? guessed from few messages" };
        line(format_args!("{key} = [{}]{doubt}", list.join(", ")));
    }
}
