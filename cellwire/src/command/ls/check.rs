//! `cellwire ls check`, and the summary of `cellwire ls FOLDER`.

use std::collections::BTreeMap;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use fanuc_ls::{DecodeError, Document, Encoding, Finding, Instruction, MotionKind, Problem, Rules};
use serde_json::{Value, json};

use super::{rules, same_name};
use crate::io::output::remark;

/// Reads LS files and reports what is wrong with them: each finding once, with its line and column and what to do.
///
/// An error is what a controller would not take. The exit status is 1 if there is one. Warnings (a point that is not used, a
/// comment of more than 16 characters) do not count.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// The files; of a folder, every .ls file in and below it
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// Print one JSON object a file instead of text
    #[arg(long)]
    json: bool,
    /// The longest name that the controller takes; old ones take 8
    #[arg(long, value_name = "N", default_value_t = 36)]
    name_limit: usize,
}

/// False when there was an error.
pub(super) fn check(args: &Args) -> Result<bool> {
    let rules = rules(args.name_limit);
    let (mut out, mut all, mut unread, mut count) = (io::stdout().lock(), true, 0, 0);
    for path in below(&args.files)? {
        count += 1;
        match std::fs::read(&path).with_context(|| format!("cannot read {}", path.display())) {
            Ok(bytes) => {
                let file = File::new(&path, &bytes, &rules);
                all &= file.is_sound();
                match args.json {
                    true => writeln!(out, "{}", file.object())?,
                    false => write!(out, "{}", file.text(&bytes))?,
                }
            }
            Err(error) => {
                remark(&format!("error: {error:#}"));
                unread += 1;
            }
        }
    }
    ensure!(unread == 0, "{unread} of {count} files cannot be read");
    Ok(all)
}

