use crate::dialect::Dialect;
use crate::error::DecodeError;

/// The envelope: a line without its end (§4: carriage return, line feed).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Line<'a>(&'a [u8]);

impl<'a> Line<'a> {
    /// The longest line that is looked at, its end included: the longest message has 50 bytes.
    pub const MAX_LEN: usize = 64;

    /// Creates a line of these bytes, which do not contain an end of line.
    pub const fn new(content: &'a [u8]) -> Self {
        Self(content)
    }

    /// Decodes the first line, and the number of bytes up to its end. `None` if more bytes are needed.
    ///
    /// # Errors
    /// [`DecodeError::TooLong`] when the first [`MAX_LEN`](Self::MAX_LEN) bytes hold no end.
    #[inline]
    pub fn decode(bytes: &'a [u8], dialect: &Dialect) -> Result<Option<(Self, usize)>, DecodeError> {
        let window = bytes.get(..Self::MAX_LEN).unwrap_or(bytes);
        match find_end(window, 0, dialect) {
            Some((content, used)) => Ok(Some((Self(content), used))),
            None if window.len() < Self::MAX_LEN => Ok(None),
            None => Err(DecodeError::TooLong { limit: Self::MAX_LEN }),
        }
    }

    /// Returns the bytes between the ends.
    pub const fn content(self) -> &'a [u8] {
        self.0
    }
}

/// Returns the contents of the first line, and the length of the line with its end; the first `searched` bytes have
/// no end of a line.
///
/// In a request-reply protocol, mostly exactly one line has arrived.
#[inline(always)]
pub(crate) fn find_end<'a>(bytes: &'a [u8], searched: usize, dialect: &Dialect) -> Option<(&'a [u8], usize)> {
    match bytes.strip_suffix(b"\r\n") {
        Some(content) if !has_line_feed(content.get(searched..).unwrap_or_default()) => {
            Some((content, bytes.len()))
        }
        None if !has_line_feed(bytes.get(searched..).unwrap_or_default()) => None,
        _ => find_end_within(bytes, searched, dialect),
    }
}

#[cold]
fn find_end_within<'a>(bytes: &'a [u8], searched: usize, dialect: &Dialect) -> Option<(&'a [u8], usize)> {
    let mut feeds = bytes.iter().enumerate().skip(searched).filter(|(_, byte)| **byte == b'\n');
    feeds.find_map(|(at, _)| {
        let before = bytes.get(..at)?;
        let content = before.strip_suffix(b"\r").or(dialect.lone_lf.then_some(before))?;
        Some((content, at + 1))
    })
}

/// Returns whether there is a line feed. Sixteen bytes are compared at a time, without a branch for each.
#[inline(always)]
fn has_line_feed(bytes: &[u8]) -> bool {
    let (blocks, rest) = bytes.as_chunks::<16>();
    let has = |block: &[u8; 16]| block.iter().fold(false, |any, byte| any | (*byte == b'\n'));
    blocks.iter().any(has) || rest.contains(&b'\n')
}

#[cfg(test)]
mod tests {
    use std::{string::ToString, vec};

    use super::*;

    #[test]
    fn an_end_is_found_wherever_it_is() {
        for len in 2..40 {
            for at in 1..len {
                for filler in [0u8, 0x0B, 0x8A, 0xFF] {
                    let mut bytes = vec![filler; len];
                    assert_eq!(find_end(&bytes, 0, &Dialect::STRICT), None);
                    bytes[at] = b'\n';
                    assert_eq!(find_end(&bytes, 0, &Dialect::STRICT), None);
                    assert_eq!(find_end(&bytes, 0, &Dialect::TOLERANT), Some((&bytes[..at], at + 1)));
                    bytes[at - 1] = b'\r';
                    for _ in 0..2 {
                        assert_eq!(find_end(&bytes, 0, &Dialect::STRICT), Some((&bytes[..at - 1], at + 1)));
                        assert_eq!(find_end(&bytes, 0, &Dialect::TOLERANT), Some((&bytes[..at - 1], at + 1)));
                        bytes.extend_from_slice(b"\r\n");
                    }
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
