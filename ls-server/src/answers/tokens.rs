//! `textDocument/semanticTokens`: the kinds of words, for colours.

use core::ops::Range;
use std::collections::BTreeSet;
use std::sync::OnceLock;

use fanuc_ls::{ItemKind, Reference, Syntax};
use lsp_types::{
    SemanticToken, SemanticTokenType, SemanticTokens, SemanticTokensLegend, SemanticTokensParams,
    SemanticTokensRangeParams, SemanticTokensRangeResult, SemanticTokensResult,
};

use crate::answer::{Answer, document};
use crate::document::Document;
use crate::folder::Folder;

const TYPES: [SemanticTokenType; 9] = [
    SemanticTokenType::KEYWORD,
    SemanticTokenType::FUNCTION,
    SemanticTokenType::VARIABLE,
    SemanticTokenType::PROPERTY,
    SemanticTokenType::ENUM_MEMBER,
    SemanticTokenType::PARAMETER,
    SemanticTokenType::COMMENT,
    SemanticTokenType::STRING,
    SemanticTokenType::NUMBER,
];
const KEYWORD: u32 = 0;
const FUNCTION: u32 = 1;
const VARIABLE: u32 = 2;
const PROPERTY: u32 = 3;
const MEMBER: u32 = 4;
const PARAMETER: u32 = 5;
const COMMENT: u32 = 6;
const STRING: u32 = 7;
const NUMBER: u32 = 8;

/// Returns the names of the kinds, in the sequence of their numbers.
pub(crate) fn legend() -> SemanticTokensLegend {
    SemanticTokensLegend { token_types: TYPES.to_vec(), token_modifiers: Vec::new() }
}

pub(crate) fn full(folder: &Folder, params: SemanticTokensParams) -> Answer<Option<SemanticTokensResult>> {
    let document = document(folder, &params.text_document.uri)?;
    Ok(Some(SemanticTokensResult::Tokens(tokens(document, 0..document.text().len()))))
}

pub(crate) fn of_range(
    folder: &Folder,
    params: SemanticTokensRangeParams,
) -> Answer<Option<SemanticTokensRangeResult>> {
    let document = document(folder, &params.text_document.uri)?;
    let range = document.converter().bytes(params.range);
    Ok(Some(SemanticTokensRangeResult::Tokens(tokens(document, range))))
}

fn tokens(document: &Document, range: Range<usize>) -> SemanticTokens {
    let mut lexer =
        Lexer { document, references: document.index().references().collect(), found: Vec::new() };
    if let Some(program) = document.unfinished_program() {
        let bodies = program.statements().map(|statement| {
            let body = if statement.is_nested() { statement.text() } else { statement.body() };
            program.place(body)
        });
        for body in bodies.filter(|body| body.start < range.end && range.start < body.end) {
            lexer.statement(body);
        }
        lexer.rest(&range);
    }
    let converter = document.converter();
    let mut tokens = lexer.found;
    tokens.sort_by_key(|(place, _)| place.start);
    let (mut line, mut column) = (0, 0);
    let token = |(place, token_type): (Range<usize>, u32)| {
        let (start, end) = (converter.position(place.start), converter.position(place.end));
        let delta_line = start.line - line;
        let delta_start = if delta_line == 0 { start.character - column } else { start.character };
        (line, column) = (start.line, start.character);
        let length = end.character.saturating_sub(start.character);
        SemanticToken { delta_line, delta_start, length, token_type, token_modifiers_bitset: 0 }
    };
    SemanticTokens { result_id: None, data: tokens.into_iter().map(token).collect() }
}

struct Lexer<'a> {
    document: &'a Document,
    references: Vec<Reference>,
    found: Vec<(Range<usize>, u32)>,
}

