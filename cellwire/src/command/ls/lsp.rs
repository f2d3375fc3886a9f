//! `cellwire ls lsp`.

use std::io::{self, BufReader};
use std::sync::Arc;

use anyhow::{Context, Result};
use cellwire_ls_server::{Options, serve};

use super::check::KnownArgs;
use super::run;

/// A language server for LS files, which an editor starts and speaks to over standard input and output.
///
/// Gives an editor the findings of `ls check`, the layout of `ls fmt`, the edits of `ls edit` and the simulation of `ls
/// run`; completion, hover, references and renaming in all programs of the folder, with the names of a backup's NUMREG.VA,
/// POSREG.VA, STRREG.VA, SYSMACRO.VA and IOSTATE.DG. `docs/editor.md` has the settings of editors.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    known: KnownArgs,
}

/// Runs the language server; returns false if the editor has disconnected without `exit`.
pub(super) fn lsp(args: &Args) -> Result<bool> {
    let options = Options {
        rules: args.known.rules(),
        around: args.known.surroundings()?,
        simulate: Some(Arc::new(|path, stop| run::as_text(path, stop).map_err(|error| format!("{error:#}")))),
    };
    serve(BufReader::new(io::stdin()), io::stdout(), options)
        .context("the connection to the editor has ended")
}
