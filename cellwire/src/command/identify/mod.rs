//! `cellwire identify`: which link and which of its options explain bytes.

mod input;
mod report;
mod settings;

use std::path::PathBuf;

use anyhow::{Context, Result, bail};
use cellwire_links::identify::{Finding, identify};
use cellwire_links::{LINKS, Link};

use self::input::Conversation;
use super::source::SourceArgs;
use crate::io::files;
use crate::links::link_parser;

/// Finds out which link a capture is of, and how its ends speak: the options that the link's source leaves open.
///
/// Every combination of options is tried on the bytes, in every format that decode reads. A combination is ruled out when what another
/// one explains would have to be corruption under it; corrupt bytes, and a capture that begins in the middle of a message, do not
/// matter. What the bytes do not decide is said, with the other values and the message that would decide it: let the ends send
/// that message, and capture again. --write makes the file for --settings of decode, simulate and the clients, --rust the lines
/// for a program.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// The link, where it is known [default: all are tried]
    #[arg(long, value_parser = link_parser())]
    link: Option<&'static Link>,
    /// The side that sends the bytes, where it is known; in a trace, the end that wrote it [default: all are tried]
    #[arg(long, value_name = "SIDE")]
    from: Option<String>,
    /// Print one JSON object for each conversation in place of tables
    #[arg(long)]
    json: bool,
    /// Write the settings to a TOML file for --settings, with remarks on what is undecided
    #[arg(long, value_name = "FILE")]
    write: Option<PathBuf>,
    /// Print the settings as Rust, for the configuration of the link's crate
    #[arg(long)]
    rust: bool,
    #[command(flatten)]
    source: SourceArgs,
}

const EXAMPLES: &str = "\
Examples:
  cellwire identify --format pcap monday.pcapng               each conversation of a capture
  cellwire identify --format raw port.bin --link laser-eb90   the options of a link that is known
  cellwire identify --format pcap monday.pcapng --port 2001 --write cell.toml
  cellwire decode laser-eb90 --settings cell.toml …           what was found, in use

Exit status: 0 every conversation is explained   1 one is not";

/// Returns true when every conversation is explained, and not by chance.
pub fn run(args: &Args) -> Result<bool> {
    if let (Some(from), Some(link)) = (&args.from, args.link) {
        link.side(Some(from))?;
    }
    let conversations = input::read(args)?;
    let links: Vec<&'static Link> = args.link.map_or_else(|| LINKS.iter().collect(), |link| vec![link]);
    let mut all = true;
    let mut found = Vec::new();
    for conversation in &conversations {
        let findings = findings(&links, conversation)?;
        all &= findings.first().is_some_and(Finding::is_sure);
        if args.json {
            report::json(conversation, &findings)?;
        } else {
            report::tables(conversation, &findings)?;
        }
        if let Some(best) = findings.into_iter().next().filter(Finding::is_sure) {
            found.push(best);
        }
    }
    if args.rust {
        for finding in &found {
            report::rust(finding)?;
        }
    }
    if let Some(file) = &args.write {
        match found.as_slice() {
            [finding] => files::write(file, settings::toml(finding)?.as_bytes())?,
            [] => bail!("nothing is sure enough to be written to {}", file.display()),
            _ => bail!(
                "{} conversations are explained: choose one with --port to write its settings",
                found.len()
            ),
        }
    }
    Ok(all)
}

/// What each link makes of a conversation, the best first.
fn findings(links: &[&'static Link], conversation: &Conversation) -> Result<Vec<Finding>> {
    let mut findings = Vec::new();
    for link in links {
        let finding = identify(link, &conversation.streams).with_context(|| link.name)?;
        if finding.messages[0] > 0 {
            findings.push(finding);
        }
    }
    findings.sort_by(|a, b| b.rank().total_cmp(&a.rank()));
    Ok(findings)
}
