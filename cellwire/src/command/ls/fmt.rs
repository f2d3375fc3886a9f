//! `cellwire ls fmt`.

use std::io::Write;
use std::path::PathBuf;

use anyhow::{Result, ensure};

use super::check::files;
use super::difference::Change;
use cellwire_io::output::{counted, printable, remark, stdout};

/// Formats LS files as controllers print them, and shows the changes; --write applies them.
///
/// Aligns line numbers and instructions; formats `0.6sec`, `WAIT    .50(sec)`, and coordinates with three decimals; orders
/// attributes and frames. Words never change; unknown text, line ends and /APPL are kept. A file written by a controller
/// is unchanged.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Files, or folders with .ls files at any depth
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// Write the files
    #[arg(long)]
    write: bool,
    /// List the files that would change, without writing; the exit status is 1 if there are any
    #[arg(long, conflicts_with = "write")]
    check: bool,
}

/// Formats the files; returns false if a file was to be checked and has another layout.
pub(super) fn fmt(args: &Args) -> Result<bool> {
    let paths = files(&args.files)?;
    let (mut out, mut changed, mut unread) = (stdout(), 0, 0);
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
        (true, _) => "not formatted",
        (_, true) => "written",
        _ => "would change; --write applies the changes",
    };
    remark(&format!("{changed} of {} {what}", counted(paths.len(), "file")));
    ensure!(unread == 0, "{unread} of {} cannot be read", counted(paths.len(), "file"));
    Ok(changed == 0 || !args.check)
}
