//! One pose as a line of text.

use robot_session::Encode;

use crate::error::{DecodeError, EncodeError};

/// The byte that asks for one pose, ASCII Enquire (§5).
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
pub struct PosePacket {
    /// Counts the packets that a host has sent.
    pub count: u16,
    /// The transformation from the base to the gripper as VAL II has it, by columns: n, o and a of the rotation, 16384 being
    /// 1.0, and the position in 1/32 mm.
    pub pose: [i16; 12],
}

impl PosePacket {
    /// The longest line.
    pub const MAX_LEN: usize = HEAD.len() + 5 + 12 * 7 + 5;

    /// Reads the line at the start of `bytes`. `None`: more bytes are needed. The second value is the line's length.
    ///
    /// # Errors
    /// When the bytes are no such line; skip to the next `$`.
    pub fn decode(bytes: &[u8]) -> Result<Option<(Self, usize)>, DecodeError> {
        let window = bytes.get(..Self::MAX_LEN).unwrap_or(bytes);
        let Some(end) = window.iter().position(|byte| *byte == b'\n') else {
            return if bytes.len() < Self::MAX_LEN {
                Ok(None)
            } else {
                Err(DecodeError::TooLong { limit: Self::MAX_LEN })
            };
        };
        let mut line = Line { bytes: window.get(..end).unwrap_or_default(), at: 0 };
        line.expect(HEAD)?;
        let offset = line.at;
        let count = u16::try_from(line.number()?).map_err(|_| DecodeError::Number { offset })?;
        let mut pose = [0; 12];
        for word in &mut pose {
            line.expect(b",")?;
            let offset = line.at;
            *word = i16::try_from(line.number()?).map_err(|_| DecodeError::Number { offset })?;
        }
        let expected = xor(line.bytes.get(1..line.at).unwrap_or_default());
        line.expect(b"*")?;
        let found = 16 * line.hex()? + line.hex()?;
        if found != expected {
            return Err(DecodeError::Checksum { expected, found });
        }
        line.expect(b"\r")?;
        if line.at == end {
            Ok(Some((Self { count, pose }, end + 1)))
        } else {
            Err(DecodeError::Format { offset: line.at })
        }
    }

    /// How many packets the host has sent between one with the count `last` and this one: so many were lost. A host that was
    /// restarted counts from 0.
    pub const fn lost_since(&self, last: u16) -> u16 {
        self.count.wrapping_sub(last).wrapping_sub(1)
    }

    /// Appends the line; the bytes written.
    ///
    /// # Errors
    /// [`EncodeError::BufferTooSmall`].
    #[cfg(feature = "bytes")]
    pub fn append_to(&self, out: &mut impl bytes::BufMut) -> Result<usize, EncodeError> {
        let text = self.text();
        if out.remaining_mut() < text.len {
            return Err(EncodeError::BufferTooSmall { needed: text.len, available: out.remaining_mut() });
        }
        out.put_slice(text.bytes());
        Ok(text.len)
    }

    fn text(&self) -> Text {
        let mut text = Text { bytes: [0; Self::MAX_LEN], len: 0 };
        text.put(HEAD);
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

const HEAD: &[u8] = b"$POSE,";

struct Line<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Line<'_> {
    fn expect(&mut self, expected: &[u8]) -> Result<(), DecodeError> {
        for byte in expected {
            if self.bytes.get(self.at) != Some(byte) {
                return Err(DecodeError::Format { offset: self.at });
            }
            self.at += 1;
        }
        Ok(())
    }

    /// Up to five digits, after a minus sign or not, written in the one way that `encode` has.
    fn number(&mut self) -> Result<i32, DecodeError> {
        let offset = self.at;
        let negative = self.bytes.get(offset) == Some(&b'-');
        let first = offset + usize::from(negative);
        let (mut at, mut number) = (first, 0);
        while let Some(digit @ b'0'..=b'9') = self.bytes.get(at)
            && at <= first + 5
        {
            number = 10 * number + i32::from(digit - b'0');
            at += 1;
        }
        let count = at - first;
        let is_plain =
            if self.bytes.get(first) == Some(&b'0') { count == 1 && !negative } else { count <= 5 };
        if count == 0 || !is_plain {
            return Err(DecodeError::Number { offset });
        }
        self.at = at;
        Ok(if negative { -number } else { number })
    }

    fn hex(&mut self) -> Result<u8, DecodeError> {
        let digit = match self.bytes.get(self.at) {
            Some(digit @ b'0'..=b'9') => digit - b'0',
            Some(digit @ b'A'..=b'F') => digit - b'A' + 10,
            _ => return Err(DecodeError::Format { offset: self.at }),
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

fn xor(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0, |sum, byte| sum ^ byte)
}

fn hex_digit(nibble: u8) -> u8 {
    match nibble {
        0..=9 => b'0' + nibble,
        _ => b'A' + nibble - 10,
    }
}
