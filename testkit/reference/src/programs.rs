//! The files of fanuc-ls: texts that can be read, in the place of bytes.

use std::path::Path;

use anyhow::{Context, Result, bail, ensure};
use fanuc_ls::{CommentRule, Document, Problem, Program, Rules};
use serde::Deserialize;
use serde_json::{Map, Value, json};

use crate::json::{self, Object};

pub(crate) const LINK: &str = "fanuc-ls";

/// The independent implementations of the results: `reference/checks/ports.py` compares them with our reader and
/// writer.
const INDEPENDENT: &str = "\"every result is also that of ports/python and ports/c\"";

/// The kinds of program parts that are vectors: the name, the key in the program's object, and the text before and
/// after the part.
const PARTS: [(&str, &str, &str, &str); 3] = [
    ("attribute", "attributes", "/PROG  A\r\n/ATTR\r\n", "\r\n/MN\r\n/POS\r\n/END\r\n"),
    ("statement", "instructions", "/PROG  A\r\n/MN\r\n", "\r\n/POS\r\n/END\r\n"),
    ("position", "positions", "/PROG  A\r\n/MN\r\n/POS\r\n", "\r\n/END\r\n"),
];

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Vectors {
    source: String,
    vectors: Vec<Vector>,
    refused: Vec<Refused>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Vector {
    id: u32,
    comment: String,
    part: Option<String>,
    #[serde(default)]
    options: Map<String, Value>,
    text: String,
    /// The message that another reader has made of the text; compared with that of our reader.
    message: Option<Value>,
    error: Option<Value>,
    source: String,
    clauses: Vec<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Refused {
    id: u32,
    comment: String,
    part: Option<String>,
    #[serde(default)]
    options: Map<String, Value>,
    message: Value,
    clauses: Vec<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Streams {
    streams: Vec<Stream>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Stream {
    id: u32,
    comment: String,
    encoding: Option<String>,
    #[serde(default)]
    options: Map<String, Value>,
    text: String,
    clauses: Vec<String>,
}

/// Returns the text of `vectors/fanuc-ls.json`.
pub(crate) fn vectors(root: &Path) -> Result<String> {
    let inputs: Vectors = crate::input(root, "vectors", LINK)?.context("fanuc-ls has no vectors")?;
    let mut lines = Vec::new();
    for vector in &inputs.vectors {
        lines.push(line(vector).with_context(|| format!("vector {}: {}", vector.id, vector.comment))?);
    }
    let mut refused = Vec::new();
    for vector in &inputs.refused {
        refused.push(refuse(vector).with_context(|| format!("refused {}: {}", vector.id, vector.comment))?);
    }
    let parts = PARTS.map(|(part, list, before, behind)| {
        (part, json!({"list": list, "before": before, "behind": behind}))
    });
    let head = [
        ("link", json::text(LINK)?),
        ("source", json::text(&inputs.source)?),
        ("independent", INDEPENDENT.into()),
        (
            "parts",
            json::text(
                &parts.into_iter().map(|(part, list)| (part.to_owned(), list)).collect::<Map<_, _>>(),
            )?,
        ),
        ("refused", format!("[\n    {}\n  ]", refused.join(",\n    "))),
    ];
    Ok(json::file("vectors.schema.json", &head, "vectors", &lines))
}

/// Returns the text of `streams/fanuc-ls.json`.
pub(crate) fn streams(root: &Path) -> Result<String> {
    let inputs: Streams = crate::input(root, "streams", LINK)?.context("fanuc-ls has no streams")?;
    let mut lines = Vec::new();
    for stream in &inputs.streams {
        lines.push(streamed(stream).with_context(|| format!("stream {}: {}", stream.id, stream.comment))?);
    }
    let head = [("link", json::text(LINK)?), ("independent", INDEPENDENT.into())];
    Ok(json::file("streams.schema.json", &head, "streams", &lines))
}

fn line(vector: &Vector) -> Result<String> {
    let part = Part::new(vector.part.as_deref())?;
    let rules = rules(&vector.options)?;
    let object = Object::new()
        .value("id", &vector.id)?
        .value("comment", &vector.comment)?
        .optional("part", vector.part.as_ref())?
        .optional("options", (!vector.options.is_empty()).then_some(&vector.options))?
        .value("text", &vector.text)?;
    let object = match Program::decode(&part.whole(&vector.text)) {
        Ok(program) => {
            let message = part.take(&program)?;
            ensure!(vector.error.is_none(), "reads as {message}");
            if let Some(stated) = &vector.message {
                ensure!(*stated == message, "reads as {message}, not as {stated}");
            }
            let written = program.to_text(&rules);
            if let Ok(written) = &written {
                let again = Program::decode(written)?;
                // Blanks at the end of a text are not written.
                ensure!(again.to_text(&rules).as_ref() == Ok(written), "written, it is another program");
            }
            let written = written.map(|written| part.strip(&written).map(str::to_owned));
            let is_same = written.as_ref().is_ok_and(|written| *written == Some(vector.text.clone()));
            let result = if is_same { "valid" } else { "acceptable" };
            let object = object.value("result", result)?.value("message", &message)?;
            match written {
                Ok(_) if is_same => object,
                Ok(Some(written)) => object.value("written", &written)?,
                Ok(None) => bail!("written, it is more than its part"),
                Err(error) => object.value("refused", &error)?,
            }
        }
        Err(error) => {
            let error = part.inside(&error)?;
            ensure!(vector.message.is_none(), "gives {error}");
            if let Some(stated) = &vector.error {
                ensure!(*stated == error, "gives {error}, not {stated}");
            }
            object.value("result", "invalid")?.value("error", &error)?
        }
    };
    Ok(object.value("source", &vector.source)?.value("clauses", &vector.clauses)?.end())
}

fn refuse(vector: &Refused) -> Result<String> {
    let error = match encode(vector.part.as_deref(), &vector.options, vector.message.clone())? {
        Ok(text) => bail!("it is written: {text:?}"),
        Err(error) => error,
    };
    Ok(Object::new()
        .value("id", &vector.id)?
        .value("comment", &vector.comment)?
        .optional("part", vector.part.as_ref())?
        .optional("options", (!vector.options.is_empty()).then_some(&vector.options))?
        .value("message", &vector.message)?
        .value("error", &error)?
        .value("clauses", &vector.clauses)?
        .end())
}

fn streamed(stream: &Stream) -> Result<String> {
    let bytes = match stream.encoding.as_deref() {
        None => stream.text.clone().into_bytes(),
        Some("latin1") => stream.text.chars().map(u8::try_from).collect::<Result<_, _>>()?,
        Some(other) => bail!("no encoding {other}"),
    };
    let items: Vec<String> =
        items(&bytes, &rules(&stream.options)?)?.iter().map(json::text).collect::<Result<_>>()?;
    Ok(Object::new()
        .value("id", &stream.id)?
        .value("comment", &stream.comment)?
        .optional("encoding", stream.encoding.as_ref())?
        .optional("options", (!stream.options.is_empty()).then_some(&stream.options))?
        .value("text", &stream.text)?
        .value("clauses", &stream.clauses)?
        .raw("items", format_args!("[\n      {}\n    ]", items.join(",\n      ")))
        .end())
}

/// Returns all items that a reader finds in a file, in sequence.
fn items(bytes: &[u8], rules: &Rules) -> Result<Vec<Value>> {
    let document = match Document::decode_bytes(bytes) {
        Ok(document) => document,
        Err(error) => {
            let text = core::str::from_utf8(bytes);
            let length =
                text.map_or_else(|_| bytes.iter().map(|&byte| char::from(byte).len_utf8()).sum(), str::len);
            return Ok(vec![json!({"offset": 0, "length": length, "error": error})]);
        }
    };
    let mut items = Vec::new();
    for entry in document.entries(rules) {
        let (offset, length) = (entry.place.start, entry.place.len());
        if let Some(content) = entry.content {
            items.push(json!({"offset": offset, "length": length, "message": content}));
        }
        for finding in entry.findings {
            let key = if matches!(finding.problem, Problem::Error(_)) { "error" } else { "warning" };
            items.push(json!({"offset": offset, "length": length, key: finding}));
        }
    }
    Ok(items)
}

/// Encodes a message object: returns its text, or the object of the writer's error.
fn encode(part: Option<&str>, options: &Map<String, Value>, message: Value) -> Result<Result<String, Value>> {
    let Ok(program) = serde_json::from_value::<Program>(Part::new(part)?.give(message)) else {
        return Ok(Err(json!({"kind": "message"})));
    };
    match program.to_text(&rules(options)?) {
        Ok(text) => Ok(Ok(text)),
        Err(error) => Ok(Err(serde_json::to_value(error)?)),
    }
}

fn rules(options: &Map<String, Value>) -> Result<Rules> {
    let mut rules = Rules::default();
    for (name, value) in options {
        match (name.as_str(), value.as_str()) {
            ("name_limit", _) => rules.name_limit = serde_json::from_value(value.clone())?,
            ("comment", Some("truncate")) => rules.comment = CommentRule::Truncate,
            _ => bail!("no option {name}: {value}"),
        }
    }
    Ok(rules)
}

/// A part of a program, or the whole of it.
struct Part(Option<(&'static str, &'static str, &'static str)>);

impl Part {
    fn new(name: Option<&str>) -> Result<Self> {
        let Some(name) = name else { return Ok(Self(None)) };
        let found = PARTS.iter().find(|(part, ..)| *part == name);
        let (_, list, before, behind) = found.with_context(|| format!("a program has no part {name}"))?;
        Ok(Self(Some((list, before, behind))))
    }

    fn whole(&self, text: &str) -> String {
        self.0.map_or_else(|| text.to_owned(), |(_, before, behind)| format!("{before}{text}{behind}"))
    }

    /// Returns the text without the frame around the part; `None` if there is more than the part.
    fn strip<'a>(&self, text: &'a str) -> Option<&'a str> {
        let Some((_, before, behind)) = self.0 else { return Some(text) };
        text.strip_prefix(before)?.strip_suffix(behind)
    }

    fn take(&self, program: &Program) -> Result<Value> {
        let program = serde_json::to_value(program)?;
        let Some((list, ..)) = self.0 else { return Ok(program) };
        match program.get(list).and_then(Value::as_array).map(Vec::as_slice) {
            Some([only]) => Ok(only.clone()),
            other => bail!("{other:?} is not one of {list}"),
        }
    }

    fn give(&self, message: Value) -> Value {
        let Some((list, ..)) = self.0 else { return message };
        let mut program = json!({"name": "A", "instructions": [], "positions": []});
        if let Some(program) = program.as_object_mut() {
            program.insert(list.to_owned(), json!([message]));
        }
        program
    }

    /// Returns an error with its offset in the part.
    fn inside(&self, error: &fanuc_ls::DecodeError) -> Result<Value> {
        let mut object = serde_json::to_value(error)?;
        let before = self.0.map_or("", |(_, before, _)| before);
        for (key, passed) in [("line", before.matches('\n').count()), ("offset", before.len())] {
            let place = object.get(key).and_then(Value::as_u64).context("an error has a place")?;
            let place = place.checked_sub(passed as u64).context("the error is before the part")?;
            if let Some(slot) = object.get_mut(key) {
                *slot = place.into();
            }
        }
        Ok(object)
    }
}
