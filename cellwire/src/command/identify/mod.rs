//! `cellwire identify`: which link and which of its options explain bytes.

mod input;
#[cfg(unix)]
mod line;
#[cfg(unix)]
mod live;
mod report;
mod settings;

use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context, Result, bail, ensure};
use cellwire_identify::{DecidedBy, Finding, OpenSetting, identify};
use cellwire_links::{LINKS, Link};

use self::input::Conversation;
use super::source::SourceArgs;
use crate::devices::link_parser;
use cellwire_io::files;
use cellwire_io::input::time;
use cellwire_io::output::{counted, remark};

/// Identifies the link of a capture, and the options that the link's source leaves open.
///
/// Tries every combination of options on the bytes, in every format that decode reads; the first bytes show which. A
/// combination is ruled out when another one decodes bytes that would be corrupt under it. Corrupt bytes, and a capture that
/// begins in the middle of a message, are tolerated. Options that the bytes do not determine are listed with their other
/// values and the message that would decide: let the ends send that message, and capture again. --write writes a file for
/// --settings of decode, simulate and the clients; --rust prints the configuration of the link's crate as a module for a program.
///
/// --serial listens to a serial line at 300 to 115200 baud, with eight or seven data bits and each parity, in turn. The choice
/// follows from framing and parity errors, and from how well the links decode the rest.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// The link, if known [default: all are tried]
    #[arg(long, value_parser = link_parser())]
    link: Option<&'static Link>,
    /// The side that sends the bytes, if known; in a trace, the end that wrote it [default: all are tried]
    #[arg(long, value_name = "SIDE")]
    from: Option<String>,
    /// Listen to this serial port instead of reading a file
    #[arg(long, value_name = "PORT", conflicts_with_all = ["file", "format", "port"])]
    serial: Option<String>,
    /// How long to listen to a serial port; Ctrl-C ends it earlier
    #[arg(long = "for", value_name = "TIME", value_parser = time(Duration::from_millis(1)..=Duration::from_secs(86_400)), default_value = "60s")]
    duration: Duration,
    /// Print one JSON object for each conversation instead of tables
    #[arg(long)]
    json: bool,
    /// Write the settings to a TOML file for --settings, with comments on undecided ones
    #[arg(long, value_name = "FILE")]
    write: Option<PathBuf>,
    /// Write a draft of the plant's settings to a TOML file: those of --write, and for kawasaki the messages by role, for
    /// laser the words by class, as used in the capture. A ? marks each line that two messages or more do not prove: check it
    #[arg(long, value_name = "FILE")]
    draft: Option<PathBuf>,
    /// Print the settings as a Rust module instead of tables, with comments on undecided ones
    #[arg(long, conflicts_with = "json")]
    rust: bool,
    #[command(flatten)]
    source: SourceArgs,
}

const EXAMPLES: &str = "\
Examples:
  cellwire identify monday.pcapng                      each conversation
  cellwire identify port.bin --link laser              the options of a known link
  cellwire identify monday.pcapng --port 2001 --write cell.toml
  cellwire identify --serial /dev/ttyUSB0 --for 2m     a line of unknown baud rate
  cellwire decode laser --settings cell.toml …         use the result

Exit status: 0 every conversation was identified   1 one was not";

/// Returns true when every conversation is identified, and not by chance.
pub fn run(args: &Args) -> Result<bool> {
    ensure!(args.draft.is_none() || args.draft != args.write, "--write and --draft name one file: give two");
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
        } else if !args.rust {
            report::tables(conversation, &findings)?;
        }
        if let Some(best) = findings.into_iter().next().filter(Finding::is_sure) {
            found.push((best, conversation));
        }
    }
    let only = |to: &str| match found.as_slice() {
        [(finding, conversation)] => Ok((finding, *conversation)),
        [] => bail!("no result is certain enough to {to}"),
        _ => bail!("{} conversations were identified: choose one with --port to {to}", found.len()),
    };
    if args.rust {
        let (finding, conversation) = only("print as Rust")?;
        report::rust(finding, conversation)?;
    }
    for (file, is_draft) in [(&args.write, false), (&args.draft, true)] {
        let Some(file) = file else { continue };
        let (finding, conversation) = only(&format!("write {}", file.display()))?;
        let text = if is_draft { settings::draft(finding, conversation)? } else { settings::toml(finding)? };
        files::write(file, text.as_bytes())?;
        remark(&written(file, finding, &text, is_draft));
    }
    Ok(all)
}

/// Returns a remark with the name of the written file, and the number of its lines that are to be checked.
fn written(file: &Path, finding: &Finding, text: &str, is_draft: bool) -> String {
    let is_undecided = |option: &&OpenSetting| matches!(option.decided, DecidedBy::Not { .. });
    let left = match is_draft {
        true => match text.lines().filter(|line| line.contains("# ?")).count() {
            0 => "no line has a ?".into(),
            1 => "check the line with a ?".into(),
            marked => format!("check the {marked} lines with a ?"),
        },
        false => match finding.options.iter().filter(is_undecided).count() {
            0 => "every setting is decided".into(),
            left => format!("{} undecided, see the comments", counted(left, "setting")),
        },
    };
    let what = if is_draft { "draft" } else { "settings" };
    format!("{} has the {what} of {}: {left}", file.display(), finding.link.short)
}

/// Listens to a serial line: reports its rate and format, and returns its bytes.
#[cfg(unix)]
fn heard(args: &Args, name: &str) -> Result<Conversation> {
    let line = live::listen(args, name)?;
    if args.json {
        report::line_json(&line)?;
    } else {
        report::line(&line, if args.rust { "//! " } else { "" })?;
    }
    Ok(line.conversation)
}

#[cfg(not(unix))]
fn heard(_: &Args, _: &str) -> Result<Conversation> {
    bail!("detecting the rate needs Unix: capture with cellwire tap, at a known rate")
}

/// Returns the findings of the links for a conversation, the best first.
fn findings(links: &[&'static Link], conversation: &Conversation) -> Result<Vec<Finding>> {
    let mut findings = Vec::new();
    for link in links {
        let finding = identify(link, &conversation.streams).with_context(|| link.short)?;
        if finding.messages[0] > 0 {
            findings.push(finding);
        }
    }
    findings.sort_by(|a, b| b.rank().total_cmp(&a.rank()));
    Ok(findings)
}
