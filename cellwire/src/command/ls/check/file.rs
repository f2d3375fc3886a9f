//! One file, its findings, and their output.

use std::path::Path;

use fanuc_ls::{
    CheckContext, DecodeError, Document, Encoding, Finding, Instruction, Level, MotionKind, Problem, Rules,
};
use serde_json::{Value, json};

use crate::command::ls::same_name;
use cellwire_io::output::{counted, printable};

pub(super) struct File<'a> {
    pub(super) path: &'a Path,
    pub(super) document: Result<Document, DecodeError>,
    findings: Vec<Finding>,
}

impl<'a> File<'a> {
    pub(super) fn new(path: &'a Path, bytes: &[u8], rules: &Rules, around: &CheckContext) -> Self {
        let document = Document::decode_bytes(bytes);
        let findings =
            document.as_ref().map_or(Vec::new(), |document| document.findings_among(rules, around));
        Self { path, document, findings }
    }

    /// Returns the level of the worst finding.
    pub(super) fn worst(&self) -> Option<Level> {
        self.problems().map(|(problem, _)| problem.level()).max()
    }

    /// Returns the problems, with line and column: the reason for which the file is not a program, or its findings.
    pub(super) fn problems(&self) -> impl Iterator<Item = (Problem, (usize, usize))> {
        let error = self.document.as_ref().err().map(|e| (Problem::Error(e.reason), (e.line, e.column)));
        error.into_iter().chain(self.findings.iter().map(|f| (f.problem, (f.line, f.column))))
    }

    fn same_name(&self) -> bool {
        self.document.as_ref().map_or(true, |document| same_name(self.path, document.name()))
    }

    /// Returns one line per finding.
    pub(super) fn lines(&self) -> String {
        let name = printable(&self.path.display().to_string());
        let line = |(problem, (line, column)): (Problem, (usize, usize))| {
            format!("{name}:{line}:{column}: {}: {problem}\n", problem.level().text())
        };
        self.problems().map(line).collect()
    }

    pub(super) fn text(&self, bytes: &[u8]) -> String {
        let name = printable(&self.path.display().to_string());
        let mut text = String::new();
        if let Ok(document) = &self.document {
            text += &format!("{name}: {}\n", printable(&summary(document)));
            if document.encoding() == Encoding::Latin1 {
                text += "  note: not UTF-8; read as Latin-1\n";
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
            text += &format!("{name}:{line}:{column}: {}: {problem}\n", problem.level().text());
            if !matches!(problem, Problem::Warning(_)) {
                text += &point_at(last.1, line, column);
            }
            text += &format!("  help: {}\n", problem.advice());
        }
        text
    }

    pub(super) fn object(&self) -> Value {
        let name = self.path.display().to_string();
        let is_sound = self.worst() != Some(Level::Error);
        let of_finding = |finding: &Finding| {
            let mut value = json!(finding);
            if let Value::Object(fields) = &mut value {
                fields.insert("level".into(), json!(finding.problem.level()));
                fields.insert("message".into(), json!(finding.problem.to_string()));
            }
            value
        };
        match &self.document {
            Err(error) => {
                json!({"file": name, "ok": false, "error": error, "reason": error.reason.to_string(), "findings": []})
            }
            Ok(document) => json!({
                "file": name, "ok": is_sound, "name": document.name(), "comment": comment(document),
                "instructions": lines(document), "positions": document.positions().count(),
                "same_name": self.same_name(), "error": self.findings.iter().find(|f| f.problem.is_error()),
                "findings": self.findings.iter().map(of_finding).collect::<Vec<_>>(),
            }),
        }
    }
}

/// Returns a line of a file with a mark below a column.
fn point_at(line: &str, number: usize, column: usize) -> String {
    // A tab takes one column, in the count as on the screen, and so does a control character.
    let shown = |c: char| match c {
        '\t' => ' ',
        c if c.is_control() => char::REPLACEMENT_CHARACTER,
        c => c,
    };
    let line: String = line.chars().map(shown).collect();
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
    let (lines, points) = (counted(lines, "instruction"), counted(points, "position"));
    format!("{}{comment}, {lines} ({counts}), {points}", document.name())
}

fn lines(document: &Document) -> usize {
    document.statements().filter(|statement| !statement.is_nested()).count()
}

pub(super) fn motions(document: &Document) -> impl Iterator<Item = MotionKind> {
    document.statements().filter_map(|statement| match statement.instruction() {
        Instruction::Motion(motion) => Some(motion.kind),
        _ => None,
    })
}

fn comment(document: &Document) -> Option<String> {
    document.attributes().find_map(|attribute| attribute.comment().map(str::to_owned))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_is_shown_below_its_line() {
        let text = "/PROG A\n/MN\n   1:L\tP[1] 100mm/s FINE ;\n/END\n";
        let file = File::new(Path::new("A.LS"), text.as_bytes(), &Rules::default(), &CheckContext::default());
        assert_eq!(
            file.text(text.as_bytes()),
            "A.LS: A, 1 instruction (no motions), 0 positions\n\
             A.LS:3:16: error: expected a unit: %, sec, msec, mm/sec, cm/min, inch/min or deg/sec\n \
             3 |    1:L P[1] 100mm/s FINE ;\n   |                ^\n  help: correct it: a controller would not take it\n"
        );
    }

    #[test]
    fn what_a_terminal_would_obey_is_not_printed() {
        let text = "/PROG A\n/ATTR\nCOMMENT = \"\u{1b}[2J\";\n/MN\n   1:  CAL \u{1b}]0;x\u{7} ;\n/END\n";
        let file = File::new(
            Path::new("A\u{9b}1m.LS"),
            text.as_bytes(),
            &Rules::default(),
            &CheckContext::default(),
        );
        for shown in [file.text(text.as_bytes()), file.lines()] {
            assert!(!shown.contains(|c: char| c.is_control() && c != '\n'), "{shown:?}");
            assert!(shown.contains("A\\u{9b}1m.LS:5:8: hint: "), "{shown}");
        }
    }
}
