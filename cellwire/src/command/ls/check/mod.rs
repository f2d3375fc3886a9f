//! `cellwire ls check`, and the summary of `cellwire ls FOLDER`.

mod file;
mod sarif;

use std::collections::{BTreeMap, BTreeSet};
use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use clap::ValueEnum;
use fanuc_ls::{CheckContext, Level, Rules};

use super::rules;
use cellwire_io::output::{counted, log, printable, remark, stdout};
use cellwire_ls_server::{Walk, code};
use file::{File, motions};

/// Reports errors in LS files, with line, column and advice.
///
/// An error is something that a controller refuses to load or run; a warning is a probable mistake, such as a position that
/// the file does not define: the program stops with an alarm where nobody teaches it; a hint may be intended. In a folder, a
/// call of a program without a file is a hint. The exit status is 1 if there is an error (see --fail-on).
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Files, or folders with .ls files at any depth
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// The output format
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
    /// The lowest level that makes the exit status 1
    #[arg(long, value_name = "LEVEL", value_enum, default_value_t = MinSeverity::Error)]
    fail_on: MinSeverity,
    #[command(flatten)]
    known: KnownArgs,
}

/// The controller, as far as its programs do not show it.
#[derive(Debug, clap::Args)]
pub(super) struct KnownArgs {
    /// A file with the names of the controller's macros, one per line, which suppresses hints for them
    #[arg(long, value_name = "FILE")]
    macros: Option<PathBuf>,
    /// A file with the first words of instructions and motion options that fanuc-ls does not know, one per line, such as those of
    /// an application; text that begins with one of them is not reported
    #[arg(long, value_name = "FILE")]
    instructions: Option<PathBuf>,
    /// The longest program name; 8 on old controllers
    #[arg(long, value_name = "N", default_value_t = 36)]
    name_limit: usize,
}

impl KnownArgs {
    pub(super) fn rules(&self) -> Rules {
        rules(self.name_limit)
    }