impl Lexer<'_> {
    /// Adds the tokens of the words of an instruction.
    fn statement(&mut self, body: Range<usize>) {
        let document = self.document;
        let text = document.at(&body);
        if text.starts_with(['!']) || text.starts_with("--") || text.starts_with("//") {
            return self.lines(&body, COMMENT);
        }
        let mut next = self.references.partition_point(|found| found.letters.start < body.start);
        let mut at = body.start;
        let mut is_call = false;
        while let Some(first) = document.at(&(at..body.end)).chars().next() {
            if let Some(found) = self.references.get(next).filter(|found| found.letters.start == at).cloned()
            {
                next += 1;
                at = self.reference(&found);
                continue;
            }
            let rest = document.at(&(at..body.end));
            let length = match first {
                '\'' => {
                    rest.get(1..).and_then(|rest| rest.find(['\'', '\n'])).map_or(rest.len(), |end| end + 2)
                }
                '0'..='9' => run(rest, |c| c.is_ascii_digit() || c == '.'),
                _ if is_letter(first) => run(rest, |c| is_letter(c) || matches!(c, '0'..='9' | '-' | '.')),
                _ => first.len_utf8(),
            };
            let word = rest.get(..length).unwrap_or("");
            match first {
                '\'' => self.lines(&(at..at + length), STRING),
                '0'..='9' => self.found.push((at..at + length, NUMBER)),
                _ if is_letter(first) && is_call => self.found.push((at..at + length, FUNCTION)),
                _ if is_letter(first) => self.word(at, word),
                _ => {}
            }
            at += length;
            if is_message(word)
                && let Some(end) = rest.rfind(']')
            {
                let end = at - length + end;
                self.lines(&(at + 1..end.max(at + 1)), STRING);
                at = end.max(at);
            }
            let is_blank = word.chars().all(char::is_whitespace);
            is_call = is_blank && is_call
                || ["CALL", "AUFRUF", "RUN"].iter().any(|name| word.eq_ignore_ascii_case(name));
        }
    }

    /// Adds the tokens of an item, such as a register or an input, with its number and name; returns its end.
    fn reference(&mut self, found: &Reference) -> usize {
        self.found.push((found.letters.clone(), kind(found.kind)));
        self.found.push((found.digits.clone(), NUMBER));
        if let Some(name) = &found.name {
            self.found.push((name.clone(), STRING));
        }
        found.name.as_ref().map_or(found.digits.end, |name| name.end)
    }

    /// Adds the token of a word that is not an item: a keyword, with or without a number after it, or a system variable.
    fn word(&mut self, at: usize, word: &str) {
        let letters = word.trim_end_matches(|c: char| c.is_ascii_digit() || matches!(c, '-' | '.'));
        if word.starts_with('$') {
            self.found.push((at..at + word.len(), VARIABLE));
        } else if keywords().contains(letters.to_uppercase().as_str()) {
            self.found.push((at..at + letters.len(), KEYWORD));
            if letters.len() < word.len() {
                self.found.push((at + letters.len()..at + word.len(), NUMBER));
            }
        } else if let Some(item) = ItemKind::named(word) {
            self.found.push((at..at + word.len(), kind(item)));
        }
    }

    /// Adds the tokens of the names of sections, the program's name, and the items of `/POS`.
    fn rest(&mut self, range: &Range<usize>) {
        let document = self.document;
        let (text, lines) = (document.text(), document.lines());
        let mut positions = text.len();
        for line in lines.line(range.start)..=lines.line(range.end) {
            let place = lines.range(text, line);
            let words = document.at(&place);
            let length = run(words, |c| c == '/' || c.is_ascii_uppercase());
            let word = words.get(..length).unwrap_or("");
            if ["/PROG", "/ATTR", "/APPL", "/MN", "/POS", "/END"].contains(&word) {
                self.found.push((place.start..place.start + length, KEYWORD));
            }
        }
        if let Some(found) = text.find("\n/POS") {
            positions = found;
        }
        let first = self.references.partition_point(|found| found.letters.start < positions.max(range.start));
        let there: Vec<Reference> = { self.references.iter().skip(first) }
            .take_while(|found| found.letters.start < range.end)
            .cloned()
            .collect();
        for found in there {
            self.reference(&found);
        }
        let name = document.index().name();
        if range.contains(&name.start) {
            self.found.push((name, FUNCTION));
        }
    }

    /// Adds a token of several lines as one token for each line.
    fn lines(&mut self, place: &Range<usize>, kind: u32) {
        let mut at = place.start;
        for line in self.document.at(place).split_inclusive('\n') {
            let length = line.trim_end().len();
            if length > 0 {
                self.found.push((at..at + length, kind));
            }
            at += line.len();
        }
    }
}

fn kind(kind: ItemKind) -> u32 {
    use ItemKind::{
        Argument, Label, Position, PositionRegister, Register, StringRegister, Timer, UserFrame, UserTool,
    };
    match kind {
        Register | StringRegister | Timer => VARIABLE,
        Position | PositionRegister | UserFrame | UserTool => MEMBER,
        Argument => PARAMETER,
        Label => FUNCTION,
        _ => PROPERTY,
    }
}

/// Returns the words of instructions and options, in upper case.
fn keywords() -> &'static BTreeSet<String> {
    static WORDS: OnceLock<BTreeSet<String>> = OnceLock::new();
    WORDS.get_or_init(|| {
        let others = "J L C A S THEN DANN TO DOWNTO AND OR NOT MOD DIV ON OFF EIN AUS TIMEOUT LPOS JPOS PULSE START STOP STOPP RESET \
                      ENABLE DISABLE CNT FINE MAX_SPEED ABS SQRT SIN COS TAN ASIN ACOS ATAN ATAN2 EXP LN ROUND TRUNC STRLEN FINDSTR SUBSTR";
        let table = Syntax::instructions().chain(Syntax::options()).flat_map(|syntax| syntax.words);
        let table = table.flat_map(|words| words.split(' ')).chain(others.split_whitespace());
        table.filter(|word| word.starts_with(is_letter)).map(str::to_uppercase).collect()
    })
}

fn is_letter(c: char) -> bool {
    c.is_alphabetic() || matches!(c, '_' | '$')
}

fn is_message(word: &str) -> bool {
    ["MESSAGE", "MELDUNG"].iter().any(|name| word.eq_ignore_ascii_case(name))
}

/// Returns the number of bytes at the beginning whose characters match.
fn run(text: &str, is: impl Fn(char) -> bool) -> usize {
    text.find(|c| !is(c)).unwrap_or(text.len())
}
