//! The ranges of the parts of a program's text.

use alloc::vec::Vec;
use core::ops::Range;

use crate::attribute::Attribute;
use crate::error::{DecodeError, Reason};
use crate::position::Position;
use crate::statement::Statement;
use crate::text::{Fault, after_blanks, indent, is_letter_or_digit, is_nested};

/// The ranges of the parts of a text, in bytes; nothing is copied.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(crate) struct Parts {
    pub(crate) name: Range<usize>,
    /// The text after the name on its line.
    pub(crate) kind: Range<usize>,
    /// Between the line `/ATTR` and the next section.
    pub(crate) attributes: Option<Range<usize>>,
    pub(crate) application: Option<Range<usize>>,
    pub(crate) main: Range<usize>,
    pub(crate) positions: Option<Range<usize>>,
    /// The statements of `/MN` without the end of their last line, and whether they belong to the motion above.
    pub(crate) statements: Vec<(Range<usize>, bool)>,
    /// The positions of `/POS`: from the line that begins with `P[` to the next one.
    pub(crate) blocks: Vec<Range<usize>>,
}

impl Parts {
    /// Finds the sections, the statements and the positions. Does not check their contents.
    ///
    /// # Errors
    /// If the text has no name, no `/MN` or no `/END`, or if text follows `/END`.
    pub(crate) fn find(text: &str) -> Result<Self, DecodeError> {
        let error = |at, reason| Err(DecodeError::new(text, at, reason));
        let mut parts = Self::default();
        let start = text.find(|c: char| !c.is_whitespace() && c != '\u{feff}').unwrap_or(text.len());
        let (mut last, mut begins) = (0, start);
        let mut lines = Lines::new(text, start..text.len());
        loop {
            if last > 0 && (last != 4 || !parts.blocks.is_empty()) {
                lines.pass_plain();
            }
            let Some(line) = lines.next() else { break };
            let words = after_blanks(line.text);
            let found = words.starts_with('/').then(|| section(words.trim_end())).flatten();
            // A second `/PROG` is for its section to refuse; a second `/APPL` is one of the first one's lines.
            let begins_one =
                |section: usize| if section == 0 { line.start == start } else { (last, section) != (2, 2) };
            let Some((section, rest)) = found.filter(|(section, _)| begins_one(*section)) else {
                match last {
                    0 if line.start == start => return error(start, Reason::Program),
                    0 if !words.is_empty() => return error(line.start, Reason::Main),
                    4 => parts.begin_block(line, words),
                    _ => {}
                }
                continue;
            };
            if section == 0 {
                parts.head(text, line)?;
                continue;
            }
            if line.start == start {
                return error(start, Reason::Program);
            }
            if section <= last || (section > 3 && last < 3) {
                return error(line.start, missing(last));
            }
            if section == 3 && !rest.is_empty() {
                return error(offset(text, rest), Reason::Main);
            }
            parts.close(last, begins..line.start);
            (last, begins) = (section, lines.start);
            parts.blocks.reserve((text.len() - begins) / 128);
            if section == 5 {
                break;
            }
        }
        if last != 5 {
            return error(text.len(), if start == text.len() { Reason::Program } else { missing(last) });
        }
        // CP/M's end-of-file mark is still at the end of some exports.
        let blank = |c: char| c.is_whitespace() || c == '\u{1a}';
        let rest = text.get(begins..).unwrap_or("").trim_start_matches(blank);
        if !rest.is_empty() {
            return error(text.len() - rest.len(), Reason::Trailing);
        }
        parts.find_statements(text);
        Ok(parts)
    }

