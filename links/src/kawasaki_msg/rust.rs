//! A plant as Rust: its table of messages, its character set, and its job as a type.

use std::fmt::Write as _;

use anyhow::Result;
use kawasaki_msg::{Charset, Decimal, Dialect, Entry};
use serde_json::{Map, Value};

use super::layout::{FieldType, Layout};
use super::options::CodecSettings;
use crate::settings;

/// Returns the module of a program whose plant has these settings. A table of messages or a job that is the default is
/// omitted.
pub(super) fn rust(given: &Map<String, Value>) -> Result<String> {
    let plant = settings::read("kawasaki", CodecSettings::default(), given)?.plant;
    let (dialect, layout) = (plant.dialect()?, plant.layout()?);
    let is_default = dialect.entries().len() == Dialect::DEFAULT.entries().len()
        && dialect.entries().iter().all(|entry| Dialect::DEFAULT.entries().contains(entry));
    let work = (!layout.is_line()).then(|| work(&layout)).transpose()?;
    let mut used = vec!["Charset"];
    if !is_default {
        used.extend(["ConfigError", "Dialect", "Entry", "Field", "Role"]);
    }
    if work.is_some() {
        used.extend(["FieldVisitor", "VisitResult", "Work"]);
        if layout.fields().iter().any(|field| matches!(field.holds, FieldType::Text { .. })) {
            used.push("Text");
        }
    }
    used.sort_unstable();
    let used = if let [only] = used.as_slice() { (*only).into() } else { format!("{{{}}}", used.join(", ")) };
    let table = if is_default { charset(plant.charset) } else { table(&dialect, plant.charset)? };
    let work = work.map(|work| format!("\n\n{work}")).unwrap_or_default();
    Ok(format!("use kawasaki_msg::{used};\n\n{table}{work}"))
}

fn charset(charset: Charset) -> String {
    format!("pub fn charset() -> Charset {{\n    Charset::{charset:?}\n}}")
}

/// Returns the table of messages, as the plant's dialect.
fn table(dialect: &Dialect, charset: Charset) -> Result<String> {
    let mut text = format!("static MESSAGES: [Entry; {}] = [\n", dialect.entries().len());
    for Entry { role, name, header, fields } in dialect.entries() {
        let [header, fields] = [header, fields].map(|fields| {
            fields.iter().map(|field| format!("Field::{field:?}")).collect::<Vec<_>>().join(", ")
        });
        writeln!(
            text,
            "    Entry {{\n        role: Role::{role:?},\n        name: {name:?},\n        header: &[{header}],\n        fields: &[{fields}],\n    }},"
        )?;
    }
    write!(
        text,
        "];\n\npub fn dialect() -> Result<Dialect, ConfigError> {{\n    Ok(Dialect::new(&MESSAGES)?.with_charset(Charset::{charset:?}))\n}}"
    )?;
    Ok(text)
}

/// Returns the type of a job, and its fields in the sequence of the wire.
fn work(layout: &Layout) -> Result<String> {
    let mut members = String::new();
    let mut visits = Vec::new();
    for field in layout.fields() {
        let (name, identifier) = (&field.name, identifier(&field.name));
        match field.holds {
            FieldType::Number { places, min, max } => {
                let [least, most] = [min, max].map(|units| Decimal { units, places });
                let unit = if places == 0 { String::new() } else { format!(", in units of 1e-{places}") };
                writeln!(members, "    /// {least} to {most}{unit}.\n    pub {identifier}: i32,")?;
                visits.push(format!(
                    "fields.decimal({name:?}, &mut self.{identifier}, {places}, {min}..={max})"
                ));
            }
            FieldType::Text { min, max } => {
                writeln!(members, "    /// {min} to {max} characters.\n    pub {identifier}: Text<{max}>,")?;
                visits.push(format!("fields.text({name:?}, &mut self.{identifier}, {min}..={max})"));
            }
        }
    }
    let visits = visits.join("?;\n        ");
    Ok(format!(
        "/// A job of the plant.\n#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]\npub struct Job {{\n{members}}}\n\nimpl Work for Job {{\n    type Ranges = ();\n\n    fn fields<F: FieldVisitor>(&mut self, (): &(), fields: &mut F) -> VisitResult {{\n        {visits}\n    }}\n}}"
    ))
}

/// Returns a field's name as an identifier of Rust: only letters, digits and `_`.
fn identifier(name: &str) -> String {
    let lower = name.to_ascii_lowercase();
    let is_keyword = matches!(
        lower.as_str(),
        "abstract"
            | "as"
            | "async"
            | "await"
            | "become"
            | "box"
            | "break"
            | "const"
            | "continue"
            | "do"
            | "dyn"
            | "else"
            | "enum"
            | "extern"
            | "false"
            | "final"
            | "fn"
            | "for"
            | "gen"
            | "if"
            | "impl"
            | "in"
            | "let"
            | "loop"
            | "macro"
            | "match"
            | "mod"
            | "move"
            | "mut"
            | "override"
            | "priv"
            | "pub"
            | "ref"
            | "return"
            | "static"
            | "struct"
            | "super"
            | "self"
            | "crate"
            | "trait"
            | "true"
            | "try"
            | "type"
            | "typeof"
            | "unsafe"
            | "unsized"
            | "use"
            | "virtual"
            | "where"
            | "while"
            | "yield"
    );
    match lower.chars().next() {
        Some(first) if first.is_ascii_digit() => format!("field_{lower}"),
        _ if is_keyword || lower == "_" => format!("{lower}_"),
        _ => lower,
    }
}
