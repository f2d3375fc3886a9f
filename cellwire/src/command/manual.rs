//! `cellwire completions` and `cellwire man`: commands as a shell and `man` want them.

use std::io::{Write as _, stdout};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::Command;
pub use clap_complete::Shell;

/// Prints a shell completion script.
///
/// bash: cellwire completions bash > ~/.local/share/bash-completion/completions/cellwire
#[derive(Debug, clap::Args)]
pub struct Completions {
    /// The shell
    pub shell: Shell,
}

/// Writes a manual page for each command.
///
/// cellwire man ~/.local/share/man/man1 && man cellwire-simulate
#[derive(Debug, clap::Args)]
pub struct Man {
    /// The folder, created if missing
    pub folder: PathBuf,
}

/// Prints the completions.
///
/// # Errors
/// When standard output is closed.
pub fn completions(shell: Shell, mut program: Command) -> Result<()> {
    let (mut text, name) = (Vec::new(), program.get_name().to_owned());
    clap_complete::generate(shell, &mut program, name, &mut text);
    Ok(stdout().write_all(&text)?)
}

/// Writes the pages.
///
/// # Errors
/// When a page cannot be written.
pub fn man(folder: &Path, program: Command) -> Result<()> {
    std::fs::create_dir_all(folder)
        .and_then(|()| clap_mangen::generate_to(program, folder))
        .with_context(|| folder.display().to_string())
}
