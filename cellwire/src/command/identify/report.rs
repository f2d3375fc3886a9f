//! The text and the JSON of findings.

use std::io::{self, Write};

use anyhow::Result;
use cellwire_identify::unknown::{Check, Nearest, Number, StreamStructure, look, nearest};
use cellwire_identify::{DecidedBy, Finding, OpenSetting, draft};
use cellwire_links::LINKS;
use cellwire_links::kawasaki_msg::layout::Layout;
use comfy_table::Table;
use comfy_table::presets::NOTHING;
use kawasaki_msg::Charset;
use serde_json::{Map, Value, json};

use super::super::encode::hex;
use super::input::Conversation;
#[cfg(unix)]
use super::live::Line;
use super::settings::{or, plain, remarks, would_decide};
use crate::report::fit;
use cellwire_io::output::{counted, log, printable, stdout, terminal_columns, wrapped};

/// Tables: the links, and the options of the best.
pub(super) fn tables(conversation: &Conversation, findings: &[Finding]) -> Result<()> {
    let mut out = stdout();
    let bytes = conversation.len();
    writeln!(out, "{}: {}", printable(&conversation.name), counted(bytes, "byte"))?;
    let Some(best) = findings.first() else {
        writeln!(out, "  No link explains any of them, with any option.\n")?;
        return unknown(conversation, &mut out);
    };
    let mut links = table(["link", "bytes explained", "messages", "sent by", "by chance"]);
    for finding in findings {
        links.add_row([
            finding.link.short.to_owned(),
            share(finding),
            messages(finding),
            senders(finding),
            chance(finding.bits),
        ]);
    }
    writeln!(out, "{}\n", shown(links, terminal_columns()))?;
    if !best.is_sure() {
        let advice =
            "capture more, or at another point: most of the bytes should be messages, and several of them";
        say(&mut out, &format!("None of these is sure: {advice}."))?;
        writeln!(out)?;
        return unknown(conversation, &mut out);
    }
    if best.options.is_empty() {
        writeln!(out, "  It is {}, whose source leaves no option open.\n", best.link.short)?;
        return Ok(());
    }
    writeln!(out, "  It is {}:", best.link.short)?;
    let mut options = table(["option", "value", "decided by"]);
    for option in &best.options {
        options.add_row([option.name.clone(), plain(&option.value), decided(option)]);
    }
    writeln!(out, "{}", shown(options, terminal_columns()))?;
    for note in (best.link.open.notes)(&best.read) {
        say(&mut out, &note)?;
    }
    Ok(writeln!(out)?)
}

/// The bits of a chance of one in about a million.
const MILLION: f64 = 20.0;

/// The number of settings of a line that are shown.
#[cfg(unix)]
const SHOWN: usize = 8;

/// Prints the settings of a serial line; each line of the report begins with `mark`.
#[cfg(unix)]
pub(super) fn line(line: &Line, mark: &str) -> Result<()> {
    let mut settings = table(["line", "characters", "broken", "text", "link", "likelier than a wrong one"]);
    for it in line.judged.iter().take(SHOWN) {
        settings.add_row([
            it.setting.to_string(),
            it.characters.to_string(),
            it.broken.to_string(),
            format!("{:.0} %", 100.0 * it.text),
            it.link.unwrap_or_default().to_owned(),
            match it.bits {
                bits if bits < MILLION => format!("{:.0} times", bits.max(0.0).exp2()),
                _ => "over a million times".into(),
            },
        ]);
    }
    let likely: Vec<String> = line.judged.iter().take(line.likely).map(|it| it.setting.to_string()).collect();
    let decided = match likely.as_slice() {
        [only] => format!("The line has {only}."),
        several => format!("Undecided: {}; listen longer, while both ends speak.", several.join(" or ")),
    };
    let stop =
        "One stop bit or two: a receiver hears no difference. Send with two: who expects one reads them.";
    let settings = shown(settings, terminal_columns().map(|columns| columns.saturating_sub(mark.len())));
    let text = format!("{}:\n{settings}\n\n  {decided}\n  {stop}\n\n", line.conversation.name);
    let mut out = stdout();
    for line in text.lines() {
        writeln!(out, "{}", format!("{mark}{line}").trim_end())?;
    }
    Ok(())
}

