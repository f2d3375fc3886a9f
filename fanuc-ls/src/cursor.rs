//! A position in a text that is read byte by byte: the delimiters of a position are ASCII.

use crate::error::Reason;
use crate::text::{Fault, decimal_prefix};

#[derive(Debug, Clone, Copy)]
pub(crate) struct Cursor<'a> {
    text: &'a str,
    rest: &'a [u8],
}

impl<'a> Cursor<'a> {
    pub(crate) fn new(text: &'a str) -> Self {
        Self { text, rest: text.as_bytes() }
    }

    /// Returns the unread text.
    pub(crate) fn rest(self) -> &'a str {
        self.text.get(self.text.len() - self.rest.len()..).unwrap_or("")
    }

    #[inline(always)]
    pub(crate) fn bytes(self) -> &'a [u8] {
        self.rest
    }

    /// Advances by this many bytes, to the beginning of a character.
    #[inline(always)]
    pub(crate) fn advance(&mut self, bytes: usize) {
        self.rest = self.rest.get(bytes..).unwrap_or(&[]);
    }

    /// Returns a fault at the cursor.
    #[cold]
    pub(crate) fn fault(self, reason: Reason) -> Fault<'a> {
        Fault { at: self.rest(), reason }
    }

    /// Moves over spaces, tabs and line ends.
    #[inline(always)]
    pub(crate) fn space(&mut self) {
        // Usually there is no blank: one comparison.
        while let [byte @ ..=b' ', after @ ..] = self.rest
            && matches!(byte, b' ' | b'\t' | b'\r' | b'\n')
        {
            self.rest = after;
        }
    }

    /// Moves over the blanks that put a number into its column.
    #[inline(always)]
    pub(crate) fn columns(&mut self) {
        if let Some(word) = self.rest.first_chunk() {
            let blanks = (u64::from_le_bytes(*word) ^ u64::from_le_bytes([b' '; 8])).trailing_zeros() / 8;
            self.advance(blanks as usize);
        }
        self.space();
    }

    /// Moves over a word, if it is here.
    #[inline(always)]
    pub(crate) fn take(&mut self, word: &str) -> bool {
        let after = self.rest.strip_prefix(word.as_bytes());
        self.rest = after.unwrap_or(self.rest);
        after.is_some()
    }

    /// Moves over blanks and a word.
    ///
    /// # Errors
    /// If it is not here, for this reason.
    #[inline(always)]
    pub(crate) fn expect(&mut self, word: &str, reason: Reason) -> Result<(), Fault<'a>> {
        self.space();
        if self.take(word) { Ok(()) } else { Err(self.fault(reason)) }
    }

    /// Moves over blanks and words, and the blanks after them: at once if they are spelled as controllers print them.
    ///
    /// # Errors
    /// If one of them is not here, for its reason.
    #[inline(always)]
    pub(crate) fn expect_all(&mut self, printed: &str, words: &[(&str, Reason)]) -> Result<(), Fault<'a>> {
        if !self.take(printed) {
            words.iter().try_for_each(|(word, reason)| self.expect(word, *reason))?;
        }
        self.space();
        Ok(())
    }

    /// Reads a whole number without a sign.
    ///
    /// # Errors
    /// If there is no number, or if it does not fit into `N`.
    #[inline(always)]
    pub(crate) fn number<N: TryFrom<u32>>(&mut self, reason: Reason) -> Result<N, Fault<'a>> {
        let (mut rest, mut number) = (self.rest, 0u64);
        while let [digit @ b'0'..=b'9', after @ ..] = rest {
            number = (10 * number + u64::from(digit - b'0')).min(1 << u32::BITS);
            rest = after;
        }
        match u32::try_from(number).ok().and_then(|number| N::try_from(number).ok()) {
            Some(number) if rest.len() < self.rest.len() => {
                self.rest = rest;
                Ok(number)
            }
            _ => Err(self.fault(reason)),
        }
    }

    /// Reads a decimal number.
    ///
    /// # Errors
    /// If there is no number.
    #[inline(always)]
    pub(crate) fn decimal(&mut self, reason: Reason) -> Result<f64, Fault<'a>> {
        let Some((value, length)) = decimal_prefix(self.rest) else { return Err(self.fault(reason)) };
        self.advance(length);
        Ok(value)
    }
}
