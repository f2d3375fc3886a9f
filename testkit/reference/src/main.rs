//! Writes and checks the data of the reference for ports.
//!
//! ```text
//! cargo run -p reference -- write [LINK]     writes every file of `reference/` that is made from `testkit/reference/inputs`,
//!                                            and docs/settings.md and docs/costs.md
//! cargo run -p reference -- check [LINK]     fails where a file differs, or a story or vector does not hold
//! ```

#![forbid(unsafe_code)]

mod codec;
mod defaults;
mod ends;
mod explore;
mod pages;
mod programs;
mod states;
mod story;
mod streams;
mod values;
mod vectors;

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use cellwire_links::LINKS;
use cellwire_links::reference::json;
use clap::{Parser, Subcommand};

#[derive(Parser)]
#[command(about = "Writes and checks the data of the reference for ports")]
struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Writes every file
    Write {
        /// Only the files of this link
        link: Option<String>,
    },
    /// Fails where a file differs
    Check {
        /// Only the files of this link
        link: Option<String>,
    },
    /// Prints stories that reach cells which no story reaches yet, to be added to the inputs
    Explore {
        /// The link
        link: String,
        /// How many random stories are tried for each end
        #[arg(default_value_t = 20_000)]
        seeds: u64,
    },
}

fn main() -> Result<()> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    match Args::parse().command {
        Command::Explore { link, seeds } => explore::explore(&root, &link, seeds),
        Command::Write { link } => {
            for (path, text) in files(&root, link.as_deref())? {
                if let Some(folder) = path.parent() {
                    std::fs::create_dir_all(folder)?;
                }
                std::fs::write(&path, text).with_context(|| path.display().to_string())?;
            }
            Ok(())
        }
        Command::Check { link } => check(&root, link.as_deref()),
    }
}

fn check(root: &Path, link: Option<&str>) -> Result<()> {
    let mut differ = 0;
    for (path, text) in files(root, link)? {
        let found = std::fs::read_to_string(&path).unwrap_or_default();
        let line = found.lines().zip(text.lines()).take_while(|(found, made)| found == made).count();
        if found != text {
            eprintln!("{}: line {} is not what the generator writes", path.display(), line + 1);
            differ += 1;
        }
    }
    if differ > 0 {
        bail!("{differ} files differ: cargo run -p reference -- write, and look at the difference");
    }
    Ok(())
}

/// Returns every file, or those of one link, and its text.
fn files(root: &Path, only: Option<&str>) -> Result<Vec<(PathBuf, String)>> {
    let reference = root.join("reference");
    let defaults = defaults::file()?;
    let mut files = pages::files(root, &defaults)?;
    files.push((reference.join("defaults.json"), defaults));
    let all: Vec<&str> = LINKS.iter().map(|link| link.name).collect();
    let links: Vec<&str> = all.iter().copied().filter(|link| only.is_none_or(|only| only == *link)).collect();
    ensure!(!links.is_empty(), "the links are {}", all.join(", "));
    for link in links {
        let file = format!("{link}.json");
        files.push((reference.join("vectors").join(&file), vectors::file(root, link)?));
        if let Some(text) = streams::file(root, link)? {
            files.push((reference.join("streams").join(&file), text));
        }
        files.push((reference.join("states").join(&file), states::file(link)?));
        if let Some(text) = story::file(root, link)? {
            files.push((reference.join("sessions").join(&file), text));
        }
    }
    files.push((
        reference.join("states").join(format!("{}.json", states::LATCH)),
        states::file(states::LATCH)?,
    ));
    let file = format!("{}.json", programs::LINK);
    files.push((reference.join("vectors").join(&file), programs::vectors(root)?));
    files.push((reference.join("streams").join(&file), programs::streams(root)?));
    Ok(files)
}

/// The independent implementations of the results: `reference/checks/ports.py` compares them with our decoders.
const INDEPENDENT: &str =
    "\"every result is also that of ports/python and ports/c, written from the specification alone\"";

/// Reads an input file, if there is one.
fn input<T: serde::de::DeserializeOwned>(root: &Path, kind: &str, link: &str) -> Result<Option<T>> {
    let path = root.join("testkit/reference/inputs").join(kind).join(format!("{link}.json"));
    if !path.exists() {
        return Ok(None);
    }
    let text = std::fs::read_to_string(&path)?;
    serde_json::from_str(&text).map(Some).with_context(|| path.display().to_string())
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_files_are_those_that_the_generator_writes() -> anyhow::Result<()> {
        super::check(&std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../.."), None)
    }
}
