//! Bytes of a text as lines and characters, in the encoding that client and server have agreed on.

use core::cell::Cell;
use core::ops::Range;

use lsp_types::{Position, PositionEncodingKind};

/// The unit that columns are counted in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum Encoding {
    /// Bytes.
    Utf8,
    /// Units of UTF-16, which every client understands.
    #[default]
    Utf16,
    /// Characters.
    Utf32,
}

impl Encoding {
    /// Chooses from the encodings that a client offers, in the order of its preference; without one that is known, UTF-16.
    pub(crate) fn choose(offered: &[PositionEncodingKind]) -> Self {
        let known = [Self::Utf8, Self::Utf16, Self::Utf32];
        let chosen =
            offered.iter().find_map(|offered| known.into_iter().find(|known| known.kind() == *offered));
        chosen.unwrap_or_default()
    }

    /// Returns the encoding's name in the protocol.
    pub(crate) fn kind(self) -> PositionEncodingKind {
        match self {
            Self::Utf8 => PositionEncodingKind::UTF8,
            Self::Utf16 => PositionEncodingKind::UTF16,
            Self::Utf32 => PositionEncodingKind::UTF32,
        }
    }

    /// Returns the number of units of a character.
    fn width(self, c: char) -> usize {
        match self {
            Self::Utf8 => c.len_utf8(),
            Self::Utf16 => c.len_utf16(),
            Self::Utf32 => 1,
        }
    }
}

/// The lines of a text. A line ends with `\n`, `\r\n` or `\r`.
#[derive(Debug, Clone, Default)]
pub(crate) struct Lines {
    /// The first byte of each line but the first.
    starts: Vec<u32>,
    is_ascii: bool,
}

impl Lines {
    /// Finds the lines of a text.
    pub(crate) fn new(text: &str) -> Self {
        let bytes = text.as_bytes();
        let mut starts = Vec::new();
        for (at, byte) in bytes.iter().enumerate() {
            let ends = *byte == b'\n' || *byte == b'\r' && bytes.get(at + 1) != Some(&b'\n');
            if ends && let Ok(start) = u32::try_from(at + 1) {
                starts.push(start);
            }
        }
        starts.shrink_to_fit();
        Self { starts, is_ascii: text.is_ascii() }
    }

    /// Returns the line of a byte, from 0.
    pub(crate) fn line(&self, offset: usize) -> usize {
        self.starts.partition_point(|start| *start as usize <= offset)
    }

    /// Returns the first byte of a line; the end of the text after the last line.
    pub(crate) fn start(&self, text: &str, line: usize) -> usize {
        match line.checked_sub(1) {
            None => 0,
            Some(before) => self.starts.get(before).map_or(text.len(), |start| *start as usize),
        }
    }

    /// Returns the byte range of a line without its end.
    pub(crate) fn range(&self, text: &str, line: usize) -> Range<usize> {
        let start = self.start(text, line);
        let all = text.get(start..self.start(text, line + 1)).unwrap_or("");
        start..start + all.trim_end_matches(['\r', '\n']).len()
    }
}

/// A text with its lines, and an encoding: converts positions. Offsets that only grow within a line are converted in one
/// pass over it.
#[derive(Debug)]
pub(crate) struct Converter<'a> {
    text: &'a str,
    lines: &'a Lines,
    encoding: Encoding,
    /// The last offset that was converted and its column, and the start of its line.
    last: Cell<(usize, usize, usize)>,
}

impl<'a> Converter<'a> {
    /// Converts positions of this text, which has these lines.
    pub(crate) fn new(text: &'a str, lines: &'a Lines, encoding: Encoding) -> Self {
        Self { text, lines, encoding, last: Cell::default() }
    }

    /// Returns the position of a byte; the end of the text for a byte after it.
    #[expect(clippy::cast_possible_truncation, reason = "texts are far shorter than 4 GB")]
    pub(crate) fn position(&self, offset: usize) -> Position {
        let offset = offset.min(self.text.len());
        let line = self.lines.line(offset);
        let start = self.lines.start(self.text, line);
        if self.lines.is_ascii || self.encoding == Encoding::Utf8 {
            return Position { line: line as u32, character: (offset - start) as u32 };
        }
        let (last, column, of_line) = self.last.get();
        let (from, before) =
            if of_line == start && (start..=offset).contains(&last) { (last, column) } else { (start, 0) };
        let skipped = self.text.get(from..offset).unwrap_or("");
        let column = before + skipped.chars().map(|c| self.encoding.width(c)).sum::<usize>();
        self.last.set((offset, column, start));
        Position { line: line as u32, character: column as u32 }
    }

    /// Returns the range of some bytes.
    pub(crate) fn range(&self, bytes: &Range<usize>) -> lsp_types::Range {
        lsp_types::Range { start: self.position(bytes.start), end: self.position(bytes.end) }
    }

    /// Returns the byte of a position: the end of the line for a column after it, the end of the text for a line after it,
    /// and the character's first byte for a position within one.
    pub(crate) fn offset(&self, position: Position) -> usize {
        let line = self.lines.range(self.text, position.line as usize);
        let text = self.text.get(line.clone()).unwrap_or("");
        let character = position.character as usize;
        if self.lines.is_ascii {
            return line.start + character.min(text.len());
        }
        let mut column = 0;
        for (at, c) in text.char_indices() {
            column += self.encoding.width(c);
            if column > character {
                return line.start + at;
            }
        }
        line.end
    }

    /// Returns the byte range of a range; an end before the start is the start.
    pub(crate) fn bytes(&self, range: lsp_types::Range) -> Range<usize> {
        let start = self.offset(range.start);
        start..self.offset(range.end).max(start)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "a\u{e9}\u{1f600}z\r\n\rb\n";

    #[test]
    fn columns_are_counted_in_the_encoding() {
        let lines = Lines::new(TEXT);
        assert_eq!(lines.line(TEXT.len()), 3);
        let columns = |encoding| {
            let converter = Converter::new(TEXT, &lines, encoding);
            [0, 1, 3, 7, 8].map(|offset| converter.position(offset).character)
        };
        assert_eq!(columns(Encoding::Utf8), [0, 1, 3, 7, 8]);
        assert_eq!(columns(Encoding::Utf16), [0, 1, 2, 4, 5]);
        assert_eq!(columns(Encoding::Utf32), [0, 1, 2, 3, 4]);
    }

    #[test]
    fn a_position_outside_is_the_nearest_place() {
        let lines = Lines::new(TEXT);
        let converter = Converter::new(TEXT, &lines, Encoding::Utf16);
        let offset = |line, character| converter.offset(Position { line, character });
        // Within the pair of units of one character, after a line's end, on an empty line, after the last line.
        assert_eq!(
            [offset(0, 3), offset(0, 99), offset(1, 5), offset(2, 0), offset(2, 1), offset(3, 9)],
            [3, 8, 10, 11, 12, 13]
        );
        assert_eq!(offset(u32::MAX, u32::MAX), TEXT.len());
        let range = lsp_types::Range { start: Position { line: 2, character: 1 }, end: Position::default() };
        assert_eq!(converter.bytes(range), 12..12);
        assert_eq!(converter.position(usize::MAX), Position { line: 3, character: 0 });
    }
}
