use crate::frame::find_end;
use crate::{DecodeError, Dialect, Line};

/// Bytes in, lines out.
///
/// Call [`push`](Self::push), then [`next_frame`](Self::next_frame) until it gives `None`. A line without an end gives
/// one error and is dropped up to the next end of a line, so the line behind it is found. `push` takes fewer bytes than
/// it is offered when its buffer is full: poll the lines, then offer the rest. After `None` there is always room.
#[derive(Debug, Clone)]
pub struct Decoder {
    dialect: Dialect,
    buffer: [u8; Line::MAX_LEN],
    start: usize,
    end: usize,
    skipping: bool,
    position: u64,
}

impl Decoder {
    /// A decoder at the beginning of a stream.
    pub const fn new(dialect: Dialect) -> Self {
        Self { dialect, buffer: [0; Line::MAX_LEN], start: 0, end: 0, skipping: false, position: 0 }
    }

    /// Takes bytes, and says how many; 0 when the buffer is full.
    pub fn push(&mut self, bytes: &[u8]) -> usize {
        if self.start > 0 {
            self.buffer.copy_within(self.start..self.end, 0);
            self.end -= self.start;
            self.start = 0;
        }
        let Some(room) = self.buffer.get_mut(self.end..) else { return 0 };
        let taken = room.len().min(bytes.len());
        if let (Some(to), Some(from)) = (room.get_mut(..taken), bytes.get(..taken)) {
            to.copy_from_slice(from);
        }
        self.end += taken;
        taken
    }

    /// The next line. `None`: more bytes needed.
    pub fn next_frame(&mut self) -> Option<Result<Line<'_>, DecodeError>> {
        loop {
            let waiting = self.buffer.get(self.start..self.end)?;
            let Some((content, used)) = find_end(waiting, &self.dialect) else { break };
            let content = self.start..self.start + content.len();
            self.drop_first(used);
            if !core::mem::take(&mut self.skipping) {
                return Some(Ok(Line::new(self.buffer.get(content)?)));
            }
        }
        let full = self.end - self.start == Line::MAX_LEN;
        if self.skipping || full {
            // The end of the line may be cut in two: keep its first half.
            let cr = self.buffer.get(self.start..self.end).is_some_and(|waiting| waiting.ends_with(b"\r"));
            self.drop_first(self.end - self.start - usize::from(cr));
        }
        if full && !core::mem::replace(&mut self.skipping, true) {
            return Some(Err(DecodeError::TooLong { limit: Line::MAX_LEN }));
        }
        None
    }

    /// Where in the stream the last line ended: the number of bytes that lines and dropped bytes have used so far.
    pub const fn position(&self) -> u64 {
        self.position
    }

    fn drop_first(&mut self, bytes: usize) {
        self.start += bytes;
        self.position += bytes as u64;
    }
}

impl Default for Decoder {
    fn default() -> Self {
        Self::new(Dialect::STRICT)
    }
}

#[cfg(test)]
mod tests {
    use std::{vec, vec::Vec};

    use super::*;

    /// The lines of a stream that comes in these pieces.
    fn lines<'a>(
        pieces: impl IntoIterator<Item = &'a [u8]>,
        dialect: Dialect,
    ) -> Vec<Result<Vec<u8>, DecodeError>> {
        let mut decoder = Decoder::new(dialect);
        let mut lines = Vec::new();
        for mut rest in pieces {
            while !rest.is_empty() {
                let taken = decoder.push(rest);
                assert!(taken > 0, "there is room after None");
                rest = &rest[taken..];
                while let Some(line) = decoder.next_frame() {
                    lines.push(line.map(|l| l.content().to_vec()));
                }
            }
        }
        lines
    }

    #[test]
    fn a_line_without_an_end_costs_itself_alone() {
        for len in [64, 65, 127, 128, 129, 1000] {
            let mut stream = b"STA\r\n".to_vec();
            stream.extend(vec![b'x'; len]);
            stream.extend_from_slice(b"\r\nSTP\r\n");
            let expected =
                [Ok(b"STA".to_vec()), Err(DecodeError::TooLong { limit: 64 }), Ok(b"STP".to_vec())];
            for pieces in testkit::chunking::chunkings(&stream) {
                assert_eq!(lines(pieces, Dialect::STRICT), expected, "{len}");
            }
        }
    }

    #[test]
    fn the_longest_line_fits_with_its_end() {
        let mut stream = vec![b'x'; 62];
        stream.extend_from_slice(b"\r\n");
        assert_eq!(lines([&stream[..]], Dialect::STRICT), [Ok(vec![b'x'; 62])]);
        stream.insert(0, b'x');
        assert_eq!(lines([&stream[..]], Dialect::STRICT), [Err(DecodeError::TooLong { limit: 64 })]);
    }
}
