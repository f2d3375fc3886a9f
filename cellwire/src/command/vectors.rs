//! `cellwire vectors check`: checks the tool's codecs against the reference vectors.

mod programs;

use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use cellwire_links::link::Link;
use cellwire_links::reference::field::Field;
use cellwire_links::vectors::vectors_in;
use clap::Subcommand;
use include_dir::{Dir, include_dir};

use cellwire_io::output::{counted, printable, stdout};

/// The reference vectors.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Decodes and encodes every vector; prints one line per link, and every vector that differs. For `reference/field`: every
    /// vector, stream and story of each file
    Check {
        /// The folder of the vectors; by default `reference/vectors`, or the built-in ones
        dir: Option<PathBuf>,
    },
}

/// The reference's vectors.
static BUILT_IN: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/../reference/vectors");

/// Returns true when every vector agrees.
pub fn run(args: &Args) -> Result<bool> {
    let Command::Check { dir } = &args.command;
    let here = Path::new("reference/vectors");
    let Some(dir) = dir.as_deref().or_else(|| here.is_dir().then_some(here)) else {
        let mut all = true;
        for file in BUILT_IN.files() {
            let text = file.contents_utf8().context("the vectors are not text")?;
            all &= check_text(name_of(file.path()), text)?;
        }
        return Ok(all);
    };
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
    let name = name_of(path);
    if name != "fanuc-ls" && Link::by_name(name).is_err() {
        return check_field(path, name);
    }
    check_text(name, &std::fs::read_to_string(path)?)
}

fn name_of(path: &Path) -> &str {
    path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default()
}

fn check_text(name: &str, text: &str) -> Result<bool> {
    if name == "fanuc-ls" {
        return programs::check_file(name, text);
    }
    let (link, vectors) = (Link::by_name(name)?, vectors_in(text)?);
    report(name, vectors.iter().map(|v| (v.id, v.comment.as_str(), v.check(link, &[&v.bytes]))))
}

/// Checks a file of recordings from the field, which has a name of its own.
fn check_field(path: &Path, name: &str) -> Result<bool> {
    let field = Field::read(path)?;
    let result = field.check();
    let mut out = stdout();
    match &result {
        Ok(count) => {
            writeln!(out, "{name}: {count} vectors, streams and stories of {}, 0 disagree", field.link)?
        }
        Err(error) => writeln!(out, "{}", printable(&format!("{name}: {error:#}")))?,
    }
    Ok(result.is_ok())
}

/// Prints the disagreements, and their number; returns true without any disagreement.
fn report<'a>(name: &str, checked: impl Iterator<Item = (u32, &'a str, Result<()>)>) -> Result<bool> {
    let (mut all, mut disagree, mut out) = (0, 0, stdout());
    for (id, comment, result) in checked {
        all += 1;
        if let Err(error) = result {
            disagree += 1;
            let line = printable(&format!("{name} {id}: {error:#} ({comment})"));
            writeln!(out, "{line}")?;
        }
    }
    writeln!(out, "{name}: {}, {disagree} disagree", counted(all, "vector"))?;
    Ok(disagree == 0)
}
