//! Hex digits with comments.

use anyhow::{Context, Result};

const HINT: &str = "use --format hexdump for lines with offsets, --format raw for binary input";
const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

/// Reads hex that may be split anywhere, as `EB 90`, `eb90` or `0xEB, 0x90`, also after a byte order mark.
pub(in crate::command) struct HexReader {
    high: Option<u8>,
    comment: bool,
    line: usize,
    /// How much of a byte order mark may still come.
    mark: &'static [u8],
}

impl Default for HexReader {
    fn default() -> Self {
        Self { high: None, comment: false, line: 1, mark: BYTE_ORDER_MARK }
    }
}

impl HexReader {
    pub(in crate::command) fn read(&mut self, text: &[u8]) -> Result<Vec<u8>> {
        let mut bytes = Vec::with_capacity(text.len() / 2);
        for &c in text {
            match (c, self.mark) {
                (c, [first, rest @ ..]) if c == *first => {
                    self.mark = rest;
                    continue;
                }
                _ => self.mark = &[],
            }
            match c {
                b'\n' => {
                    self.line += 1;
                    self.comment = false;
                }
                _ if self.comment => {}
                b'#' => self.comment = true,
                b' ' | b'\t' | b'\r' | b',' => {}
                b'x' | b'X' if self.high == Some(0) => self.high = None,
                _ => {
                    let digit =
                        char::from(c).to_digit(16).and_then(|d| u8::try_from(d).ok()).with_context(|| {
                            format!(
                                "line {}: `{}` is not a hex digit; {HINT}",
                                self.line,
                                char::from(c).escape_default()
                            )
                        })?;
                    match self.high.take() {
                        None => self.high = Some(digit),
                        Some(high) => bytes.push(high << 4 | digit),
                    }
                }
            }
        }
        Ok(bytes)
    }

    pub(in crate::command) fn finish(&self) -> Result<()> {
        anyhow::ensure!(
            self.high.is_none(),
            "the input ends in the middle of a byte: an odd number of hex digits"
        );
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hex_may_be_cut_anywhere() {
        let text = b"\xef\xbb\xbf3C 0x54,\n# a comment 00\n 6 9";
        for cut in 0..text.len() {
            let mut hex = HexReader::default();
            let mut bytes = hex.read(&text[..cut]).unwrap();
            bytes.extend(hex.read(&text[cut..]).unwrap());
            hex.finish().unwrap();
            assert_eq!(bytes, [0x3C, 0x54, 0x69]);
        }
    }

    #[test]
    fn an_error_names_the_character_and_its_line() {
        let error = HexReader::default().read(b"00\n0G").unwrap_err();
        assert_eq!(error.to_string(), format!("line 2: `G` is not a hex digit; {HINT}"));
        let mut hex = HexReader::default();
        hex.read(b"00 1").unwrap();
        assert!(hex.finish().is_err());
    }
}
