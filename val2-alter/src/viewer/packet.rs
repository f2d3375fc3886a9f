//! One pose as a line of text.

use crate::{EncodeError, Transform};

/// A pose for the workstation, as one line:
///
/// ```text
/// $POSE,7,16384,0,0,0,-16384,0,0,0,-16384,12800,-4816,16*30<CR><LF>
///       │ └──────n──────┘ o...     a...     └─────p────┘ └ XOR of the bytes between $ and *, two upper-case hex digits
///       └ counts the packets, 0..=65535, then from 0 again
/// ```
///
/// The twelve integers are the words of a transformation by columns: the
/// columns n, o, a of the rotation, 16384 being 1.0, then the position in 1/32 mm. No blanks, no plus signs, no leading
/// zeros. The sum is made as in NMEA 0183.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PosePacket {
    /// Counts the packets of a feed: a gap shows that one was lost.
    pub count: u16,
    /// The pose.
    pub pose: Transform,
}

impl PosePacket {
    /// The longest line.
    pub const MAX_LEN: usize = HEAD.len() + 5 + 12 * 7 + 5;

    /// Reads the line at the start of `bytes`. `None`: more bytes are needed. The second value is the line's length.
    ///
    /// # Errors
    /// When the bytes are no such line; skip to the next `$`.
    pub fn decode(bytes: &[u8]) -> Result<Option<(Self, usize)>, ViewerError> {
        let window = bytes.get(..Self::MAX_LEN).unwrap_or(bytes);
        let Some(end) = window.iter().position(|byte| *byte == b'\n') else {
            return if bytes.len() < Self::MAX_LEN {
                Ok(None)
            } else {
                Err(ViewerError::TooLong { limit: Self::MAX_LEN })
            };
        };
        let mut line = Line { bytes: window.get(..end).unwrap_or_default(), at: 0 };
        line.expect(HEAD)?;
        let count = line.number()?;
        let count = u16::try_from(count).map_err(|_| ViewerError::Number { offset: HEAD.len() })?;
        let mut words = [0; 12];
        for word in &mut words {
            line.expect(b",")?;
            let offset = line.at;
            *word = i16::try_from(line.number()?).map_err(|_| ViewerError::Number { offset })?;
        }
        let summed = line.bytes.get(1..line.at).unwrap_or_default();
        let expected = xor(summed);
        line.expect(b"*")?;
        let found = 16 * line.hex()? + line.hex()?;
        if found != expected {
            return Err(ViewerError::Checksum { expected, found });
        }
        line.expect(b"\r")?;
        if line.at == end {
            Ok(Some((Self { count, pose: Transform(words) }, end + 1)))
        } else {
            Err(ViewerError::Format { offset: line.at })
        }
    }

    /// Writes the line and returns its length.
    ///
    /// # Errors
    /// [`EncodeError::BufferTooSmall`]: `out` has room for less than the line.
    pub fn encode(&self, out: &mut [u8]) -> Result<usize, EncodeError> {
        let mut line = Text { bytes: [0; Self::MAX_LEN], len: 0 };
        line.put(HEAD);
        line.number(i32::from(self.count));
        for word in self.pose.0 {
            line.put(b",");
            line.number(i32::from(word));
        }
        let sum = xor(line.bytes.get(1..line.len).unwrap_or_default());
        line.put(&[b'*', hex_digit(sum >> 4), hex_digit(sum & 0xF)]);
        line.put(b"\r\n");
        let (needed, available) = (line.len, out.len());
        match (out.get_mut(..needed), line.bytes.get(..needed)) {
            (Some(room), Some(bytes)) => {
                room.copy_from_slice(bytes);
                Ok(needed)
            }
            _ => Err(EncodeError::BufferTooSmall { needed, available }),
        }
    }
}

/// A line that is no [`PosePacket`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "kind", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum ViewerError {
    /// Something else stands where the format has a fixed byte.
    #[error("byte {offset} of the line is not what the format has there")]
    Format {
        /// The place in the line.
        offset: usize,
    },
    /// No number, or one outside its range: 0..=65535 for the count, −32768..=32767 for a word.
    #[error("the number at byte {offset} of the line is missing or out of range")]
    Number {
        /// Where the number begins.
        offset: usize,
    },
    /// The sum is wrong.
    #[error("checksum is {found:#04x}, the line gives {expected:#04x}")]
    Checksum {
        /// What the line gives.
        expected: u8,
        /// What it says.
        found: u8,
    },
    /// No end of line where one must be.
    #[error("line has more than {limit} bytes")]
    TooLong {
        /// The longest line.
        limit: usize,
    },
}

const HEAD: &[u8] = b"$POSE,";

struct Line<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Line<'_> {
    fn expect(&mut self, wanted: &[u8]) -> Result<(), ViewerError> {
        for byte in wanted {
            if self.bytes.get(self.at) != Some(byte) {
                return Err(ViewerError::Format { offset: self.at });
            }
            self.at += 1;
        }
        Ok(())
    }

    /// Up to five digits, behind a minus sign or not, written in the one way that `encode` has.
    fn number(&mut self) -> Result<i32, ViewerError> {
        let offset = self.at;
        let rest = self.bytes.get(self.at..).unwrap_or_default();
        let (negative, digits) = match rest {
            [b'-', digits @ ..] => (true, digits),
            digits => (false, digits),
        };
        let count = digits.iter().take_while(|byte| byte.is_ascii_digit()).count();
        let digits = digits.get(..count).unwrap_or_default();
        let plain = match digits {
            [] => false,
            [b'0'] => !negative,
            [b'0', ..] => false,
            _ => count <= 5,
        };
        if !plain {
            return Err(ViewerError::Number { offset });
        }
        self.at += count + usize::from(negative);
        let number = digits.iter().fold(0, |number, digit| 10 * number + i32::from(digit - b'0'));
        Ok(if negative { -number } else { number })
    }

    fn hex(&mut self) -> Result<u8, ViewerError> {
        let digit = match self.bytes.get(self.at) {
            Some(digit @ b'0'..=b'9') => digit - b'0',
            Some(digit @ b'A'..=b'F') => digit - b'A' + 10,
            _ => return Err(ViewerError::Format { offset: self.at }),
        };
        self.at += 1;
        Ok(digit)
    }
}

struct Text {
    bytes: [u8; PosePacket::MAX_LEN],
    len: usize,
}

impl Text {
    fn put(&mut self, bytes: &[u8]) {
        let end = self.len + bytes.len();
        if let Some(room) = self.bytes.get_mut(self.len..end) {
            room.copy_from_slice(bytes);
            self.len = end;
        }
    }

    fn number(&mut self, number: i32) {
        if number < 0 {
            self.put(b"-");
        }
        let number = number.unsigned_abs();
        let mut power = 10_000;
        while power > 1 && number < power {
            power /= 10;
        }
        while power > 0 {
            let digit = u8::try_from(number / power % 10).unwrap_or_default();
            self.put(&[b'0' + digit]);
            power /= 10;
        }
    }
}

fn xor(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0, |sum, byte| sum ^ byte)
}

fn hex_digit(value: u8) -> u8 {
    if value < 10 { b'0' + value } else { b'A' + value - 10 }
}
