//! `cellwire ls check`.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use fanuc_ls::{CommentRule, DecodeError, EncodeError, MotionKind, Program, Warning};
use serde_json::{Value, json};

use super::{rules, same_name};

/// Reads LS files and reports what is wrong with them, by line and column.
///
/// The exit status is 1 if a file is no program, or would not be written as it is. Warnings (a point that is not used, a
/// comment of more than 16 characters) do not count.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// The files
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// Print one JSON object a file instead of text
    #[arg(long)]
    json: bool,
    /// The longest name that the controller takes; old ones take 8
    #[arg(long, value_name = "N", default_value_t = 36)]
    name_limit: usize,
}

/// False when a file was refused.
pub(super) fn check(args: &Args) -> Result<bool> {
    let (mut out, mut all, mut unread) = (io::stdout().lock(), true, 0);
    for path in &args.files {
        match read(path) {
            Ok((text, encoding)) => all &= check_one(args, path, &text, encoding, &mut out)?,
            Err(error) => {
                eprintln!("error: {error:#}");
                unread += 1;
            }
        }
    }
    ensure!(unread == 0, "{unread} of {} files cannot be read", args.files.len());
    Ok(all)
}

fn check_one(args: &Args, path: &Path, text: &str, encoding: Encoding, out: &mut impl Write) -> Result<bool> {
    let mut warnings = Vec::new();
    let program = Program::decode_with(text, |warning| warnings.push(warning));
    let mut rules = rules(args.name_limit);
    rules.comment = CommentRule::Truncate; // a controller reads a long comment, and keeps 16 characters: a warning reports it
    let unwritable = program.as_ref().ok().and_then(|program| program.check(&rules).err());
    let name = path.display().to_string();
    if args.json {
        writeln!(out, "{}", object(path, &program, &warnings, unwritable))?;
        return Ok(program.is_ok() && unwritable.is_none());
    }
    match &program {
        Err(error) => write!(out, "{}", point_at(&name, text, error))?,
        Ok(program) => {
            writeln!(out, "{name}: {}", summary(program))?;
            if encoding == Encoding::Latin1 {
                writeln!(out, "  note: not UTF-8; read as Latin-1")?;
            }
            if !same_name(path, program) {
                let named = &program.name;
                writeln!(
                    out,
                    "  warning: the program is named {named}, the file is not: on the controller both must be the same"
                )?;
            }
            for warning in &warnings {
                writeln!(out, "  warning: {warning}")?;
            }
        }
    }
    if let Some(error) = unwritable {
        writeln!(out, "  error: {error}")?;
    }
    Ok(program.is_ok() && unwritable.is_none())
}

/// The error with the line that it is in, and a mark below the place.
fn point_at(name: &str, text: &str, error: &DecodeError) -> String {
    let line = text.lines().nth(error.line - 1).unwrap_or_default();
    // A tab takes one column, in the count as on the screen.
    let line = line.replace('\t', " ");
    let (number, before) = (error.line.to_string(), " ".repeat(error.column - 1));
    let margin = " ".repeat(number.len());
    format!(
        "{name}:{}:{}: {}\n {number} | {line}\n {margin} | {before}^\n",
        error.line, error.column, error.reason
    )
}

fn summary(program: &Program) -> String {
    use MotionKind::{Arc, Circular, Joint, Linear, Spline};
    let motions = [Joint, Linear, Circular, Arc, Spline].map(|kind| (kind.letter(), program.motions(kind)));
    let motions: Vec<String> =
        motions.iter().filter(|(_, n)| *n > 0).map(|(letter, n)| format!("{n} {letter}")).collect();
    let motions = if motions.is_empty() { "no motions".into() } else { motions.join(", ") };
    let comment = program.comment().filter(|comment| !comment.is_empty());
    let comment = comment.map(|comment| format!(" \"{comment}\"")).unwrap_or_default();
    let (lines, points) = (program.line_count(), program.positions.len());
    format!("{}{comment}, {lines} instructions ({motions}), {points} positions", program.name)
}

fn object(
    path: &Path,
    program: &Result<Program, DecodeError>,
    warnings: &[Warning],
    unwritable: Option<EncodeError>,
) -> Value {
    let name = path.display().to_string();
    match program {
        Err(error) => json!({"file": name, "ok": false, "error": error, "reason": error.reason.to_string()}),
        Ok(program) => json!({
            "file": name, "ok": unwritable.is_none(), "name": program.name, "comment": program.comment(),
            "instructions": program.line_count(), "positions": program.positions.len(),
            "same_name": same_name(path, program), "warnings": warnings, "error": unwritable,
        }),
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Encoding {
    Utf8,
    Latin1,
}

/// A text file; controllers write comments in whatever they are set to, and every byte is some character of Latin-1.
fn read(path: &Path) -> Result<(String, Encoding)> {
    let bytes = std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
    Ok(match String::from_utf8(bytes) {
        Ok(text) => (text, Encoding::Utf8),
        Err(error) => (error.into_bytes().into_iter().map(char::from).collect(), Encoding::Latin1),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_is_shown_below_its_line() {
        let text = "/PROG A\n/MN\n   1:L\tP[1] 100mm/s FINE ;\n/END\n";
        let error = Program::decode(text).unwrap_err();
        assert_eq!(
            point_at("A.LS", text, &error),
            "A.LS:3:16: expected a unit: %, sec, msec, mm/sec, cm/min, inch/min or deg/sec\n \
             3 |    1:L P[1] 100mm/s FINE ;\n   |                ^\n"
        );
    }
}
