//! `cellwire completions` and `cellwire man`: the tool's commands as a shell and `man` want them.

use std::io::{Write as _, stdout};
use std::path::PathBuf;

use anyhow::{Context, Result};
use clap::Command;
use clap_complete::Shell;

/// Prints what a shell needs to complete the commands, their options and values.
///
/// bash: cellwire completions bash > ~/.local/share/bash-completion/completions/cellwire
#[derive(Debug, clap::Args)]
pub struct Completions {
    /// The shell
    shell: Shell,
}

/// Writes a manual page for each command.
///
/// cellwire man ~/.local/share/man/man1 && man cellwire-simulate
#[derive(Debug, clap::Args)]
pub struct Man {
    /// The folder, which is made if it is not there
    folder: PathBuf,
}

/// Prints the completions.
///
/// # Errors
/// When nobody reads standard output.
pub fn completions(args: &Completions, mut tool: Command) -> Result<()> {
    let mut text = Vec::new();
    clap_complete::generate(args.shell, &mut tool, "cellwire", &mut text);
    Ok(stdout().write_all(&text)?)
}

/// Writes the pages.
///
/// # Errors
/// When a page cannot be written.
pub fn man(args: &Man, tool: Command) -> Result<()> {
    std::fs::create_dir_all(&args.folder)
        .and_then(|()| clap_mangen::generate_to(tool, &args.folder))
        .with_context(|| args.folder.display().to_string())
}
