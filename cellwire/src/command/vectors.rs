//! `cellwire vectors check`: checks the tool's codecs against the reference vectors.

mod programs;

use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::Subcommand;
use serde::Deserialize;
use serde_json::{Map, Value};

use crate::command::encode::hex;
use cellwire_links::codec::{Item, Stream};
use cellwire_links::link::Link;

/// The reference vectors.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Decodes and encodes every vector; prints one line per link, and every vector that does not agree
    Check {
        /// The folder of the vectors
        #[arg(default_value = "reference/vectors")]
        dir: PathBuf,
    },
}

#[derive(Deserialize)]
struct File {
    vectors: Vec<Vector>,
}

#[derive(Deserialize)]
struct Vector {
    id: u32,
    comment: String,
    from: Option<String>,
    #[serde(default)]
    options: Map<String, Value>,
    hex: String,
    result: String,
    message: Option<Value>,
    error: Option<Value>,
}

/// Returns true when every vector agrees.
pub fn run(args: &Args) -> Result<bool> {
    let Command::Check { dir } = &args.command;
    let mut files: Vec<PathBuf> = std::fs::read_dir(dir)
        .with_context(|| format!("cannot read {}; give the folder of the vectors", dir.display()))?
        .map(|entry| Ok(entry?.path()))
        .collect::<Result<_>>()?;
    files.retain(|path| path.extension().is_some_and(|e| e == "json"));
    files.sort();
    anyhow::ensure!(!files.is_empty(), "{} has no vectors: no file ends in .json", dir.display());
    let mut all = true;
    for path in &files {
        all &= check_file(path).with_context(|| path.display().to_string())?;
    }
    Ok(all)
}

fn check_file(path: &Path) -> Result<bool> {
    let name = path.file_stem().and_then(|s| s.to_str()).unwrap_or_default();
    let text = std::fs::read_to_string(path)?;
    if name == "fanuc-ls" {
        return programs::check_file(name, &text);
    }
    let link = Link::by_name(name)?;
    let file: File = serde_json::from_str(&text)?;
    let (mut disagree, mut out) = (0, std::io::stdout());
    for vector in &file.vectors {
        if let Err(error) = check(link, vector) {
            disagree += 1;
            writeln!(out, "{name} {}: {error:#} ({})", vector.id, vector.comment)?;
        }
    }
    writeln!(out, "{name}: {} vectors, {disagree} disagree", file.vectors.len())?;
    Ok(disagree == 0)
}

fn check(link: &Link, vector: &Vector) -> Result<()> {
    let codec = || (link.codec)(link.side(vector.from.as_deref())?, &vector.options);
    let bytes = unhex(&vector.hex)?;
    let (mut items, mut covered) = (Vec::new(), 0);
    let mut emit = |item: Item<'_>| {
        covered += item.length;
        items.push(item.content()?);
        Ok(())
    };
    let mut stream = Stream::new(codec()?);
    stream.push(&bytes, &mut emit)?;
    stream.finish(&mut emit)?;
    anyhow::ensure!(covered == bytes.len() as u64, "the items cover {covered} of {} bytes", bytes.len());
    match (vector.result.as_str(), &vector.message, &vector.error) {
        ("valid" | "acceptable", Some(message), _) => {
            anyhow::ensure!(items == [Ok(message.clone())], "decodes to {items:?}, not to {message}");
            if vector.result == "valid" {
                let encoded = codec()?.encode(message.clone())?;
                anyhow::ensure!(encoded == bytes, "encodes to {}", hex(&encoded));
            }
            Ok(())
        }
        ("invalid", _, Some(error)) => {
            let fits = items.iter().any(|item| matches!(item, Err(found) if includes(found, error)));
            anyhow::ensure!(fits, "gives {items:?}, not the error {error}");
            Ok(())
        }
        _ => anyhow::bail!("the vector has neither a message nor an error"),
    }
}

/// True when `found` contains everything that `expected` contains.
fn includes(found: &Value, expected: &Value) -> bool {
    match (found, expected) {
        (Value::Object(found), Value::Object(expected)) => {
            expected.iter().all(|(key, value)| found.get(key).is_some_and(|f| includes(f, value)))
        }
        _ => found == expected,
    }
}

fn unhex(text: &str) -> Result<Vec<u8>> {
    let digits: Vec<u8> = text.bytes().filter(|b| !b.is_ascii_whitespace()).collect();
    let pairs = digits.chunks(2).map(|pair| Ok(u8::from_str_radix(core::str::from_utf8(pair)?, 16)?));
    pairs.collect::<Result<_>>().with_context(|| format!("not hex: {text}"))
}
