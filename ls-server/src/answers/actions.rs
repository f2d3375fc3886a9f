//! `textDocument/codeAction`: corrections of findings, and the numbers of lines.

use core::ops::Range;

use fanuc_ls::{
    Axis, AxisName, AxisUnit, Block, COMMENT_LENGTH, Configuration, Document as Program, EncodeError, Group,
    Instruction, Mistake, Position, Problem, Reason, Termination, Warning,
};
use lsp_types::{
    CodeAction, CodeActionKind, CodeActionOrCommand, CodeActionParams, CodeActionResponse, TextEdit,
};

use super::diagnostics::{diagnostic, found};
use super::rename::changed;
use crate::answer::{Answer, document};
use crate::document::{Document, FoundProblem};
use crate::edits;
use crate::files::stem;
use crate::folder::Folder;

/// The kind of the action that numbers the lines.
pub(crate) const RENUMBER: CodeActionKind = CodeActionKind::new("source.renumber");
/// The findings that corrections are offered for at most.
const MAX_FIXES: usize = 20;

pub(crate) fn actions(folder: &Folder, params: CodeActionParams) -> Answer<Option<CodeActionResponse>> {
    let document = document(folder, &params.text_document.uri)?;
    let range = document.converter().bytes(params.range);
    let only = params.context.only;
    let is_wanted = |kind: &CodeActionKind| {
        only.as_ref().is_none_or(|only| only.iter().any(|only| kind.as_str().starts_with(only.as_str())))
    };
    let mut actions = Vec::new();
    if is_wanted(&CodeActionKind::QUICKFIX) {
        let there = |(_, place): &&FoundProblem| place.start <= range.end && range.start <= place.end;
        for (problem, place) in found(folder, document).iter().filter(there).take(MAX_FIXES) {
            let Some((title, edits)) = fix(document, *problem, place).filter(|(_, edits)| !edits.is_empty())
            else {
                continue;
            };
            actions.push(CodeActionOrCommand::CodeAction(CodeAction {
                title,
                kind: Some(CodeActionKind::QUICKFIX),
                diagnostics: Some(vec![diagnostic(document, &document.converter(), *problem, place)]),
                edit: Some(edits::workspace(folder, vec![(document, edits)])),
                is_preferred: Some(true),
                ..CodeAction::default()
            }));
        }
    }
    let numbering = || changed(document, Program::renumber_lines).unwrap_or_default();
    if is_wanted(&RENUMBER)
        && let edits = document.numbering(numbering)
        && !edits.is_empty()
    {
        actions.push(CodeActionOrCommand::CodeAction(CodeAction {
            title: "Number the lines from 1".into(),
            kind: Some(RENUMBER),
            edit: Some(edits::workspace(folder, vec![(document, edits.to_vec())])),
            ..CodeAction::default()
        }));
    }
    Ok(Some(actions))
}

type Fix = Option<(String, Vec<TextEdit>)>;

/// Returns the correction of a problem, if there is one that a person would make.
fn fix(document: &Document, problem: Problem, place: &Range<usize>) -> Fix {
    let titled = |title: String, edits: Answer<Vec<TextEdit>>| Some((title, edits.ok()?));
    match problem {
        Problem::Mistake(Mistake::Misspelled { word }) => replaced(document, place.start, word),
        Problem::Mistake(Mistake::Capitals { word }) => replaced(document, place.start, word),
        Problem::Warning(Warning::LineNumber { .. } | Warning::LineCount { .. }) => {
            titled("Number the lines from 1".into(), changed(document, Program::renumber_lines))
        }
        Problem::Warning(Warning::UndefinedPosition { number }) => {
            let add = |program: &mut Program| program.add_position(&untaught(program, number));
            titled(format!("Add P[{number}] to /POS, to be taught"), changed(document, add))
        }
        Problem::Warning(Warning::UnusedPosition { number }) => titled(
            format!("Delete P[{number}]"),
            changed(document, |program| program.remove_position(number)),
        ),
        Problem::Warning(Warning::FileName) => {
            let name = document.path().and_then(stem)?;
            titled(format!("Name the program {name}"), changed(document, |program| program.set_name(&name)))
        }
        Problem::Warning(Warning::CommentLength { .. }) => {
            let comment: String = document.index().comment()?.chars().take(COMMENT_LENGTH).collect();
            let set = |program: &mut Program| {
                program.set_attribute("COMMENT", &format!("\"{}\"", comment.trim_end()))
            };
            titled(format!("Shorten COMMENT to {COMMENT_LENGTH} characters"), changed(document, set))
        }
        Problem::Mistake(Mistake::UndefinedLabel { number }) => titled(
            format!("Add LBL[{number}] at the end"),
            inserted(document, None, &format!("LBL[{number}]")),
        ),
        Problem::Mistake(Mistake::Open { block }) => {
            let end = ending(block)?;
            titled(format!("Add {end} at the end"), inserted(document, None, end))
        }
        Problem::Mistake(Mistake::Crossed { block }) => {
            let end = ending(block)?;
            titled(format!("Add {end} before this line"), inserted(document, Some(place.start), end))
        }
        Problem::Mistake(Mistake::Frame { found, .. }) => {
            let text = format!("UFRAME_NUM={found}");
            titled(format!("Add {text} before this line"), inserted(document, Some(place.start), &text))
        }
        Problem::Mistake(Mistake::Tool { found, .. }) => {
            let text = format!("UTOOL_NUM={found}");
            titled(format!("Add {text} before this line"), inserted(document, Some(place.start), &text))
        }
        Problem::Mistake(Mistake::Termination) => {
            let set = |program: &mut Program| {
                let index = statement(program, place.start);
                if let Some(Instruction::Motion(mut motion)) =
                    index.and_then(|index| program.instruction(index))
                {
                    motion.termination = Some(Termination::Fine);
                    program.set_motion(index.unwrap_or_default(), &motion)?;
                }
                Ok(())
            };
            titled("Add FINE".into(), changed(document, set))
        }
        Problem::Error(Reason::InstructionEnd) => {
            let line = document.lines().range(document.text(), document.lines().line(place.start));
            let end = line.start + document.at(&line).trim_end().len();
            titled("Close the instruction with ;".into(), Ok(vec![edit(document, end..end, " ;")]))
        }
        Problem::Error(Reason::End) => {
            let end = document.text().len();
            let is_whole = document.text().ends_with('\n');
            titled(
                "Add /END".into(),
                Ok(vec![edit(document, end..end, if is_whole { "/END\n" } else { "\n/END\n" })]),
            )
        }
        _ => None,
    }
}

