//! An event as text for people.

use serde_json::{Map, Number, Value};

/// The fields with sentences about an event, without their names.
const SENTENCES: [&str; 7] = ["why", "hint", "what", "text", "error", "peer", "path"];

/// Returns a line for an event: its name, then its outcome and its other fields: `answered: numbers 1 to 20; answer: done`.
/// Lines are at most `width` columns wide, except for a longer word; the second and following ones are indented.
pub(super) fn line(event: &Value, width: usize) -> String {
    let Value::Object(fields) = event else { return value(event) };
    let mut fields: Map<String, Value> = fields.clone().into_iter().filter(|(_, it)| !it.is_null()).collect();
    if fields.contains_key("offset") || fields.contains_key("connection") || fields.contains_key("ends") {
        return said(fields, width);
    }
    let head = match (fields.shift_remove("event"), fields.shift_remove("ready")) {
        (Some(name), _) => words(&value(&name)),
        (None, Some(device)) => format!("{} is ready", value(&device)),
        (None, None) => String::new(),
    };
    let sentence = SENTENCES.iter().find_map(|name| match fields.get(*name) {
        Some(Value::String(_)) => fields.shift_remove(*name),
        Some(Value::Object(error)) if error.contains_key("kind") => fields.shift_remove(*name),
        _ => None,
    });
    let mut pieces: Vec<String> = sentence.iter().map(value).chain(pairs(&fields)).collect();
    // The event names its first field: `order started: 7`.
    if let (None, Some(first), Some(named)) = (&sentence, pieces.first_mut(), head.split(' ').next())
        && let Some(rest) = first.strip_prefix(named).and_then(|rest| rest.strip_prefix(": "))
    {
        *first = rest.to_owned();
    }
    if pieces.is_empty() || head.is_empty() {
        return wrapped(&if head.is_empty() { pieces } else { vec![head] }, width);
    }
    let separator = if head.ends_with("ready") { "; " } else { ": " };
    if let Some(first) = pieces.first_mut() {
        *first = format!("{head}{separator}{first}");
    }
    wrapped(&pieces, width)
}

/// Returns a line of a conversation: its time or its offset, the end that sent it, and the message with its name:
/// `02:31:30.123 robot     Status: 7; 0`.
fn said(mut fields: Map<String, Value>, width: usize) -> String {
    let mut take = |name: &str| fields.shift_remove(name);
    let (time, at, offset) = (take("time"), take("at"), take("offset"));
    let when = match (&time, at, offset) {
        // Of `2026-11-30T02:31:30.123456Z`.
        (Some(time), ..) => time.as_str().and_then(|time| time.get(11..23)).unwrap_or_default().to_owned(),
        (_, Some(at), _) => format!("{:.3} s", at.as_f64().unwrap_or_default()),
        (.., offset) => format!("@{}", offset.as_ref().map_or_else(String::new, value)),
    };
    let length = take("length");
    // The ends of a connection are in its first line, and in JSON.
    drop((take("flow"), take("ends")));
    let connection =
        take("connection").filter(|it| *it != 1).map_or_else(String::new, |it| format!(" #{it}"));
    let from = take("from").map_or_else(String::new, |from| value(&from));
    let (name, rest) = match (take("message"), take("error"), take("shadow"), take("event")) {
        (Some(message), ..) => named(message),
        (_, Some(error), ..) => {
            let length = length.filter(|it| *it != 0).map(|it| format!("{it} bytes"));
            (
                Some("CORRUPT".into()),
                [value(&error)].into_iter().chain(length).chain(pairs(&fields)).collect(),
            )
        }
        (.., Some(kind), _) => {
            let clause =
                fields.shift_remove("clause").map_or_else(String::new, |it| format!(" {}", value(&it)));
            let name = format!("{}{clause}", value(&kind).to_uppercase());
            (Some(name), fields.shift_remove("text").iter().map(value).collect())
        }
        (.., Some(event)) => (Some(words(&value(&event))), pairs(&fields)),
        _ => (None, pairs(&fields)),
    };
    // As wide as the longest name of an end.
    let mut head = format!("{when}{connection} {from:<10}");
    if let Some(name) = name {
        head.push_str(&format!(" {name}{}", if rest.is_empty() { "" } else { ":" }));
    }
    let mut pieces = rest;
    match pieces.first_mut() {
        Some(first) => *first = format!("{head} {first}"),
        None => pieces.push(head),
    }
    wrapped(&pieces, width)
}

/// Returns the name of a message, which is its first field if that is a text, and its other fields.
fn named(message: Value) -> (Option<String>, Vec<String>) {
    let Value::Object(mut message) = message else { return (None, vec![value(&message)]) };
    message.retain(|_, it| it.as_array().is_none_or(|it| !it.is_empty()));
    let name = match message.iter().next() {
        Some((first, Value::String(name))) => Some((first.clone(), name.clone())),
        _ => None,
    };
    if let Some((first, _)) = &name {
        message.shift_remove(first);
    }
    (name.map(|(_, name)| name), pairs(&message))
}

