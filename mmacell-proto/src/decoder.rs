use robot_session::end::StreamBuffer;

use crate::dialect::Dialect;
use crate::error::DecodeError;
use crate::frame::{Line, find_end};

/// Bytes in, lines out.
///
/// After `next_frame` has returned `None`, there is always free space.
///
/// A line that is too long is dropped up to its end, however long it is, and gives one error there: nothing within it is
/// taken for a message, and the line after it is found.
pub type Decoder = LineDecoder<{ Line::MAX_LEN }>;

/// A [`Decoder`] that buffers `N` bytes, [`Line::MAX_LEN`] at least: more than a line if lines wait.
#[derive(Debug, Clone)]
pub struct LineDecoder<const N: usize> {
    dialect: Dialect,
    buffer: StreamBuffer<N>,
    /// The number of bytes without the end of a line.
    searched: usize,
    /// The stream offset after the last item: the bytes between it and the buffer are the beginning of a line that is
    /// too long.
    position: u64,
    finished: bool,
}

impl<const N: usize> LineDecoder<N> {
    /// Creates a decoder at the beginning of a stream.
    pub const fn new(dialect: Dialect) -> Self {
        const { assert!(N >= Line::MAX_LEN, "a line has to fit") };
        let buffer = StreamBuffer::new();
        Self { dialect, buffer, searched: 0, position: 0, finished: false }
    }

    /// Finds the next line; out of line, so that the usual path is short.
    #[inline(never)]
    fn next_line(&mut self) -> Option<Result<Line<'_>, DecodeError>> {
        let Some((content, used)) = find_end(self.buffer.bytes(), self.searched, &self.dialect) else {
            return self.without_end().map(Err);
        };
        let (length, is_too_long) = (content.len(), self.is_too_long() || used > Line::MAX_LEN);
        self.searched = 0;
        self.position = self.buffer.position() + used as u64;
        if is_too_long {
            self.buffer.take(used);
            return Some(Err(DecodeError::TooLong { limit: Line::MAX_LEN }));
        }
        let line = self.buffer.take(used);
        Some(Ok(Line::new(line.get(..length)?)))
    }

    #[inline]
    fn without_end(&mut self) -> Option<DecodeError> {
        self.searched = self.buffer.len();
        if self.searched >= Line::MAX_LEN {
            self.drop_line();
        }
        if self.finished { self.incomplete() } else { None }
    }

    #[cold]
    fn drop_line(&mut self) {
        // The end of the line may be cut in two: keep its first half.
        let kept = usize::from(self.buffer.bytes().ends_with(b"\r"));
        self.buffer.take(self.searched - kept);
        self.searched = kept;
    }

    #[cold]
    fn incomplete(&mut self) -> Option<DecodeError> {
        let is_too_long = self.is_too_long();
        self.buffer.clear();
        self.searched = 0;
        let before = core::mem::replace(&mut self.position, self.buffer.position());
        match is_too_long {
            _ if before == self.position => None,
            true => Some(DecodeError::TooLong { limit: Line::MAX_LEN }),
            false => Some(DecodeError::Incomplete),
        }
    }

    const fn is_too_long(&self) -> bool {
        self.position != self.buffer.position()
    }
}

impl<const N: usize> robot_session::Decoder for LineDecoder<N> {
    type Frame<'a> = Line<'a>;
    type Error = DecodeError;

    #[inline]
    fn push(&mut self, bytes: &[u8]) -> usize {
        // The last line is not whole: `next_frame` reports it first.
        if self.finished && (!self.buffer.is_empty() || self.is_too_long()) {
            return 0;
        }
        self.finished = false;
        self.buffer.push(bytes)
    }

    #[inline]
    fn next_frame(&mut self) -> Option<Result<Line<'_>, DecodeError>> {
        if self.buffer.is_empty() && !self.finished { None } else { self.next_line() }
    }

    fn finish(&mut self) {
        self.finished = true;
    }

    fn position(&self) -> u64 {
        self.position
    }

    fn clear(&mut self) {
        self.buffer.clear();
        (self.position, self.searched, self.finished) = (self.buffer.position(), 0, false);
    }
}

impl<const N: usize> Default for LineDecoder<N> {
    fn default() -> Self {
        Self::new(Dialect::STRICT)
    }
}

#[cfg(test)]
mod tests {
    use std::{vec, vec::Vec};

    use robot_session::Decoder as _;

    use super::*;

    /// Returns the lines of a stream that arrives in these pieces.
    fn lines<'a>(
        pieces: impl IntoIterator<Item = &'a [u8]>,
        dialect: Dialect,
    ) -> Vec<Result<Vec<u8>, DecodeError>> {
        let pieces: Vec<&[u8]> = pieces.into_iter().collect();
        let lines = lines_of::<64>(&pieces, dialect);
        assert_eq!(lines_of::<100>(&pieces, dialect), lines, "however much is held");
        assert_eq!(lines_of::<512>(&pieces, dialect), lines, "however much is held");
        lines
    }

    fn lines_of<const N: usize>(pieces: &[&[u8]], dialect: Dialect) -> Vec<Result<Vec<u8>, DecodeError>> {
        let mut decoder = LineDecoder::<N>::new(dialect);
        let mut lines = Vec::new();
        for mut rest in pieces.iter().copied() {
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

    /// Returns the ways to read `bytes`: whole, byte by byte, and in two pieces at every byte.
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
