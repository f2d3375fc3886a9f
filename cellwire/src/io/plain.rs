//! An event as a line for people.

use serde_json::{Map, Number, Value};

/// The event, or the first name, and then each other name with its value: `answered: lines 1 to 20, outcome done`.
pub(super) fn line(event: &Value) -> String {
    let Value::Object(fields) = event else { return value(event) };
    let Some(name) = fields.get("event").and_then(Value::as_str) else { return pairs(fields) };
    let mut fields = fields.clone();
    fields.shift_remove("event");
    let text = pairs(&fields);
    let name = name.replace('_', " ");
    if text.is_empty() { name } else { format!("{name}: {text}") }
}

fn pairs(fields: &Map<String, Value>) -> String {
    let fields = fields.iter().filter(|(_, it)| !it.is_null());
    let pairs: Vec<String> =
        fields.map(|(name, it)| format!("{} {}", name.replace('_', " "), value(it))).collect();
    pairs.join(", ")
}

fn value(of: &Value) -> String {
    match of {
        Value::String(text) => text.clone(),
        Value::Bool(is) => if *is { "yes" } else { "no" }.to_owned(),
        Value::Array(values) => values.iter().map(value).collect::<Vec<_>>().join(" "),
        Value::Object(fields) => format!("({})", pairs(fields)),
        Value::Number(it) => number(it),
        Value::Null => "null".to_owned(),
    }
}

/// A number, without decimals if it has none: `40` for 40.0.
pub fn number(number: &Number) -> String {
    let text = number.to_string();
    text.strip_suffix(".0").map_or_else(|| text.clone(), str::to_owned)
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::line;

    #[test]
    fn an_event_is_a_line() {
        let event = json!({"event": "not_sent", "jobs": [1, 20], "why": "it is out of reach", "at": null});
        assert_eq!(line(&event), "not sent: jobs 1 20, why it is out of reach");
        assert_eq!(
            line(&json!({"ready": "fanuc", "listen": "127.0.0.1:5020"})),
            "ready fanuc, listen 127.0.0.1:5020"
        );
        assert_eq!(line(&json!({"event": "paused"})), "paused");
        assert_eq!(line(&json!({"mm": [40.0, -2.5, 7]})), "mm 40 -2.5 7");
        assert_eq!(
            line(&json!({"mm": {"least": [0.5, 1], "is_closed": true}})),
            "mm (least 0.5 1, is closed yes)"
        );
    }
}