    /// Returns the attributes, each with its range, or the fault there.
    pub(crate) fn attributes<'a>(
        &self,
        text: &'a str,
    ) -> impl Iterator<Item = (Range<usize>, Result<Attribute, Fault<'a>>)> + use<'a> {
        let mut rest = self.attributes.clone().map_or("", |range| at(text, &range));
        core::iter::from_fn(move || {
            rest = rest.trim_start();
            if rest.is_empty() {
                return None;
            }
            let start = offset(text, rest);
            let (after, attribute) = match Attribute::decode(rest) {
                Ok((after, attribute)) => (after, Ok(attribute)),
                Err(error) => {
                    let fault = Fault::of(error);
                    // The faulty text ends at the beginning of the next attribute, at the left edge; items of a list are
                    // indented.
                    let blank = |c: char| c.is_whitespace();
                    let next =
                        fault.at.match_indices('\n').map(|(at, _)| fault.at.get(at + 1..).unwrap_or(""));
                    let after = { next }.find(|line| !line.starts_with(blank)).unwrap_or("");
                    (after, Err(fault))
                }
            };
            let length = rest.get(..rest.len() - after.len()).unwrap_or(rest).trim_end().len();
            rest = after;
            Some((start..start + length, attribute))
        })
    }

    /// Returns the lines of `/APPL`, without the blanks at their ends.
    pub(crate) fn application<'a>(&self, text: &'a str) -> Option<impl Iterator<Item = &'a str> + use<'a>> {
        let range = self.application.clone()?;
        Some(Lines::new(text, range).map(|line| line.text.trim_end()))
    }

    pub(crate) fn statements<'a>(&'a self, text: &'a str) -> impl Iterator<Item = Statement<'a>> {
        self.statements.iter().map(|(range, nested)| Statement::new(at(text, range), *nested))
    }

    pub(crate) fn positions<'a>(
        &'a self,
        text: &'a str,
    ) -> impl Iterator<Item = Result<Position, Fault<'a>>> {
        self.blocks.iter().map(|range| Position::decode_block(at(text, range)))
    }

    /// Moves all ranges after `end`, since the text before it got `new` bytes in the place of `old`.
    pub(crate) fn replaced(&mut self, end: usize, new: usize, old: usize) {
        let sections = [&mut self.name, &mut self.kind, &mut self.main];
        let optional = [&mut self.attributes, &mut self.application, &mut self.positions];
        let statements = self.statements.iter_mut().map(|(range, _)| range);
        let all = sections.into_iter().chain(optional.into_iter().flatten());
        for range in all.chain(statements).chain(&mut self.blocks) {
            for bound in [&mut range.start, &mut range.end] {
                if *bound >= end {
                    *bound = *bound + new - old;
                }
            }
        }
    }

    fn head(&mut self, text: &str, line: Line<'_>) -> Result<(), DecodeError> {
        let words = line.text;
        let tail = words.trim_start().get(5..).unwrap_or("");
        let name = tail.split_whitespace().next();
        let Some(name) = name else {
            return Err(DecodeError::new(text, line.start + words.trim_end().len(), Reason::Program));
        };
        let start = offset(text, name);
        self.name = start..start + name.len();
        let kind = text.get(self.name.end..line.end()).unwrap_or("");
        let blanks = kind.len() - kind.trim_start().len();
        let start = self.name.end + blanks;
        self.kind = start..start + kind.trim().len();
        Ok(())
    }

    fn close(&mut self, section: usize, range: Range<usize>) {
        match section {
            1 => self.attributes = Some(range),
            2 => self.application = Some(range),
            3 => self.main = range,
            4 => {
                self.end_block(range.end);
                self.positions = Some(range);
            }
            _ => {}
        }
    }

    fn find_statements(&mut self, text: &str) {
        let (mut last, mut in_block) = (0, false);
        self.statements.reserve(self.main.len() / 24);
        let mut lines = Lines::new(text, self.main.clone()).peekable();
        while let Some(line) = lines.next() {
            let words = line.text;
            if after_blanks(words).is_empty() {
                continue;
            }
            in_block = is_nested(words, last, in_block);
            let mut end = line.end();
            if !in_block {
                let mut open = !is_closed(words);
                while let Some(next) = lines.next_if(|next| open && continues(next.text)) {
                    end = next.end();
                    open = !is_closed(next.text);
                }
                // A line without a number has the next one.
                last = Statement::new(words, false).number().unwrap_or(last.saturating_add(1));
            }
            self.statements.push((line.start..end, in_block));
        }
    }

    /// Begins a block with a line of `/POS`, and its words after the blanks.
    fn begin_block(&mut self, line: Line<'_>, words: &str) {
        // Text before the first position is a block as well, which cannot be read.
        if words.starts_with("P[") || (self.blocks.is_empty() && !words.is_empty()) {
            self.end_block(line.start);
            self.blocks.push(line.end() - words.len()..line.end());
        }
    }

    fn end_block(&mut self, end: usize) {
        if let Some(block) = self.blocks.last_mut() {
            block.end = end;
        }
    }
}

