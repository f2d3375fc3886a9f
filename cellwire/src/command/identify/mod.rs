//! `cellwire identify`: which link and which of its options explain bytes.

mod input;
#[cfg(unix)]
mod line;
#[cfg(unix)]
mod live;
mod report;
mod settings;

use std::path::PathBuf;
use std::time::Duration;

use anyhow::{Context, Result, bail};
use cellwire_links::identify::{Finding, draft, identify};
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
///
/// --serial listens to a serial line: with 300 to 115200 baud, eight or seven data bits, each parity, in turn. Which explain what is
/// heard shows in broken characters (a low bit where a stop bit is due, a wrong parity), and in what the links make of the rest.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// The link, where it is known [default: all are tried]
    #[arg(long, value_parser = link_parser())]
    link: Option<&'static Link>,
    /// The side that sends the bytes, where it is known; in a trace, the end that wrote it [default: all are tried]
    #[arg(long, value_name = "SIDE")]
    from: Option<String>,
    /// Listen to this serial port in place of reading a file
    #[arg(long, value_name = "PORT", conflicts_with_all = ["file", "format", "port"])]
    serial: Option<String>,
    /// How long to listen to a serial port; Ctrl-C ends it before
    #[arg(long, value_name = "TIME", value_parser = humantime::parse_duration, default_value = "60s")]
    listen_for: Duration,
    /// Print one JSON object for each conversation in place of tables
    #[arg(long)]
    json: bool,
    /// Write the settings to a TOML file for --settings, with remarks on what is undecided
    #[arg(long, value_name = "FILE")]
    write: Option<PathBuf>,
    /// Write a draft of what no bytes say to a TOML file: the messages of a kawasaki-msg plant by their roles, the words of a laser-eb90
    /// installation by class, as they were used in the capture. What is uncertain has a remark with a ?: correct it
    #[arg(long, value_name = "FILE")]
    draft: Option<PathBuf>,
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
  cellwire identify --serial /dev/ttyUSB0 --listen-for 2m     a serial line of an unknown rate, by listening
  cellwire decode laser-eb90 --settings cell.toml …           what was found, in use

Exit status: 0 every conversation is explained   1 one is not";

/// Returns true when every conversation is explained, and not by chance.
pub fn run(args: &Args) -> Result<bool> {
    if let (Some(from), Some(link)) = (&args.from, args.link) {
        link.side(Some(from))?;
    }
    let conversations = match &args.serial {
        Some(name) => vec![heard(args, name)?],
        None => input::read(args)?,
    };
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
            found.push((best, conversation));
        }
    }
    if args.rust {
        for (finding, conversation) in &found {
            report::rust(finding, conversation.carrier)?;
        }
    }
    for (file, is_draft) in [(&args.write, false), (&args.draft, true)] {
        let Some(file) = file else { continue };
        let text = match found.as_slice() {
            [(finding, conversation)] if is_draft => draft(finding, &conversation.streams)?,
            [(finding, _)] => settings::toml(finding)?,
            [] => bail!("nothing is sure enough to be written to {}", file.display()),
            _ => bail!(
                "{} conversations are explained: choose one with --port to write its settings",
                found.len()
            ),
        };
        files::write(file, text.as_bytes())?;
    }
    Ok(all)
}

/// What is said on a serial line, after its rate and format are told.
#[cfg(unix)]
fn heard(args: &Args, name: &str) -> Result<Conversation> {
    let line = live::listen(args, name)?;
    if args.json {
        report::line_json(&line)?;
    } else {
        report::line(&line)?;
    }
    Ok(line.conversation)
}

#[cfg(not(unix))]
fn heard(_: &Args, _: &str) -> Result<Conversation> {
    bail!(
        "a port that marks broken characters needs Unix: capture with cellwire tap, at a rate that you know"
    )
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