    /// Returns the macros and instructions of the files.
    pub(super) fn surroundings(&self) -> Result<CheckContext> {
        let read = |path: &Option<PathBuf>| path.as_deref().map_or_else(|| Ok(BTreeSet::new()), names);
        let (macros, instructions) = (read(&self.macros)?, read(&self.instructions)?);
        Ok(CheckContext { macros, instructions, ..CheckContext::default() })
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Format {
    /// A summary of each file, and its findings with source lines and advice
    Text,
    /// One line per finding
    Short,
    /// One JSON object per file
    Json,
    /// One SARIF 2.1.0 document, for editors and code hosts
    Sarif,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum MinSeverity {
    Error,
    Warning,
    Hint,
}

impl MinSeverity {
    fn level(self) -> Level {
        match self {
            Self::Error => Level::Error,
            Self::Warning => Level::Warning,
            Self::Hint => Level::Hint,
        }
    }
}

/// Checks the files; returns false if there was a finding of the level that counts.
pub(super) fn check(args: &Args) -> Result<bool> {
    let rules = args.known.rules();
    let paths = files(&args.files)?;
    let mut around = around(args, &paths)?;
    let (mut out, mut good, mut unread, mut results) = (stdout(), true, 0, Vec::new());
    for path in &paths {
        match std::fs::read(path).with_context(|| format!("cannot read {}", path.display())) {
            Ok(bytes) => {
                around.file = stem(path);
                let file = File::new(path, &bytes, &rules, &around);
                good &= file.worst().is_none_or(|worst| worst < args.fail_on.level());
                match args.format {
                    Format::Text => out.write_all(file.text(&bytes).as_bytes())?,
                    Format::Short => out.write_all(file.lines().as_bytes())?,
                    // It locks standard output itself, which this thread may.
                    Format::Json => log(&file.object())?,
                    Format::Sarif => results.extend(sarif::results(&file)),
                }
            }
            Err(error) => {
                remark(&format!("error: {error:#}"));
                unread += 1;
            }
        }
    }
    if args.format == Format::Sarif {
        log(&sarif::document(results))?;
    }
    ensure!(unread == 0, "{unread} of {} cannot be read", counted(paths.len(), "file"));
    Ok(good)
}

/// Returns the programs that may be called, if a folder was given, and the macros.
fn around(args: &Args, paths: &[PathBuf]) -> Result<CheckContext> {
    let mut around = args.known.surroundings()?;
    if args.files.iter().any(|path| path.is_dir()) {
        let names = paths.iter().filter_map(|path| path.file_stem());
        around.programs = Some(names.map(|name| name.to_string_lossy().to_uppercase()).collect());
    }
    Ok(around)
}

/// Reads the lines of a file that are not empty, in upper case.
fn names(path: &Path) -> Result<BTreeSet<String>> {
    let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    let names = text.lines().map(str::trim).filter(|line| !line.is_empty());
    Ok(names.map(str::to_uppercase).collect())
}

/// Returns the name of a file without its extension.
fn stem(path: &Path) -> Option<String> {
    path.file_stem().map(|stem| stem.to_string_lossy().into_owned())
}

/// Prints a summary of the LS files in and below a folder. Returns false if there was an error.
pub(super) fn summarize(folder: &Path) -> Result<bool> {
    let (mut sums, mut errors) = ([0; 5], 0);
    let mut kinds: BTreeMap<(core::cmp::Reverse<Level>, String), (usize, usize)> = BTreeMap::new();
    let (rules, mut out) = (Rules::default(), stdout());
    for path in files(&[folder.to_path_buf()])? {
        let bytes = std::fs::read(&path).with_context(|| format!("cannot read {}", path.display()))?;
        let around = CheckContext { file: stem(&path), ..CheckContext::default() };
        let file = File::new(&path, &bytes, &rules, &around);
        errors += usize::from(file.worst() == Some(Level::Error));
        let mut in_file: BTreeMap<_, usize> = BTreeMap::new();
        for (problem, _) in file.problems() {
            *in_file.entry((core::cmp::Reverse(problem.level()), code(&problem))).or_default() += 1;
        }
        for (kind, count) in in_file {
            let (findings, files) = kinds.entry(kind).or_default();
            (*findings, *files) = (*findings + count, *files + 1);
        }
        let found = match &file.document {
            Ok(document) => {
                [1, 1, document.statements().count(), motions(document).count(), document.positions().count()]
            }
            Err(_) => [1, 0, 0, 0, 0],
        };
        sums.iter_mut().zip(found).for_each(|(sum, found)| *sum += found);
    }
    let [files, programs, lines, motions, positions] = sums;
    let (files, programs) = (counted(files, "file"), counted(programs, "program"));
    let (lines, motions, positions) =
        (counted(lines, "line"), counted(motions, "motion"), counted(positions, "position"));
    let folder = printable(&folder.display().to_string());
    writeln!(out, "{folder}: {files}, {programs}: {lines}, {motions}, {positions}")?;
    for ((core::cmp::Reverse(level), kind), (findings, files)) in kinds {
        writeln!(out, "  {:7} {kind}: {findings} in {}", level.text(), counted(files, "file"))?;
    }
    if errors > 0 {
        let verb = if errors == 1 { "has" } else { "have" };
        writeln!(out, "{} {verb} errors: `cellwire ls check {folder}` shows where", counted(errors, "file"))?;
    }
    Ok(errors == 0)
}

/// Returns the files, with each folder replaced by the .ls files in and below it, in sequence.
pub(super) fn files(paths: &[PathBuf]) -> Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for path in paths {
        let before = files.len();
        for found in Walk::new(path, &["ls"]) {
            match found {
                Ok(file) => files.push(file),
                Err((path, error)) => {
                    return Err(error).with_context(|| format!("cannot read {}", path.display()));
                }
            }
        }
        if files.len() == before {
            bail!("nothing to check: there is no .ls file in or below {}", path.display());
        }
    }
    Ok(files)
}