/// Returns the text in a range.
pub(crate) fn at<'a>(text: &'a str, range: &Range<usize>) -> &'a str {
    text.get(range.clone()).unwrap_or("")
}

/// The lines of a part of a text.
#[derive(Debug, Clone)]
struct Lines<'a> {
    rest: &'a str,
    start: usize,
}

/// A line without its end, and its offset in the text.
#[derive(Debug, Clone, Copy)]
struct Line<'a> {
    text: &'a str,
    start: usize,
}

impl<'a> Lines<'a> {
    fn new(text: &'a str, part: Range<usize>) -> Self {
        Self { rest: at(text, &part), start: part.start }
    }

    /// Advances to the next line that may begin a section or a position: one with only blanks before such a mark.
    fn pass_plain(&mut self) {
        let bytes = self.rest.as_bytes();
        let mut at = mark(bytes, 0);
        while at < bytes.len() && matches!(bytes.get(at.wrapping_sub(1)), Some(b'!'..=b'~')) {
            at = mark(bytes, at + 1);
        }
        let before = bytes.get(..at).unwrap_or(bytes);
        let line_start = before.iter().rposition(|byte| *byte == b'\n').map_or(0, |at| at + 1);
        let skipped = if at < bytes.len() { line_start } else { at };
        self.rest = self.rest.get(skipped..).unwrap_or("");
        self.start += skipped;
    }
}

impl<'a> Iterator for Lines<'a> {
    type Item = Line<'a>;

    #[inline]
    fn next(&mut self) -> Option<Line<'a>> {
        if self.rest.is_empty() {
            return None;
        }
        let length = line_length(self.rest.as_bytes());
        let (line, rest) = self.rest.split_at_checked(length).unwrap_or((self.rest, ""));
        let text = line.strip_suffix('\r').unwrap_or(line);
        let text = if text.ends_with('\r') { text.trim_end_matches('\r') } else { text };
        let line = Line { text, start: self.start };
        self.rest = rest.get(1..).unwrap_or("");
        self.start += length + usize::from(!rest.is_empty());
        Some(line)
    }
}

/// Returns the offset of the next byte with which a section or a position begins, or the end.
#[inline(always)]
fn mark(bytes: &[u8], start: usize) -> usize {
    let is_mark = |byte: &u8| matches!(byte, b'/' | b'P');
    // Every byte of a block is looked at, which is one comparison for all of them.
    let is_plain = |block: &&[u8; 16]| !block.iter().fold(false, |found, byte| found | is_mark(byte));
    let rest = bytes.get(start..).unwrap_or(&[]);
    let passed = start + rest.as_chunks().0.iter().take_while(is_plain).count() * 16;
    let rest = bytes.get(passed..).unwrap_or(&[]);
    passed + rest.iter().position(is_mark).unwrap_or(rest.len())
}

