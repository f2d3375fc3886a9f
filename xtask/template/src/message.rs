use core::fmt::Write as _;

use robot_session::Encode;

use crate::error::{DecodeError, EncodeError};

/// A line of the link.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
pub enum Message {
    /// `G7`: the host requests the value of a register.
    Get {
        /// The register, 0 to 255.
        register: u8,
    },
    /// `V7=-120`: the device has this value in the register.
    Value {
        /// The register, 0 to 255.
        register: u8,
        /// The value of the register.
        value: i32,
    },
}

impl Message {
    /// The longest line with its line feed: `V255=-2147483648`.
    pub const MAX_LEN: usize = 17;

    /// Reads a line without its line feed.
    ///
    /// # Errors
    /// [`DecodeError::Letter`], [`DecodeError::Number`], [`DecodeError::Separator`].
    pub fn decode(line: &[u8]) -> Result<Self, DecodeError> {
        match line.split_first() {
            Some((b'G', register)) => Ok(Self::Get { register: number(register, 1)? }),
            Some((b'V', fields)) => {
                let separator = fields.iter().position(|byte| *byte == b'=').ok_or(DecodeError::Separator)?;
                let (register, value) = fields.split_at_checked(separator).unwrap_or_default();
                let value = value.get(1..).unwrap_or_default();
                Ok(Self::Value { register: number(register, 1)?, value: number(value, separator + 2)? })
            }
            Some((found, _)) => Err(DecodeError::Letter { found: *found }),
            None => Err(DecodeError::Letter { found: b'\n' }),
        }
    }

    /// Appends the line with its line feed.
    ///
    /// # Errors
    /// [`EncodeError::BufferTooSmall`].
    #[cfg(feature = "bytes")]
    pub fn append_to(&self, out: &mut impl bytes::BufMut) -> Result<(), EncodeError> {
        let line = Line::of(self);
        let (needed, available) = (line.bytes().len(), out.remaining_mut());
        if available < needed {
            return Err(EncodeError::BufferTooSmall { needed, available });
        }
        out.put_slice(line.bytes());
        Ok(())
    }
}

impl Encode for Message {
    /// [`EncodeError::BufferTooSmall`].
    type Error = EncodeError;

    fn encoded_len(&self) -> usize {
        Line::of(self).bytes().len()
    }

    fn encode(&self, out: &mut [u8]) -> Result<usize, EncodeError> {
        let line = Line::of(self);
        let (needed, available) = (line.bytes().len(), out.len());
        let room = out.get_mut(..needed).ok_or(EncodeError::BufferTooSmall { needed, available })?;
        room.copy_from_slice(line.bytes());
        Ok(needed)
    }
}

/// A line while it is written.
struct Line {
    bytes: [u8; Message::MAX_LEN],
    length: usize,
}

impl Line {
    fn of(message: &Message) -> Self {
        let mut line = Self { bytes: [0; Message::MAX_LEN], length: 0 };
        // The longest line fits.
        let _ = match *message {
            Message::Get { register } => writeln!(line, "G{register}"),
            Message::Value { register, value } => writeln!(line, "V{register}={value}"),
        };
        line
    }

    fn bytes(&self) -> &[u8] {
        self.bytes.get(..self.length).unwrap_or_default()
    }
}

impl core::fmt::Write for Line {
    fn write_str(&mut self, text: &str) -> core::fmt::Result {
        let end = self.length + text.len();
        self.bytes.get_mut(self.length..end).ok_or(core::fmt::Error)?.copy_from_slice(text.as_bytes());
        self.length = end;
        Ok(())
    }
}

/// Returns the number of these digits if `encode` would write it so, because a line has one form.
fn number<T: core::str::FromStr>(digits: &[u8], offset: usize) -> Result<T, DecodeError> {
    let unsigned = digits.strip_prefix(b"-").unwrap_or(digits);
    let is_canonical = matches!(unsigned, [b'0'] | [b'1'..=b'9', ..]) && digits != b"-0";
    let text = core::str::from_utf8(digits).ok().filter(|_| is_canonical);
    text.and_then(|text| text.parse().ok()).ok_or(DecodeError::Number { offset })
}