/// Replaces the words at a byte by as many others.
fn replaced(document: &Document, start: usize, word: &str) -> Fix {
    let rest = document.text().get(start..)?;
    let is_word = |c: char| c.is_alphanumeric() || matches!(c, '_' | '.');
    let mut end = 0;
    for _ in word.split(' ') {
        let after = rest.get(end..)?;
        let blanks = after.len() - after.trim_start_matches([' ', '\t']).len();
        end += blanks + after.get(blanks..)?.find(|c| !is_word(c)).unwrap_or(after.len() - blanks);
    }
    // A number may follow without a blank: `ACX50`.
    let old = rest.get(..end)?;
    let digits = old.len() - old.trim_end_matches(|c: char| c.is_ascii_digit()).len();
    let end = if word.ends_with(|c: char| c.is_ascii_digit()) { end } else { end - digits };
    (end > 0).then(|| (format!("Replace by {word}"), vec![edit(document, start..start + end, word)]))
}

fn edit(document: &Document, place: Range<usize>, text: &str) -> TextEdit {
    TextEdit { range: document.converter().range(&place), new_text: text.to_owned() }
}

/// Inserts a statement before the statement at a byte, or at the end; returns edits that also number the lines.
fn inserted(document: &Document, before: Option<usize>, text: &str) -> Answer<Vec<TextEdit>> {
    changed(document, |program| {
        let index = before.map_or(Some(usize::MAX), |offset| statement(program, offset));
        let index = index.ok_or(EncodeError::Instruction { line: 0 })?;
        program.insert_instruction(index, text)?;
        program.renumber_lines()
    })
}

/// Returns the number of the statement at a byte, from 0.
fn statement(program: &Program, offset: usize) -> Option<usize> {
    program.statements().position(|statement| {
        let place = program.place(statement.text());
        (place.start..=place.end).contains(&offset)
    })
}

fn ending(block: Block) -> Option<&'static str> {
    match block {
        Block::If => Some("ENDIF"),
        Block::For => Some("ENDFOR"),
        Block::Select => None,
    }
}

/// Returns a position that is not taught, in the frames of the program's first one.
fn untaught(program: &Program, number: u32) -> Position {
    let first = program.positions().next().and_then(|position| position.groups.into_iter().next());
    let (user_frame, user_tool) =
        first.map_or((Some(0), Some(1)), |group| (group.user_frame, group.user_tool));
    let axis = |name| {
        let unit = if matches!(name, AxisName::X | AxisName::Y | AxisName::Z) {
            AxisUnit::Mm
        } else {
            AxisUnit::Deg
        };
        Axis { name, value: None, unit }
    };
    let axes =
        [AxisName::X, AxisName::Y, AxisName::Z, AxisName::W, AxisName::P, AxisName::R].map(axis).to_vec();
    let configuration = Some(Configuration::new("N U T, 0, 0, 0"));
    Position::new(number, Group { number: 1, user_frame, user_tool, configuration, axes })
}
