//! The reader of `reference/vectors/<link>.json`; its schema is `reference/vectors.schema.json`.

use serde::{Deserialize, Deserializer};
use serde_json::{Map, Value};

/// One test vector.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Vector {
    /// Unique in its file, for ever: a vector that is withdrawn takes its number with it.
    pub id: u32,
    /// What it shows.
    pub comment: String,
    /// The side that sends these bytes, where the link's sides differ: `pc`, `robot`, `host` …
    #[serde(default)]
    pub from: Option<String>,
    /// Settings other than the link's defaults, such as `{"framing":"rtu"}`.
    #[serde(default)]
    pub options: Map<String, Value>,
    /// The bytes on the wire. In the file: hex, spaced by field.
    #[serde(deserialize_with = "hex")]
    pub hex: Vec<u8>,
    /// What a decoder makes of them.
    pub result: Outcome,
    /// The decoded object, for `valid` and `acceptable`.
    #[serde(default)]
    pub message: Option<Value>,
    /// The decode error's object for `invalid`: its `kind`, and whatever else the vector pins down.
    #[serde(default)]
    pub error: Option<Value>,
    /// The section of the source, or of the project's notes on it.
    pub source: String,
    /// The result is given only at the end of the stream: the vector is incomplete.
    #[serde(default)]
    pub end: bool,
    /// The error is all that the bytes give; other errors may follow it otherwise.
    #[serde(default)]
    pub only: Option<bool>,
    /// The clauses of the specification that it tests.
    pub clauses: Vec<String>,
    /// Words to filter by, such as `stuffing` or `limit`.
    #[serde(default)]
    pub flags: Vec<String>,
}

/// What a decoder makes of a vector's bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// Decodes to the object, and the object encodes to exactly these bytes.
    Valid,
    /// Decodes to the object; the encoder writes it another way.
    Acceptable,
    /// Gives the error.
    Invalid,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(rename = "$schema")]
    _schema: String,
    link: String,
    #[serde(rename = "source")]
    _source: String,
    #[serde(rename = "independent")]
    _independent: String,
    vectors: Vec<Vector>,
    /// What an encoder refuses: `cargo run -p reference -- check` asks it.
    #[serde(default, rename = "refused")]
    _refused: Vec<Value>,
    /// What words mean: `reference/checks/values.py` computes it.
    #[serde(default, rename = "values")]
    _values: Vec<Value>,
}

/// The vectors of a link, in the order of the file.
///
/// # Panics
/// When the file is missing, does not fit the schema, is another link's, or uses an id twice.
pub fn vectors(link: &str) -> Vec<Vector> {
    let path = format!("{}/../reference/vectors/{link}.json", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{path}: {e}"));
    let file: File = serde_json::from_str(&text).unwrap_or_else(|e| panic!("{path}: {e}"));
    assert_eq!(file.link, link, "{path} is another link's");
    let mut ids: Vec<u32> = file.vectors.iter().map(|v| v.id).collect();
    ids.sort_unstable();
    assert!(ids.windows(2).all(|w| w[0] != w[1]), "{path} uses an id twice");
    for v in &file.vectors {
        let fits = match v.result {
            Outcome::Valid | Outcome::Acceptable => v.message.is_some() && v.error.is_none(),
            Outcome::Invalid => {
                v.error.as_ref().is_some_and(|e| e.get("kind").is_some()) && v.message.is_none()
            }
        };
        assert!(fits, "{path}, vector {}: a message or an error, as the result requires", v.id);
    }
    file.vectors
}

/// True when `actual` holds everything that `expected` holds: a vector pins down an error's kind and, where it matters,
/// its fields.
pub fn includes(actual: &Value, expected: &Value) -> bool {
    match (actual, expected) {
        (Value::Object(a), Value::Object(e)) => {
            e.iter().all(|(key, value)| a.get(key).is_some_and(|found| includes(found, value)))
        }
        _ => actual == expected,
    }
}

fn hex<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<u8>, D::Error> {
    let text = String::deserialize(deserializer)?;
    let digits: String = text.split_whitespace().collect();
    if !digits.len().is_multiple_of(2) {
        return Err(serde::de::Error::custom(format!("an odd number of hex digits: {text}")));
    }
    (0..digits.len())
        .step_by(2)
        .map(|i| {
            u8::from_str_radix(digits.get(i..i + 2).unwrap_or("?"), 16).map_err(serde::de::Error::custom)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn an_error_object_may_say_more_than_the_vector() {
        let actual = json!({"kind": "length", "expected": 4, "found": 5});
        assert!(includes(&actual, &json!({"kind": "length"})));
        assert!(includes(&actual, &json!({"kind": "length", "found": 5})));
        assert!(!includes(&actual, &json!({"kind": "length", "found": 6})));
        assert!(!includes(&actual, &json!({"kind": "length", "offset": 0})));
    }

    #[test]
    fn hex_is_spaced_by_field() {
        let v: Vector = serde_json::from_value(json!({
            "id": 1, "comment": "", "hex": "10 1002 a017", "result": "invalid", "error": {"kind": "x"}, "source": "", "clauses": []
        }))
        .unwrap();
        assert_eq!(v.hex, [0x10, 0x10, 0x02, 0xA0, 0x17]);
    }
}