/// Returns a message on one line: `Status: 7; 0`.
pub(super) fn message(message: &Value) -> String {
    let (name, fields) = named(message.clone());
    let fields = fields.join("; ");
    match name {
        Some(name) if fields.is_empty() => name,
        Some(name) => format!("{name}: {fields}"),
        None => fields,
    }
}

/// Returns each field as `name: value`.
fn pairs(fields: &Map<String, Value>) -> Vec<String> {
    let count = fields.get("count").and_then(Value::as_u64);
    let span = fields.get("first").and_then(Value::as_u64).zip(count);
    let total = fields.get("of");
    let pair = |(name, it): (&String, &Value)| match (name.as_str(), span) {
        ("first", Some((first, 1))) => Some(format!("number {first}")),
        ("first", Some((first, count))) => Some(format!("numbers {first} to {}", first + count.max(1) - 1)),
        ("count", Some(_)) => None,
        ("done", _) if total.is_some() => {
            Some(format!("{} of {} done", value(it), total.map_or_else(String::new, value)))
        }
        ("of", _) if fields.contains_key("done") => None,
        ("lines" | "outlines", _) => Some(match it.as_array().map(Vec::as_slice) {
            Some([first, last]) if first == last => {
                format!("{} {}", name.trim_end_matches('s'), value(first))
            }
            Some([first, last]) => format!("{name} {} to {}", value(first), value(last)),
            _ => format!("{name}: {}", value(it)),
        }),
        _ => Some(format!("{}: {}", words(name), value(it))),
    };
    fields.iter().filter(|(_, it)| !it.is_null()).filter_map(pair).collect()
}

/// Returns a name as words.
fn words(name: &str) -> String {
    name.replace('_', " ")
}

fn value(of: &Value) -> String {
    match of {
        Value::String(text) => text.clone(),
        Value::Bool(is) => if *is { "yes" } else { "no" }.to_owned(),
        Value::Array(values) => values.iter().map(value).collect::<Vec<_>>().join(", "),
        Value::Object(fields) => {
            let mut fields = fields.clone();
            let kind = fields.shift_remove("kind").map(|kind| words(&value(&kind)));
            let rest = pairs(&fields).join("; ");
            match (kind, rest.is_empty()) {
                (Some(kind), true) => kind,
                (Some(kind), false) => format!("{kind} ({rest})"),
                (None, _) => format!("({rest})"),
            }
        }
        Value::Number(it) => number(it),
        Value::Null => "none".to_owned(),
    }
}

/// Returns pieces with `; ` between them, in lines of this width.
fn wrapped(pieces: &[String], width: usize) -> String {
    const INDENT: &str = "  ";
    let columns = |text: &str| text.chars().count();
    let (mut text, mut column) = (String::new(), 0);
    for (at, piece) in pieces.iter().enumerate() {
        let piece = format!("{piece}{}", if at + 1 < pieces.len() { ";" } else { "" });
        // A piece that fits a line of its own is not divided.
        let is_whole = INDENT.len() + columns(&piece) <= width;
        let words = if is_whole { vec![piece.as_str()] } else { piece.split(' ').collect() };
        for word in words {
            if !text.is_empty() && column + 1 + columns(word) > width {
                text.push('\n');
                text.push_str(INDENT);
                column = INDENT.len();
            } else if !text.is_empty() {
                text.push(' ');
                column += 1;
            }
            text.push_str(word);
            column += columns(word);
        }
    }
    text
}