/// Returns the number of bytes before the line feed. Lines are short: a search for longer ones would cost as much to start.
#[inline]
fn line_length(bytes: &[u8]) -> usize {
    let (words, rest) = bytes.as_chunks();
    for (word, at) in words.iter().zip((0..).step_by(8)) {
        // The lowest byte that is zero gets its top bit.
        let zeros = u64::from_le_bytes(*word) ^ u64::from_le_bytes([b'\n'; 8]);
        let found = zeros.wrapping_sub(u64::from_le_bytes([1; 8])) & !zeros & u64::from_le_bytes([0x80; 8]);
        if found != 0 {
            return at + found.trailing_zeros() as usize / 8;
        }
    }
    let found = rest.iter().position(|byte| *byte == b'\n');
    found.map_or(bytes.len(), |at| bytes.len() - rest.len() + at)
}

impl Line<'_> {
    fn end(self) -> usize {
        self.start + self.text.len()
    }
}

/// Returns the offset of a part of a text.
pub(crate) fn offset(text: &str, part: &str) -> usize {
    (part.as_ptr() as usize).saturating_sub(text.as_ptr() as usize).min(text.len())
}

/// Returns whether a line of `/APPL` would end it.
pub(crate) fn ends_application(line: &str) -> bool {
    section(after_blanks(line)).is_some_and(|(section, _)| ![0, 2].contains(&section))
}

/// Returns the section that a line begins, counted in their sequence, and the text after its name.
fn section(line: &str) -> Option<(usize, &str)> {
    let (section, length) = match line.as_bytes() {
        [b'/', b'P', b'R', b'O', b'G', ..] => (0, 5),
        [b'/', b'A', b'T', b'T', b'R', ..] => (1, 5),
        [b'/', b'A', b'P', b'P', b'L', ..] => (2, 5),
        [b'/', b'M', b'N', ..] => (3, 3),
        [b'/', b'P', b'O', b'S', ..] => (4, 4),
        [b'/', b'E', b'N', b'D', ..] => (5, 4),
        _ => return None,
    };
    let rest = line.get(length..)?;
    (!rest.starts_with(is_letter_or_digit)).then_some((section, rest))
}

/// Returns the reason for a missing next section.
fn missing(section: usize) -> Reason {
    if section < 3 { Reason::Main } else { Reason::End }
}

fn is_closed(line: &str) -> bool {
    line.as_bytes().ends_with(b";") || line.trim_end().ends_with(';')
}

fn continues(line: &str) -> bool {
    indent(line).starts_with(':')
}

#[cfg(test)]
mod tests {
    use alloc::{format, string::String};

    use super::*;

    /// Every text of five of these characters, at every offset of two blocks of sixteen: no line that may begin a section or
    /// a position is passed, and no line is examined whose marks all follow printed characters.
    #[test]
    fn lines_are_passed_up_to_one_that_may_begin_something() {
        let characters = ['/', 'P', 'x', ' ', '\n', 'é'];
        for code in 0..6_usize.pow(5) {
            let end: String = (0..5).map(|at| characters[code / 6_usize.pow(at) % 6]).collect();
            for before in ["", "\n", "x\n"] {
                for blanks in 0..33 {
                    let text = format!("{before}{}{end}", " ".repeat(blanks));
                    let mut lines = Lines::new(&text, 0..text.len());
                    lines.pass_plain();
                    let may_begin = |line: &str| line.trim_start().starts_with(['/', 'P']);
                    let passed = &text[..lines.start];
                    assert_eq!((passed.len(), lines.rest), (lines.start, &text[lines.start..]), "{text:?}");
                    assert!(passed.is_empty() || passed.ends_with('\n') || lines.rest.is_empty(), "{text:?}");
                    assert!(!passed.lines().any(may_begin), "{text:?} at {}", lines.start);
                    let marks = lines.rest.lines().next().map(|line| {
                        let printed = |at: usize| line[..at].ends_with(|it| matches!(it, '!'..='~'));
                        line.match_indices(['/', 'P']).any(|(at, _)| !printed(at))
                    });
                    assert!(marks.unwrap_or(true), "{text:?} at {}", lines.start);
                }
            }
        }
    }
}
