use crate::{DecodeError, Dialect};

/// The envelope: a line without its end (§4: carriage return, line feed).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Line<'a>(&'a [u8]);

impl<'a> Line<'a> {
    /// The longest line that is looked at, its end included: the longest message has 50 bytes.
    pub const MAX_LEN: usize = 64;

    /// A line of these bytes, which hold no end.
    pub const fn new(content: &'a [u8]) -> Self {
        Self(content)
    }

    /// The first line, and the bytes that it used with its end. `None`: more bytes needed.
    ///
    /// # Errors
    /// [`DecodeError::TooLong`] when the first [`MAX_LEN`](Self::MAX_LEN) bytes hold no end.
    pub fn decode(bytes: &'a [u8], dialect: &Dialect) -> Result<Option<(Self, usize)>, DecodeError> {
        let window = bytes.get(..Self::MAX_LEN).unwrap_or(bytes);
        match find_end(window, dialect) {
            Some((content, used)) => Ok(Some((Self(content), used))),
            None if window.len() < Self::MAX_LEN => Ok(None),
            None => Err(DecodeError::TooLong { limit: Self::MAX_LEN }),
        }
    }

    /// The bytes between the ends.
    pub const fn content(self) -> &'a [u8] {
        self.0
    }
}

/// What stands before the first end of a line, and the bytes up to and with that end.
pub(crate) fn find_end<'a>(bytes: &'a [u8], dialect: &Dialect) -> Option<(&'a [u8], usize)> {
    let mut from = 0;
    loop {
        let feed = from + line_feed(bytes.get(from..)?)?;
        let before = bytes.get(..feed)?;
        match before.strip_suffix(b"\r") {
            Some(content) => return Some((content, feed + 1)),
            None if dialect.lone_lf => return Some((before, feed + 1)),
            None => from = feed + 1,
        }
    }
}

/// The place of the first line feed, eight bytes at a time.
fn line_feed(bytes: &[u8]) -> Option<usize> {
    const ONES: u64 = u64::MAX / 0xFF;
    let (words, rest) = bytes.as_chunks::<8>();
    for (i, word) in words.iter().enumerate() {
        let feeds = u64::from_le_bytes(*word) ^ (ONES * b'\n' as u64);
        // The lowest zero byte gets its high bit; only bytes above it may get one wrongly.
        let zeros = feeds.wrapping_sub(ONES) & !feeds & (ONES << 7);
        if zeros != 0 {
            return Some(8 * i + (zeros.trailing_zeros() / 8) as usize);
        }
    }
    let tail = rest.iter().position(|b| *b == b'\n')?;
    Some(8 * words.len() + tail)
}

#[cfg(test)]
mod tests {
    use std::{string::ToString, vec};

    use super::*;

    #[test]
    fn a_line_feed_is_found_wherever_it_stands() {
        for len in 0..40 {
            for at in 0..len {
                for filler in [0u8, 0x0B, 0x8A, 0xFF] {
                    let mut bytes = vec![filler; len];
                    bytes[at] = b'\n';
                    assert_eq!(line_feed(&bytes), Some(at), "{bytes:?}");
                    bytes[at..].fill(b'\n');
                    assert_eq!(line_feed(&bytes), Some(at), "{bytes:?}");
                    bytes.fill(filler);
                    assert_eq!(line_feed(&bytes), None, "{bytes:?}");
                }
            }
        }
    }

    #[test]
    fn a_line_ends_at_both_characters() {
        let strict = Dialect::STRICT;
        assert_eq!(Line::decode(b"STA\r\nSTP\r\n", &strict), Ok(Some((Line(b"STA"), 5))));
        assert_eq!(Line::decode(b"STA\r", &strict), Ok(None));
        assert_eq!(Line::decode(b"STA\nSTP\r\n", &strict), Ok(Some((Line(b"STA\nSTP"), 9))));
        assert_eq!(Line::decode(b"\r\n", &strict), Ok(Some((Line(b""), 2))));
        let tolerant = Dialect { lone_lf: true, ..strict };
        assert_eq!(Line::decode(b"STA\nSTP\r\n", &tolerant), Ok(Some((Line(b"STA"), 4))));
        assert_eq!(Line::decode(b"STP\r\n", &tolerant), Ok(Some((Line(b"STP"), 5))));
    }

    #[test]
    fn a_line_without_an_end_is_given_up() {
        let endless = [b'A'; 64];
        assert_eq!(Line::decode(&endless[..63], &Dialect::STRICT), Ok(None));
        let error = Line::decode(&endless, &Dialect::STRICT).unwrap_err();
        assert_eq!(error.to_string(), "no end of the line within 64 bytes");
    }
}
