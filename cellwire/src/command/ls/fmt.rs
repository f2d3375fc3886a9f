//! `cellwire ls fmt`.

use std::io::{self, Write};
use std::path::PathBuf;

use anyhow::{Result, ensure};

use super::check::files;
use super::difference::Change;
use crate::io::output::{printable, remark};

/// Lays LS files out as controllers print them, and shows what changes; --write writes it.
///
/// Line numbers and what is behind them in their columns, `0.6sec`, `WAIT    .50(sec)`, coordinates with three decimals, attributes and
/// frames in their places. No word becomes another one; what is not understood, line ends and /APPL stay. A file that a controller wrote
/// does not change.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// The files; of a folder, every .ls file in and below it
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// Write the files
    #[arg(long)]
    write: bool,
    /// Name the files that are laid out otherwise, and write nothing; the exit status is 1 if there is one
    #[arg(long, conflicts_with = "write")]
    check: bool,
}

/// False when a file was to be checked and is laid out otherwise.
pub(super) fn fmt(args: &Args) -> Result<bool> {
    let paths = files(&args.files)?;
    let (mut out, mut changed, mut unread) = (io::stdout().lock(), 0, 0);
    for path in &paths {
        let mut change = match Change::read(path) {
            Ok(change) => change,
            Err(error) => {
                remark(&format!("error: {error:#}"));
                unread += 1;
                continue;
            }
        };
        change.document.format()?;
        if change.is_none() {
            continue;
        }
        changed += 1;
        if args.check {
            writeln!(out, "{}", printable(&path.display().to_string()))?;
            continue;
        }
        out.write_all(change.shown().as_bytes())?;
        if args.write {
            change.write()?;
        }
    }
    let what = match (args.check, args.write) {
        (true, _) => "are laid out otherwise",
        (_, true) => "were written",
        _ => "would change; --write writes them",
    };
    remark(&format!("{changed} of {} files {what}", paths.len()));
    ensure!(unread == 0, "{unread} of {} files cannot be read", paths.len());
    Ok(changed == 0 || !args.check)
}
