use crate::dialect::Dialect;
use crate::error::DecodeError;
use crate::frame::{Line, find_end};

/// Bytes in, lines out.
///
/// After `next_frame` has returned `None` there is always room.
///
/// A line that is too long is dropped up to its end, however long it is, and gives one error there: nothing within it is
/// taken for a message, and the line after it is found.
#[derive(Debug, Clone)]
pub struct Decoder {
    dialect: Dialect,
    buffer: [u8; Line::MAX_LEN],
    start: usize,
    end: usize,
    /// Bytes of a line that is too long, before those in the buffer.
    dropped: u64,
    position: u64,
    finished: bool,
}

impl Decoder {
    /// A decoder at the beginning of a stream.
    pub const fn new(dialect: Dialect) -> Self {
        let buffer = [0; Line::MAX_LEN];
        Self { dialect, buffer, start: 0, end: 0, dropped: 0, position: 0, finished: false }
    }

    /// Bytes that are held and not looked at yet, but for those of a line that is too long.
    pub(crate) const fn held(&self) -> usize {
        self.end - self.start
    }

    fn without_end(&mut self) -> Option<DecodeError> {
        let waiting = self.end - self.start;
        if waiting == Line::MAX_LEN {
            // The end of the line may be cut in two: keep its first half.
            let kept = self.buffer.get(self.start..self.end).is_some_and(|bytes| bytes.ends_with(b"\r"));
            self.start = self.end - usize::from(kept);
            self.dropped += (waiting - usize::from(kept)) as u64;
        }
        let unread = (self.end - self.start) as u64 + self.dropped;
        if !self.finished || unread == 0 {
            return None;
        }
        self.start = self.end;
        self.position += unread;
        Some(match core::mem::take(&mut self.dropped) {
            0 => DecodeError::Incomplete,
            _ => DecodeError::TooLong { limit: Line::MAX_LEN },
        })
    }
}

impl robot_session::Decoder for Decoder {
    type Frame<'a> = Line<'a>;
    type Error = DecodeError;

    #[inline]
    fn push(&mut self, bytes: &[u8]) -> usize {
        if self.start > 0 {
            self.buffer.copy_within(self.start..self.end, 0);
            self.end -= self.start;
            self.start = 0;
        }
        // What ends here is not whole: `next_frame` reports that first.
        if self.finished && self.end as u64 + self.dropped > 0 {
            return 0;
        }
        self.finished = false;
        let Some(room) = self.buffer.get_mut(self.end..) else { return 0 };
        let taken = room.len().min(bytes.len());
        if let (Some(to), Some(from)) = (room.get_mut(..taken), bytes.get(..taken)) {
            to.copy_from_slice(from);
        }
        self.end += taken;
        taken
    }

    #[inline]
    fn next_frame(&mut self) -> Option<Result<Line<'_>, DecodeError>> {
        let waiting = self.buffer.get(self.start..self.end)?;
        let Some((content, used)) = find_end(waiting, &self.dialect) else {
            return self.without_end().map(Err);
        };
        let content = self.start..self.start + content.len();
        self.start += used;
        self.position += used as u64 + self.dropped;
        if core::mem::take(&mut self.dropped) > 0 {
            return Some(Err(DecodeError::TooLong { limit: Line::MAX_LEN }));
        }
        Some(Ok(Line::new(self.buffer.get(content)?)))
    }

    fn finish(&mut self) {
        self.finished = true;
    }

    fn position(&self) -> u64 {
        self.position
    }

    fn clear(&mut self) {
        self.position += (self.end - self.start) as u64 + self.dropped;
        (self.start, self.end, self.dropped, self.finished) = (0, 0, 0, false);
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

    use robot_session::Decoder as _;

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
        decoder.finish();
        lines.extend(decoder.next_frame().map(|line| line.map(|l| l.content().to_vec())));
        assert!(decoder.next_frame().is_none());
        lines
    }

    /// Whole, byte by byte, and in two pieces at every byte.
    fn chunkings(bytes: &[u8]) -> impl Iterator<Item = Vec<&[u8]>> {
        let halves = (1..bytes.len()).map(|at| vec![&bytes[..at], &bytes[at..]]);
        [vec![bytes], bytes.chunks(1).collect()].into_iter().chain(halves)
    }

    #[test]
    fn a_line_without_an_end_costs_itself_alone() {
        for len in [64, 65, 127, 128, 129, 1000] {
            let mut stream = b"STA\r\n".to_vec();
            stream.extend(vec![b'x'; len]);
            stream.extend_from_slice(b"\r\nSTP\r\n");
            let expected =
                [Ok(b"STA".to_vec()), Err(DecodeError::TooLong { limit: 64 }), Ok(b"STP".to_vec())];
            for pieces in chunkings(&stream) {
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

    #[test]
    fn what_has_no_end_is_an_error_when_the_stream_ends() {
        let incomplete = [Ok(b"STA".to_vec()), Err(DecodeError::Incomplete)];
        let too_long = [Ok(b"STA".to_vec()), Err(DecodeError::TooLong { limit: 64 })];
        for (len, expected) in [(1, &incomplete), (63, &incomplete), (64, &too_long), (300, &too_long)] {
            for last in [b'x', b'\r'] {
                let mut stream = b"STA\r\n".to_vec();
                stream.extend(vec![b'x'; len - 1]);
                stream.push(last);
                for pieces in chunkings(&stream) {
                    assert_eq!(lines(pieces, Dialect::STRICT), expected, "{len}");
                }
            }
        }
    }

    #[test]
    fn lines_and_errors_tile_the_stream() {
        let mut stream = b"STA\r\n".to_vec();
        stream.extend([b'x'; 100]);
        stream.extend(b"\r\nSTP\r\nOV");
        for chunk in [1, 7, 64, 200] {
            let mut decoder = Decoder::default();
            let mut ends = Vec::new();
            for mut rest in stream.chunks(chunk) {
                while !rest.is_empty() {
                    let taken = decoder.push(rest);
                    rest = &rest[taken..];
                    while decoder.next_frame().is_some() {
                        ends.push(decoder.position());
                    }
                }
            }
            decoder.finish();
            while decoder.next_frame().is_some() {
                ends.push(decoder.position());
            }
            assert_eq!(ends, [5, 107, 112, 114]);
        }
    }
}