/// Prints what the LS files in and below a folder are and have. False when there was an error.
pub(super) fn summarize(folder: &Path) -> Result<bool> {
    let (mut sums, mut errors) = ([0; 5], 0);
    let mut kinds: BTreeMap<(bool, String), (usize, usize)> = BTreeMap::new();
    let (rules, mut out) = (Rules::default(), io::stdout().lock());
    for path in below(&[folder.to_path_buf()])? {
        let bytes = std::fs::read(&path).with_context(|| format!("cannot read {}", path.display()))?;
        let file = File::new(&path, &bytes, &rules);
        errors += usize::from(!file.is_sound());
        let mut in_file: BTreeMap<(bool, String), usize> = BTreeMap::new();
        for (problem, _) in file.problems() {
            *in_file.entry((!problem.is_error(), kind(&problem))).or_default() += 1;
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
    ensure!(files > 0, "no .ls file in or below {}", folder.display());
    writeln!(
        out,
        "{}: {files} files, {programs} programs: {lines} lines, {motions} motions, {positions} positions",
        folder.display()
    )?;
    for ((warning, kind), (findings, files)) in kinds {
        writeln!(
            out,
            "  {:7} {kind}: {findings} in {files} files",
            if warning { "warning" } else { "error" }
        )?;
    }
    if errors > 0 {
        writeln!(out, "{errors} files have errors: `cellwire ls check {}` shows where", folder.display())?;
    }
    Ok(errors == 0)
}

/// A file and what was found in it.
struct File<'a> {
    path: &'a Path,
    document: Result<Document, DecodeError>,
    findings: Vec<Finding>,
}

impl<'a> File<'a> {
    fn new(path: &'a Path, bytes: &[u8], rules: &Rules) -> Self {
        let document = Document::decode_bytes(bytes);
        let findings = document.as_ref().map_or(Vec::new(), |document| document.findings(rules));
        Self { path, document, findings }
    }

    fn is_sound(&self) -> bool {
        self.problems().all(|(problem, _)| !problem.is_error())
    }

    /// What was found, and its line and column: why it is no program, or the findings in it.
    fn problems(&self) -> impl Iterator<Item = (Problem, (usize, usize))> {
        let error = self.document.as_ref().err().map(|e| (Problem::Error(e.reason), (e.line, e.column)));
        error.into_iter().chain(self.findings.iter().map(|f| (f.problem, (f.line, f.column))))
    }

    fn same_name(&self) -> bool {
        self.document.as_ref().map_or(true, |document| same_name(self.path, document.name()))
    }

    fn text(&self, bytes: &[u8]) -> String {
        let name = self.path.display();
        let mut text = String::new();
        if let Ok(document) = &self.document {
            text += &format!("{name}: {}\n", summary(document));
            if document.encoding() == Encoding::Latin1 {
                text += "  note: not UTF-8; read as Latin-1\n";
            }
            if !self.same_name() {
                let named = document.name();
                text += &format!(
                    "  warning: the program is named {named}, the file is not: on the controller both must be the same\n"
                );
            }
        }
        let content = match &self.document {
            Ok(document) => document.as_str().into(),
            Err(_) => String::from_utf8_lossy(bytes),
        };
        // Findings are in the order of the lines.
        let mut lines = (1..).zip(content.lines());
        let mut last = (0, "");
        for (problem, (line, column)) in self.problems() {
            while last.0 < line {
                last = lines.next().unwrap_or((line, ""));
            }
            let severity = if problem.is_error() { "error" } else { "warning" };
            text += &format!("{name}:{line}:{column}: {severity}: {problem}\n");
            if problem.is_error() {
                text += &point_at(last.1, line, column);
            }
            text += &format!("  help: {}\n", problem.advice());
        }
        text
    }

    fn object(&self) -> Value {
        let name = self.path.display().to_string();
        match &self.document {
            Err(error) => {
                json!({"file": name, "ok": false, "error": error, "reason": error.reason.to_string(), "findings": []})
            }
            Ok(document) => json!({
                "file": name, "ok": self.is_sound(), "name": document.name(), "comment": comment(document),
                "instructions": lines(document), "positions": document.positions().count(),
                "same_name": self.same_name(), "error": self.findings.iter().find(|f| f.problem.is_error()),
                "findings": self.findings,
            }),
        }
    }
}

/// A line of a file with a mark below a place in it.
fn point_at(line: &str, number: usize, column: usize) -> String {
    // A tab takes one column, in the count as on the screen.
    let line = line.replace('\t', " ");
    let (number, before) = (number.to_string(), " ".repeat(column - 1));
    let margin = " ".repeat(number.len());
    format!(" {number} | {line}\n {margin} | {before}^\n")
}

fn summary(document: &Document) -> String {
    use MotionKind::{Arc, Circular, Joint, Linear, Spline};
    let of = |kind| motions(document).filter(|&found| found == kind).count();
    let counts = [Joint, Linear, Circular, Arc, Spline].map(|kind| (kind.letter(), of(kind)));
    let counts: Vec<String> =
        counts.iter().filter(|(_, n)| *n > 0).map(|(letter, n)| format!("{n} {letter}")).collect();
    let counts = if counts.is_empty() { "no motions".into() } else { counts.join(", ") };
    let comment = comment(document).filter(|comment| !comment.is_empty());
    let comment = comment.map(|comment| format!(" \"{comment}\"")).unwrap_or_default();
    let (lines, points) = (lines(document), document.positions().count());
    format!("{}{comment}, {lines} instructions ({counts}), {points} positions", document.name())
}

fn lines(document: &Document) -> usize {
    document.statements().filter(|statement| !statement.is_nested()).count()
}

fn motions(document: &Document) -> impl Iterator<Item = MotionKind> {
    document.statements().filter_map(|statement| match statement.instruction() {
        Instruction::Motion(motion) => Some(motion.kind),
        _ => None,
    })
}

fn comment(document: &Document) -> Option<String> {
    document.attributes().find_map(|attribute| attribute.comment().map(str::to_owned))
}

/// The name of a finding's kind, as JSON has it.
fn kind(problem: &Problem) -> String {
    let value = serde_json::to_value(problem).unwrap_or_default();
    value.get("kind").and_then(Value::as_str).unwrap_or_default().replace('_', " ")
}

/// The files, and in place of a folder the .ls files in and below it, in order.
fn below(paths: &[PathBuf]) -> Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    let mut rest: Vec<(PathBuf, bool)> = paths.iter().rev().map(|path| (path.clone(), true)).collect();
    while let Some((path, named)) = rest.pop() {
        // A link may lead back: only those that were named are followed.
        if path.is_dir() && (named || !path.is_symlink()) {
            let entries =
                std::fs::read_dir(&path).with_context(|| format!("cannot read {}", path.display()))?;
            let mut entries =
                entries.map(|entry| Ok((entry?.path(), false))).collect::<io::Result<Vec<_>>>()?;
            entries.sort_by(|a, b| b.cmp(a));
            rest.append(&mut entries);
        } else if named || path.extension().is_some_and(|end| end.eq_ignore_ascii_case("ls")) {
            files.push(path);
        }
    }
    Ok(files)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_is_shown_below_its_line() {
        let text = "/PROG A\n/MN\n   1:L\tP[1] 100mm/s FINE ;\n/END\n";
        let file = File::new(Path::new("A.LS"), text.as_bytes(), &Rules::default());
        assert_eq!(
            file.text(text.as_bytes()),
            "A.LS: A, 1 instructions (no motions), 0 positions\n\
             A.LS:3:16: error: expected a unit: %, sec, msec, mm/sec, cm/min, inch/min or deg/sec\n \
             3 |    1:L P[1] 100mm/s FINE ;\n   |                ^\n  help: correct it: a controller would not take it\n"
        );
    }
}
