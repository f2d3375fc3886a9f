//! One pose as a line of text.

use robot_session::Encode;

use crate::error::{DecodeError, EncodeError};

/// The byte that requests one pose, ASCII Enquire (§5).
pub const ENQ: u8 = 0x05;

/// A pose for the workstation, as one line:
///
/// ```text
/// $POSE,7,16384,0,0,0,-16384,0,0,0,-16384,12800,-4816,16*30<CR><LF>
///       │ └──────n──────┘ o...     a...     └─────p────┘ └ XOR of the bytes between $ and *, two upper-case hex digits
///       └ counts the packets, 0..=65535, then from 0 again
/// ```
///
/// No blanks, no plus signs, no leading zeros. The sum is made as in NMEA 0183.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
pub struct PosePacket {
    /// Counts the packets that a host has sent.
    pub count: u16,
    /// The transformation from the base to the gripper as VAL II has it, by columns: n, o and a of the rotation, 16384 being
    /// 1.0, and the position in 1/32 mm.
    pub pose: [i16; 12],
}

impl PosePacket {
    /// The longest line.
    pub const MAX_LEN: usize = HEAD.len() + 6 + 12 * 7 + 5;

    /// Reads the line at the start of `bytes`. `None`: more bytes are needed. The second value is the line's length.
    ///
    /// # Errors
    /// The bytes are not such a line; skip to the next `$`.
    #[inline]
    pub fn decode(bytes: &[u8]) -> Result<Option<(Self, usize)>, DecodeError> {
        let mut line = Line { bytes, rest: bytes };
        match line.packet() {
            Ok(packet) => Ok(Some((packet, line.at()))),
            // An error may come from an incomplete line.
            Err(error) => match bytes.get(..Self::MAX_LEN) {
                _ if bytes.iter().take(Self::MAX_LEN).any(|byte| *byte == b'\n') => Err(error),
                Some(_) => Err(DecodeError::TooLong { limit: Self::MAX_LEN }),
                None => Ok(None),
            },
        }
    }

    /// Returns the number of packets that the host has sent between one with the count `last` and this one: this many
    /// were lost. A host that was restarted counts from 0.
    pub const fn lost_since(&self, last: u16) -> u16 {
        self.count.wrapping_sub(last).wrapping_sub(1)
    }

    /// Appends the line.
    ///
    /// # Errors
    /// [`EncodeError::BufferTooSmall`].
    #[cfg(feature = "bytes")]
    pub fn append_to(&self, out: &mut impl bytes::BufMut) -> Result<(), EncodeError> {
        let text = self.text();
        if out.remaining_mut() < text.len {
            return Err(EncodeError::BufferTooSmall { needed: text.len, available: out.remaining_mut() });
        }
        out.put_slice(text.bytes());
        Ok(())
    }

    fn text(&self) -> Text {
        let mut text = Text { bytes: [0; Self::MAX_LEN], len: 0 };
        text.put(HEAD);
        text.put(b",");
        text.number(i32::from(self.count));
        for word in self.pose {
            text.put(b",");
            text.number(i32::from(word));
        }
        let sum = xor(text.bytes().get(1..).unwrap_or_default());
        text.put(&[b'*', hex_digit(sum >> 4), hex_digit(sum & 0xF)]);
        text.put(b"\r\n");
        text
    }
}

impl Encode for PosePacket {
    /// [`EncodeError::BufferTooSmall`].
    type Error = EncodeError;

    fn encoded_len(&self) -> usize {
        self.text().len
    }

    fn encode(&self, out: &mut [u8]) -> Result<usize, EncodeError> {
        let text = self.text();
        let available = out.len();
        let Some(room) = out.get_mut(..text.len) else {
            return Err(EncodeError::BufferTooSmall { needed: text.len, available });
        };
        room.copy_from_slice(text.bytes());
        Ok(text.len)
    }
}

const HEAD: &[u8; 5] = b"$POSE";

/// A line and the bytes after it; `rest` is its unread part.
struct Line<'a> {
    bytes: &'a [u8],
    rest: &'a [u8],
}

