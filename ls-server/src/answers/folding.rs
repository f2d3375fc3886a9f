//! `textDocument/foldingRange`: sections, blocks, comments.

use fanuc_ls::Operation;
use lsp_types::{FoldingRange, FoldingRangeKind, FoldingRangeParams};

use crate::answer::{Answer, document};
use crate::document::Document;
use crate::folder::Folder;

pub(crate) fn folding(folder: &Folder, params: FoldingRangeParams) -> Answer<Option<Vec<FoldingRange>>> {
    let document = document(folder, &params.text_document.uri)?;
    let mut folds = Folds::default();
    sections(document, &mut folds);
    blocks(document, &mut folds);
    folds.found.sort_by_key(|fold| (fold.start_line, fold.end_line));
    Ok(Some(folds.found))
}

#[derive(Default)]
struct Folds {
    found: Vec<FoldingRange>,
}

impl Folds {
    /// Adds the lines from `start` to `end`, if there are two or more.
    fn push(&mut self, start: usize, end: usize, kind: Option<FoldingRangeKind>) {
        if let (Ok(start_line), Ok(end_line)) = (u32::try_from(start), u32::try_from(end))
            && start < end
        {
            self.found.push(FoldingRange { start_line, end_line, kind, ..FoldingRange::default() });
        }
    }
}

fn sections(document: &Document, folds: &mut Folds) {
    let mut open = None;
    let mut last = 0;
    for (number, line) in document.text().lines().enumerate() {
        let words = line.trim_end();
        let begins = ["/ATTR", "/APPL", "/MN", "/POS", "/END"].contains(&words);
        if begins && let Some(start) = open.replace(number) {
            folds.push(start, number - 1, Some(FoldingRangeKind::Region));
        }
        last = number;
    }
    if let Some(start) = open {
        folds.push(start, last, Some(FoldingRangeKind::Region));
    }
}

/// The kind of a block that is open, and its first line.
type OpenBlock = (Block, usize);
/// The first and the last line of a SELECT or of comments.
type Run = (usize, usize);

#[derive(Clone, Copy, PartialEq, Eq)]
enum Block {
    If,
    For,
}

fn blocks(document: &Document, folds: &mut Folds) {
    let Some(program) = document.unfinished_program() else { return };
    let mut open: Vec<OpenBlock> = Vec::new();
    let (mut select, mut comments): (Option<Run>, Option<Run>) = (None, None);
    for statement in program.statements().filter(|statement| !statement.is_nested()) {
        let body = statement.body();
        let line = document.lines().line(program.place(body).start);
        if body.starts_with('!') {
            comments = Some(comments.map_or((line, line), |(start, _)| (start, line)));
            continue;
        }
        if let Some((start, end)) = comments.take() {
            folds.push(start, end, Some(FoldingRangeKind::Comment));
        }
        let operation = if may_be_of_block(body) { Operation::decode(body) } else { None };
        match &operation {
            Some(Operation::Case(..) | Operation::Otherwise(_)) => {
                select = select.map(|(start, _)| (start, line));
                continue;
            }
            Some(Operation::IfThen(_)) => open.push((Block::If, line)),
            Some(Operation::For { .. }) => open.push((Block::For, line)),
            Some(Operation::Else) => close(Block::If, line, &mut open, folds, true),
            Some(Operation::EndIf) => close(Block::If, line, &mut open, folds, false),
            Some(Operation::EndFor) => close(Block::For, line, &mut open, folds, false),
            _ => {}
        }
        if let Some((start, end)) = select.take() {
            folds.push(start, end, None);
        }
        if matches!(operation, Some(Operation::Select(..))) {
            select = Some((line, line));
        }
    }
    for (start, end) in comments.into_iter().chain(select) {
        folds.push(start, end, None);
    }
}

/// Folds a block up to the line before its end; `goes_on` begins the next part.
fn close(block: Block, line: usize, open: &mut Vec<OpenBlock>, folds: &mut Folds, goes_on: bool) {
    let Some(at) = open.iter().rposition(|(open, _)| *open == block) else { return };
    if let Some((_, start)) = open.get(at) {
        folds.push(*start, line - 1, None);
    }
    open.truncate(at);
    if goes_on {
        open.push((block, line));
    }
}

/// Returns whether an instruction may begin, continue or end a block, by its first letters.
fn may_be_of_block(body: &str) -> bool {
    const HEADS: [&str; 11] =
        ["IF", "WENN", "ELSE", "SONST", "ENDIF", "ENDWENN", "SELECT", "IST", "CASE", "FOR", "ENDFOR"];
    let begins = |head: &str| body.get(..head.len()).is_some_and(|begin| begin.eq_ignore_ascii_case(head));
    body.starts_with('=') || HEADS.iter().any(|head| begins(head))
}