/// Returns a number, without decimals if it is whole: `40` for 40.0.
pub fn number(number: &Number) -> String {
    let text = number.to_string();
    text.strip_suffix(".0").map_or_else(|| text.clone(), str::to_owned)
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::{line, wrapped};

    fn shown(event: Value) -> String {
        line(&event, 80)
    }

    #[test]
    fn an_event_is_a_line() {
        for (event, expected) in [
            (
                json!({"event": "not_sent", "first": 1, "count": 20, "why": "it is out of reach", "at": null}),
                "not sent: it is out of reach; numbers 1 to 20",
            ),
            (json!({"event": "done", "first": 4, "count": 1, "lines": [7, 7]}), "done: number 4; line 7"),
            (
                json!({"event": "done", "first": 1, "count": 5, "outlines": [2, 4]}),
                "done: numbers 1 to 5; outlines 2 to 4",
            ),
            (json!({"ready": "fanuc", "listen": "127.0.0.1:5020"}), "fanuc is ready; listen: 127.0.0.1:5020"),
            (json!({"event": "paused"}), "paused"),
            (json!({"event": "disconnected", "why": "the PC has ended"}), "disconnected: the PC has ended"),
            (json!({"event": "resumed", "done": 3, "of": 8}), "resumed: 3 of 8 done"),
            (json!({"event": "left_out", "of": "noise", "count": 3}), "left out: of: noise; count: 3"),
            (json!({"event": "failed", "error": {"code": 3}}), "failed: error: (code: 3)"),
            (json!({"event": "order_over", "order": 7, "executed": 8}), "order over: 7; executed: 8"),
            (json!({"event": "connected", "peer": "10.0.0.7:502"}), "connected: 10.0.0.7:502"),
            (
                json!({"event": "rejected", "error": {"kind": "wrong_order", "active": 1, "found": 2}}),
                "rejected: wrong order (active: 1; found: 2)",
            ),
            (json!({"event": "question", "answers": ["done", "stop"]}), "question: answers: done, stop"),
            (json!({"mm": [40.0, -2.5, 7]}), "mm: 40, -2.5, 7"),
            (json!({"mm": {"least": [0.5, 1], "is_closed": true}}), "mm: (least: 0.5, 1; is closed: yes)"),
            (json!("a text"), "a text"),
        ] {
            assert_eq!(shown(event), expected);
        }
    }

    #[test]
    fn a_line_of_a_conversation_has_its_time_its_sender_and_its_name() {
        let message = json!({"name": "Tyo", "header": [], "fields": ["50", "1"]});
        let time = "2026-11-30T02:31:30.123456Z";
        for (line, expected) in [
            (
                json!({"flow": "a > b", "from": "robot", "time": time, "offset": 0, "length": 9, "message": message}),
                "02:31:30.123 robot      Tyo: fields: 50, 1",
            ),
            (
                json!({"from": "pc", "at": 0.25, "offset": 4, "length": 2, "message": {"ok": true}}),
                "0.250 s pc         ok: yes",
            ),
            (json!({"offset": 4, "length": 2, "message": {"command": "HLT"}}), "@4            HLT"),
            (
                json!({"time": time, "connection": 2, "from": "pc", "offset": 0, "length": 7, "error": {"kind": "no_head", "skipped": 7}}),
                "02:31:30.123 #2 pc         CORRUPT: no head (skipped: 7); 7 bytes",
            ),
            (
                json!({"time": time, "ends": "a > b", "from": "pc", "shadow": "rule", "clause": "KM-40", "text": "it is late"}),
                "02:31:30.123 pc         RULE KM-40: it is late",
            ),
            (json!({"time": time, "connection": 1, "event": "closed"}), "02:31:30.123            closed"),
        ] {
            assert_eq!(shown(line), expected);
        }
    }

    #[test]
    fn a_long_line_is_divided_between_fields_and_then_between_words() {
        let event = json!({
            "event": "ended", "why": "stopped", "done": 3, "unknown": 0, "refused": 0, "not_sent": 5,
            "machine": "the robot has no jobs of this file queued", "journal": "it.svg.journal",
        });
        let expected = "ended: stopped; done: 3; unknown: 0; refused: 0; not sent: 5;\n  \
                        machine: the robot has no jobs of this file queued; journal: it.svg.journal";
        assert_eq!(shown(event), expected);
        let event = json!({"event": "hint", "hint": "one two three four five six", "at": 7});
        assert_eq!(line(&event, 20), "hint: one two three\n  four five six;\n  at: 7");
    }

    #[test]
    fn lines_are_at_most_as_wide_as_they_may_be() {
        for (pieces, expected) in [
            // A piece stays on the line that it fills.
            (&["aaa", "bb c", "e"][..], "aaa; bb c;\n  e"),
            (&["aaa", "bb", "e"], "aaa; bb; e"),
            // A piece that is too long for the line fits the next.
            (&["aaa", "bb cc", "e"], "aaa;\n  bb cc; e"),
            (&["aaa", "bbbb cc", "e"], "aaa;\n  bbbb cc;\n  e"),
            // A piece that is too long for any line is divided between its words.
            (&["aaa", "bb cc dd", "e"], "aaa; bb cc\n  dd; e"),
            (&["aaa", "bb cc ddd"], "aaa; bb cc\n  ddd"),
            (&["aaa", "bbbbbb cc", "e"], "aaa;\n  bbbbbb\n  cc; e"),
            (&["aa bbbb cc", "e"], "aa bbbb\n  cc; e"),
            (&["aa bbb cc", "e"], "aa bbb cc;\n  e"),
            // Columns are characters.
            (&["ääää", "öööö"], "ääää; öööö"),
            // A longer word has a line of its own.
            (&["aa", "bbbbbbbbbbbbb", "e"], "aa;\n  bbbbbbbbbbbbb;\n  e"),
            (&["aaaaaaaaaaaaa b"], "aaaaaaaaaaaaa\n  b"),
        ] {
            assert_eq!(wrapped(&pieces.iter().map(|&piece| piece.into()).collect::<Vec<_>>(), 10), expected);
        }
    }
}