impl Line<'_> {
    /// Returns the number of bytes that are read.
    fn at(&self) -> usize {
        self.bytes.len() - self.rest.len()
    }

    #[inline]
    fn packet(&mut self) -> Result<PosePacket, DecodeError> {
        self.expect(HEAD)?;
        let count = self.number()?;
        let mut pose = [0; 12];
        for word in &mut pose {
            *word = self.number()?;
        }
        let expected = xor(self.bytes.get(1..self.at()).unwrap_or_default());
        self.expect(b"*")?;
        let found = 16 * self.hex()? + self.hex()?;
        if found != expected {
            return Err(DecodeError::Checksum { expected, found });
        }
        self.expect(b"\r\n")?;
        Ok(PosePacket { count, pose })
    }

    #[inline(always)]
    fn expect<const N: usize>(&mut self, expected: &[u8; N]) -> Result<(), DecodeError> {
        match self.rest.strip_prefix(expected) {
            Some(rest) => self.rest = rest,
            None => {
                let same = self.rest.iter().zip(expected).take_while(|(byte, expected)| byte == expected);
                return Err(DecodeError::Format { offset: self.at() + same.count() });
            }
        }
        Ok(())
    }

    /// Reads a comma and up to five digits, with or without a minus sign, in exactly the form that `encode` writes.
    #[inline(always)]
    fn number<N: TryFrom<i32>>(&mut self) -> Result<N, DecodeError> {
        // Eight bytes contain all of it and the bytes after it, or more digits than allowed.
        let word = match self.rest.first_chunk() {
            Some(word) => u64::from_le_bytes(*word),
            None => self.rest.iter().rev().fold(0, |word, byte| word << 8 | u64::from(*byte)),
        };
        let found = match word.to_le_bytes() {
            [b',', b'-', ..] => match digits(word >> 16) {
                Some((number @ 1.., count)) => Some((-number, 2 + count)),
                _ => None,
            },
            [b',', ..] => digits(word >> 8).map(|(number, count)| (number, 1 + count)),
            _ => return Err(DecodeError::Format { offset: self.at() }),
        };
        let read =
            found.and_then(|(number, length)| Some((number.try_into().ok()?, self.rest.get(length..)?)));
        let Some((number, rest)) = read else {
            return Err(DecodeError::Number { offset: self.at() + 1 });
        };
        self.rest = rest;
        Ok(number)
    }

    fn hex(&mut self) -> Result<u8, DecodeError> {
        let (digit, rest) = match self.rest {
            [digit @ b'0'..=b'9', rest @ ..] => (digit - b'0', rest),
            [digit @ b'A'..=b'F', rest @ ..] => (digit - b'A' + 10, rest),
            _ => return Err(DecodeError::Format { offset: self.at() }),
        };
        self.rest = rest;
        Ok(digit)
    }
}

/// Returns the number of one to five digits at the beginning of these bytes, without a leading zero, and the number of
/// digits.
#[inline(always)]
fn digits(word: u64) -> Option<(i32, usize)> {
    let digits = word ^ u64::from_le_bytes([b'0'; 8]);
    // Each byte above 9 gets its top bit; the carry into the bytes after the first such one does not matter.
    let others = digits.wrapping_add(u64::from_le_bytes([0x7F - 9; 8])) | digits;
    // Seven, and eight for each digit.
    let end = (others & u64::from_le_bytes([0x80; 8])).trailing_zeros();
    // The last digit becomes the last byte; before the first of five there are zeros.
    let aligned = digits.wrapping_shl(7u32.wrapping_sub(end));
    if aligned & 0xFF_FFFF != 0 || digits & 0xFF == 0 && end != 15 {
        return None;
    }
    // One digit and two pairs of digits, 16 bits each; their sum begins at bit 32. The bits above it are a multiple
    // of four, and so leave its bit 16 alone.
    let pairs = (aligned.wrapping_mul((10 << 8) + 1) >> 24) & 0x00FF_00FF_00FF;
    let sum = pairs.wrapping_mul((10_000 << 32) + (100 << 16) + 1) >> 32 & 0x1_FFFF;
    Some((i32::try_from(sum).ok()?, end as usize / 8))
}

struct Text {
    bytes: [u8; PosePacket::MAX_LEN],
    len: usize,
}

impl Text {
    fn bytes(&self) -> &[u8] {
        self.bytes.get(..self.len).unwrap_or_default()
    }

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

#[inline]
fn xor(bytes: &[u8]) -> u8 {
    let (words, rest) = bytes.as_chunks();
    let sum = words.iter().fold(0, |sum, word| sum ^ u64::from_le_bytes(*word));
    let sum = [32, 16, 8].iter().fold(sum, |sum, half| sum ^ sum >> half);
    let [sum, ..] = sum.to_le_bytes();
    rest.iter().fold(sum, |sum, byte| sum ^ byte)
}

fn hex_digit(nibble: u8) -> u8 {
    match nibble {
        0..=9 => b'0' + nibble,
        _ => b'A' + nibble - 10,
    }
}
