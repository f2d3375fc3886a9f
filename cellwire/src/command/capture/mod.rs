//! `cellwire capture`: makes tests of recordings.

mod anonymous;
mod message;
mod range;
mod story;
mod vectors;

use std::io::Write as _;
use std::path::{Path, PathBuf};

use anyhow::Result;
use cellwire_links::reference::json;
use clap::Subcommand;

use self::range::RangeArgs;
use cellwire_io::files;
use cellwire_io::output::stdout;

/// Converts part of a capture to a test file in the reference's format, for `reference/field/`.
///
/// `cellwire vectors check reference/field` checks such a file.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    ToVectors(VectorsArgs),
    ToStory(story::Args),
}

/// Writes the messages of a range as vectors, and each side's bytes as a stream
#[derive(Debug, clap::Args)]
#[command(override_usage = "\
cellwire capture to-vectors [OPTIONS] --source <TEXT> --out <FILE>
           <LINK> [FILE]")]
struct VectorsArgs {
    #[command(flatten)]
    stretch: RangeArgs,
    #[command(flatten)]
    out: OutArgs,
}

/// The destination of the file, and its description.
#[derive(Debug, clap::Args)]
struct OutArgs {
    /// The origin of the capture: machine, controller version, and date
    #[arg(long, value_name = "TEXT")]
    source: String,
    /// The file; - is standard output
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

/// Returns true if the requested stretch is complete.
pub fn run(args: &Args) -> Result<bool> {
    match &args.command {
        Command::ToVectors(args) => vectors::run(args),
        Command::ToStory(args) => story::run(args),
    }
}

impl OutArgs {
    /// Writes a file with these lists.
    fn write(&self, link: &str, lists: &[(&str, Vec<String>)]) -> Result<()> {
        let mut head = vec![("link", json::text(link)?), ("source", json::text(&self.source)?)];
        let Some(((last, items), others)) = lists.split_last() else { return Ok(()) };
        for (name, items) in others {
            head.push((name, format!("[\n    {}\n  ]", items.join(",\n    "))));
        }
        let text = json::file("field.schema.json", &head, last, items);
        match self.out.as_path() {
            path if path == Path::new("-") => Ok(stdout().write_all(text.as_bytes())?),
            path => files::write(path, text.as_bytes()),
        }
    }
}
