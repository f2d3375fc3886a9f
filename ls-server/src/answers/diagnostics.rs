//! Findings as diagnostics.

use core::ops::Range;
use std::rc::Rc;

use fanuc_ls::{DecodeError, Finding, ItemKind, Level, Mistake, Problem, Reason, Warning};
use lsp_types::{
    Diagnostic, DiagnosticRelatedInformation, DiagnosticSeverity, DiagnosticTag, NumberOrString,
    PublishDiagnosticsParams,
};
use serde_json::Value;

use crate::document::{Document, FoundProblem};
use crate::folder::Folder;
use crate::position::Converter;

/// The diagnostics of a document; more are in none that a person could fix.
const MAX_FINDINGS: usize = 1000;

/// Returns the name of a problem's kind, such as `undefined label`.
pub fn code(problem: &Problem) -> String {
    let value = serde_json::to_value(problem).unwrap_or_default();
    value.get("kind").and_then(Value::as_str).unwrap_or_default().replace('_', " ")
}

/// Returns all findings of an open document.
pub(crate) fn published(folder: &Folder, document: &Document) -> PublishDiagnosticsParams {
    PublishDiagnosticsParams {
        uri: document.uri().clone(),
        diagnostics: diagnostics(folder, document),
        version: document.version(),
    }
}

fn diagnostics(folder: &Folder, document: &Document) -> Vec<Diagnostic> {
    if document.is_too_long() {
        let message = "the file is longer than 16 MB: it is not checked".to_owned();
        return vec![Diagnostic {
            severity: Some(DiagnosticSeverity::INFORMATION),
            message,
            source: source(),
            ..Diagnostic::default()
        }];
    }
    let converter = document.converter();
    let found = found(folder, document);
    let found = found.iter().take(MAX_FINDINGS);
    let found = found.map(|(problem, place)| diagnostic(document, &converter, *problem, place));
    lost_letter(document, &converter).into_iter().chain(found).collect()
}

/// Returns the warning that letters were lost, at the first one: an editor that saves the text damages the file.
fn lost_letter(document: &Document, converter: &Converter<'_>) -> Option<Diagnostic> {
    let start = document.text().find(char::REPLACEMENT_CHARACTER)?;
    let message = "a letter is lost: the file was read as UTF-8, but has another encoding\n\
                   do not save it, and open it again with its encoding, such as Windows-1252"
        .to_owned();
    Some(Diagnostic {
        range: converter.range(&(start..start + char::REPLACEMENT_CHARACTER.len_utf8())),
        severity: Some(DiagnosticSeverity::WARNING),
        code: Some(NumberOrString::String("lost-letter".to_owned())),
        source: source(),
        message,
        ..Diagnostic::default()
    })
}

/// Returns a problem of a document as a diagnostic.
pub(crate) fn diagnostic(
    document: &Document,
    converter: &Converter<'_>,
    problem: Problem,
    place: &Range<usize>,
) -> Diagnostic {
    Diagnostic {
        range: converter.range(place),
        severity: Some(match problem.level() {
            Level::Error => DiagnosticSeverity::ERROR,
            Level::Warning => DiagnosticSeverity::WARNING,
            Level::Hint => DiagnosticSeverity::HINT,
        }),
        code: Some(NumberOrString::String(code(&problem).replace(' ', "-"))),
        source: source(),
        message: format!("{problem}\n{}", problem.advice()),
        related_information: related(document, problem, place),
        tags: tags(problem),
        ..Diagnostic::default()
    }
}

/// Returns the problems of a document, each with its range.
pub(crate) fn found(folder: &Folder, document: &Document) -> Rc<[FoundProblem]> {
    document.found(folder.changes(), || find(folder, document))
}

fn find(folder: &Folder, document: &Document) -> Vec<FoundProblem> {
    let text = document.text();
    match document.program() {
        Ok(program) => {
            let findings = program.findings_among(&folder.rules, &folder.surroundings(document));
            findings.iter().map(|Finding { problem, offset, .. }| (*problem, marked(text, *offset))).collect()
        }
        // A log or a listing of a controller has the same ending.
        Err(DecodeError { reason: Reason::Program, .. }) if !text.contains("/MN") => Vec::new(),
        Err(error) => vec![(Problem::Error(error.reason), marked(text, error.offset))],
    }
}

/// Returns the range of the words from a byte on, up to the end of the statement or the line; without words, of the
/// character before it.
fn marked(text: &str, offset: usize) -> Range<usize> {
    let rest = text.get(offset..).unwrap_or("");
    let line = rest.split(['\r', '\n']).next().unwrap_or("");
    let end = line.trim_end().trim_end_matches(';').trim_end().len();
    if end > 0 {
        return offset..offset + end;
    }
    let before = text.get(..offset).and_then(|text| text.chars().next_back()).filter(|c| !c.is_control());
    offset - before.map_or(0, char::len_utf8)..offset + line.trim_end().len()
}

/// Returns the other location that a problem is about.
fn related(
    document: &Document,
    problem: Problem,
    place: &Range<usize>,
) -> Option<Vec<DiagnosticRelatedInformation>> {
    let (item, message) = match problem {
        Problem::Mistake(Mistake::RepeatedLabel { number }) => ((ItemKind::Label, number), "the other label"),
        Problem::Warning(Warning::RepeatedPosition { number }) => {
            ((ItemKind::Position, number), "the other position")
        }
        Problem::Mistake(Mistake::Frame { number, .. } | Mistake::Tool { number, .. }) => {
            ((ItemKind::Position, number), "the position")
        }
        _ => return None,
    };
    let definitions = document.index().references_to(item).filter(|found| found.is_definition);
    let others = definitions
        .map(|found| found.letters.start..found.digits.end)
        .filter(|other| !place.contains(&other.start));
    let of_place = |place| DiagnosticRelatedInformation {
        location: document.location(&place),
        message: message.to_owned(),
    };
    let found: Vec<_> = others.take(8).map(of_place).collect();
    (!found.is_empty()).then_some(found)
}

fn tags(problem: Problem) -> Option<Vec<DiagnosticTag>> {
    let is_unused = matches!(
        problem,
        Problem::Mistake(Mistake::Unreachable) | Problem::Warning(Warning::UnusedPosition { .. })
    );
    is_unused.then(|| vec![DiagnosticTag::UNNECESSARY])
}

fn source() -> Option<String> {
    Some("cellwire".to_owned())
}