/// Prints the settings of a serial line as one line.
#[cfg(unix)]
pub(super) fn line_json(line: &Line) -> Result<()> {
    log(&json!({"port": line.conversation.name, "likely": line.likely, "lines": line.judged}))
}

/// Writes the visible structure of bytes that no link explains.
fn unknown(conversation: &Conversation, out: &mut impl Write) -> Result<()> {
    let seen = look(&conversation.streams);
    if seen.is_empty() {
        writeln!(
            out,
            "  No marks divide the bytes into messages: capture more of them, one end on each line.\n"
        )?;
    }
    for (number, seen) in seen.iter().enumerate() {
        let which =
            if seen.begin.is_empty() { String::new() } else { format!(", begin with {}", hex(&seen.begin)) };
        let ends = if seen.end.is_empty() { String::new() } else { format!(", end with {}", hex(&seen.end)) };
        let [shortest, longest] = seen.lengths;
        writeln!(out, "  What can be seen of stream {}:", number + 1)?;
        let lengths =
            if shortest == longest { format!("{longest}") } else { format!("{shortest} to {longest}") };
        writeln!(out, "    {} messages of {lengths} bytes{which}{ends}", seen.messages)?;
        for line in lines(seen) {
            writeln!(out, "    {line}")?;
        }
        writeln!(out)?;
    }
    let near: Vec<Nearest> = nearest(&LINKS.iter().collect::<Vec<_>>(), &conversation.streams)?;
    for (which, near) in ["nearest", "next"].into_iter().zip(&near) {
        let Nearest { link, settings, side, begin, whole, wrong } = near;
        let wrong =
            wrong.as_ref().map_or_else(String::new, |kind| format!("; the most frequent error: {kind}"));
        let with: Vec<String> =
            settings.iter().map(|(name, value)| format!(" --set {name}={}", plain(value))).collect();
        let with = with.concat();
        let text = format!(
            "The {which} link is {link}{with}, sent by the {side}: {begin} messages begin as its own, {whole} of them are whole{wrong}."
        );
        say(out, &text)?;
    }
    Ok(writeln!(out)?)
}

/// Returns one line for each property that was found.
fn lines(seen: &StreamStructure) -> Vec<String> {
    let mut lines = Vec::new();
    if let Some(byte) = seen.doubled {
        lines.push(format!("{byte:02X} is doubled outside of marks"));
    }
    if let Some(Check { kind, width, order, from_end, first, before, constant, once }) = &seen.check {
        let place = match from_end {
            0 => "at the end".into(),
            bytes => format!("{bytes} bytes before the end"),
        };
        let up_to = match before {
            0 => "up to it".into(),
            bytes => format!("up to {bytes} bytes before it"),
        };
        let plus = if *constant == 0 { String::new() } else { format!(", and {constant:X}h") };
        let once = if *once { ", what is doubled once" } else { "" };
        let order = if *width == 1 { String::new() } else { format!(", {order}") };
        lines.push(format!(
            "checked by: {kind} of {}{order}, {place}: of the bytes from {first} {up_to}{once}{plus}",
            counted(*width as u64, "byte")
        ));
    }
    if let Some(length) = &seen.length {
        let field = match length.order {
            "digits" => format!("number {} of the text", length.at + 1),
            _ if length.width == 1 => format!("byte {}", length.at),
            order => format!("bytes {} and {}, {order}", length.at, length.at + 1),
        };
        lines.push(format!("length: {field}, and {} more", length.beside));
    }
    let number = |Number { at, kind, order }: &Number| match *kind {
        "digits" => format!("number {} of the text", at + 1),
        "u8" => format!("byte {at}"),
        kind => format!("{kind} {order} at byte {at}"),
    };
    for counter in &seen.counters {
        lines.push(format!("counter: {}", number(counter)));
    }
    if !seen.numbers.is_empty() {
        let numbers: Vec<String> = seen.numbers.iter().map(number).collect();
        lines.push(format!("numbers that change slowly: {}", numbers.join("; ")));
    }
    if !seen.constant.is_empty() {
        let constant: Vec<String> =
            seen.constant.iter().map(|(at, byte)| format!("{at}: {byte:02X}")).collect();
        lines.push(format!("the same in all: {}", constant.join(", ")));
    }
    lines
}

