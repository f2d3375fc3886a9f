//! The completions of a command line for a shell, and its manual pages.

use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::Command;

use crate::output::stdout;
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
    let mut program = program.disable_help_subcommand(true);
    program.build();
    std::fs::create_dir_all(folder)
        .and_then(|()| pages(folder, &program))
        .with_context(|| folder.display().to_string())
}

/// Writes the manual pages of a command and its subcommands. Examples and settings are in columns: lines are not justified,
/// and words not hyphenated.
fn pages(folder: &Path, command: &Command) -> io::Result<()> {
    for inner in command.get_subcommands().filter(|it| !it.is_hide_set()) {
        pages(folder, inner)?;
    }
    let page = clap_mangen::Man::new(command.clone());
    let mut text = Vec::new();
    page.render(&mut text)?;
    let text = String::from_utf8_lossy(&text)
        .replacen("\n.SH NAME", "\n.ad l\n.nh\n.SH NAME", 1)
        .replace("\n.SH EXTRA", "\n.SH NOTES\n.nf")
        .replace("\n.SH VERSION", "\n.fi\n.SH VERSION");
    std::fs::write(folder.join(page.get_filename()), text)
}