/// Prints a module with a function that returns the crate's configuration.
pub(super) fn rust(finding: &Finding, conversation: &Conversation) -> Result<()> {
    let mut settings = finding.settings.clone();
    let drafted = own_plant(finding, conversation)?;
    let is_own = drafted.is_some();
    settings.extend(drafted.unwrap_or_default());
    let echo = settings.remove("echo");
    let mut text = format!("//! {}: the options that explain a capture.\n", finding.link.short);
    for option in finding.options.iter().filter(|option| option.name != "echo") {
        remarks(&mut text, "//!", option)?;
    }
    if echo.is_some() {
        text.push_str(
            "//! The line returns what one end sends: `echo: true` in the configuration of that end.\n",
        );
    }
    if is_own {
        text.push_str(
            "//! The plant's messages and its job are guesses: --draft FILE writes them as settings, with what is uncertain.\n",
        );
    }
    let module = (finding.link.open.rust)(&settings, conversation.carrier)?;
    let module = if module.is_empty() {
        "// The source leaves no option open: the default configuration."
    } else {
        &module
    };
    Ok(writeln!(stdout(), "{text}\n{module}")?)
}

/// Returns the guessed table of messages and job of a plant of its own; `None` if the names and the job are the crate's.
fn own_plant(finding: &Finding, conversation: &Conversation) -> Result<Option<Map<String, Value>>> {
    if finding.link.short != "kawasaki" {
        return Ok(None);
    }
    let Ok(drafted) = draft(finding, &conversation.streams) else { return Ok(None) };
    let drafted: Map<String, Value> = toml::from_str(&drafted)?;
    let has_own_names = !(finding.link.open.notes)(&finding.read).is_empty();
    let draws = match drafted.get("job").and_then(Value::as_array) {
        Some(job) => Layout::read(job, Charset::Ascii).is_ok_and(|layout| layout.is_line()),
        None => true,
    };
    Ok((has_own_names || !draws).then_some(drafted))
}

/// Prints one line of JSON.
pub(super) fn json(conversation: &Conversation, findings: &[Finding]) -> Result<()> {
    let is_sure = findings.first().is_some_and(Finding::is_sure);
    let findings: Vec<Value> = findings.iter().map(finding_json).collect();
    let mut line =
        json!({"conversation": conversation.name, "bytes": conversation.len(), "findings": findings});
    if let (false, Value::Object(line)) = (is_sure, &mut line) {
        line.insert("seen".into(), json!(look(&conversation.streams)));
        line.insert(
            "nearest".into(),
            json!(nearest(&LINKS.iter().collect::<Vec<_>>(), &conversation.streams)?),
        );
    }
    log(&line)
}

fn finding_json(finding: &Finding) -> Value {
    let [messages, written] = finding.messages;
    let [explained, bytes] = finding.bytes;
    let options: Vec<Value> = finding.options.iter().map(option_json).collect();
    json!({
        "link": finding.link.short, "crate": finding.link.name, "sure": finding.is_sure(), "bits": finding.bits.round(),
        "explained": explained, "bytes": bytes, "messages": messages, "written_alike": written,
        "senders": finding.senders, "settings": finding.settings, "options": options,
        "notes": (finding.link.open.notes)(&finding.read),
    })
}

fn option_json(OpenSetting { name, value, decided }: &OpenSetting) -> Value {
    match decided {
        DecidedBy::ByBytes => json!({"name": name, "value": value, "decided": "bytes"}),
        DecidedBy::ByValues => json!({"name": name, "value": value, "decided": "values"}),
        DecidedBy::Not { others, message } => {
            let values: Vec<&Value> = others.iter().map(|it| &it.value).collect();
            let fewer: Vec<u64> = others.iter().map(|it| it.fewer).collect();
            let [values, fewer] =
                [json!(values), json!(fewer)].map(|it| if others.is_empty() { Value::Null } else { it });
            json!({
                "name": name, "value": value, "decided": "no", "others": values, "bytes_less": fewer, "message": message,
            })
        }
    }
}

fn table<const N: usize>(header: [&str; N]) -> Table {
    let mut table = Table::new();
    table.load_style(NOTHING).set_header(header);
    table
}

/// Returns the text of a table: at a terminal within its columns, otherwise each row in one line. Rows do not end with
/// blanks.
fn shown(mut table: Table, columns: Option<usize>) -> String {
    fit(&mut table, columns);
    let text = table.to_string();
    text.lines().map(str::trim_end).collect::<Vec<_>>().join("\n")
}

/// Prints a sentence below a table, in the columns of the terminal.
fn say(out: &mut impl Write, text: &str) -> io::Result<()> {
    write!(out, "{}", wrapped(text, terminal_columns().unwrap_or(usize::MAX), 2))
}

fn decided(option: &OpenSetting) -> String {
    match &option.decided {
        DecidedBy::ByBytes => "the bytes".into(),
        DecidedBy::ByValues => "its values: others make no sense".into(),
        DecidedBy::Not { others, message } => {
            format!("nothing yet: {}; {}", or(others), would_decide(others, message.as_deref()))
        }
    }
}

fn share(finding: &Finding) -> String {
    let [explained, all] = finding.bytes;
    format!("{:.1} % ({explained} of {all})", 100.0 * finding.share())
}

fn messages(finding: &Finding) -> String {
    match finding.messages {
        [messages, written] if messages == written => messages.to_string(),
        [messages, written] => format!("{messages}, {written} as they are written"),
    }
}

fn senders(finding: &Finding) -> String {
    let streams: Vec<String> =
        finding.senders.iter().filter(|sides| !sides.is_empty()).map(|sides| sides.join("+")).collect();
    let mut different: Vec<&str> = Vec::new();
    for stream in &streams {
        if !different.contains(&stream.as_str()) {
            different.push(stream);
        }
    }
    different.join(", ")
}

fn chance(bits: f64) -> String {
    match bits {
        bits if bits < 1.0 => "likely".into(),
        bits if bits < MILLION => format!("1 in {:.0}", bits.exp2()),
        _ => "under 1 in a million".into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_fits_a_terminal_without_splitting_words_and_is_one_line_a_row_elsewhere() {
        let mut options = table(["option", "value", "decided by"]);
        let why = "nothing yet: either explains the same; a frame that ends 90 83 would decide";
        options.add_row(["tail", "printed", why]).add_row(["flag", "separate", "the bytes"]);
        let rows = [" option  value     decided by", " flag    separate  the bytes"];
        let piped = shown(options.clone(), None);
        assert_eq!(
            piped.lines().collect::<Vec<_>>(),
            [rows[0], &format!(" tail    printed   {why}"), rows[1]]
        );
        for columns in [80, 60, 40] {
            let text = shown(options.clone(), Some(columns));
            assert!(text.lines().all(|line| line.chars().count() <= columns && !line.is_empty()), "{text}");
            let words = text.split_whitespace().collect::<Vec<_>>();
            assert!(why.split_whitespace().all(|word| words.contains(&word)), "{columns}: {text}");
        }
    }
}
