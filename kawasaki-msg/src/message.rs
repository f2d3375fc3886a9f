//! `<name$header$…$length#field$field$…#>`

use crate::error::{DecodeError, EncodeError};
use crate::frame::{Frame, MAX_LEN, Progress};
use crate::marks::START;
use crate::value::{Charset, Value, Values};
use crate::writer::Writer;

/// One message as it is on the wire; a [`Writer`] makes the bytes of another.
///
/// ```
/// use kawasaki_msg::{Charset, Message};
///
/// let wire = b"<TilausAlkaa$4#50$1#>";
/// let (message, used) = Message::decode(wire, Charset::Ascii)?.expect("it is whole");
/// assert!(message.name == "TilausAlkaa" && used == wire.len());
/// let fields: Vec<String> = message.fields.iter().map(|field| field.to_string()).collect();
/// assert_eq!(fields, ["50", "1"]);
/// # Ok::<(), kawasaki_msg::DecodeError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Message<'a> {
    /// The name; not empty.
    pub name: Value<'a>,
    /// The values between the name and the length. The source shows none and allows them; they are stored.
    pub header: Values<'a>,
    /// The values of the data part. No value and one empty value are the same bytes, which are read as no value.
    pub fields: Values<'a>,
}

impl<'a> Message<'a> {
    /// The maximum number of bytes of a message: those of the longest packet (thesis, section 9.5).
    pub const MAX_LEN: usize = MAX_LEN;

    /// Reads the message that begins with the first byte; returns it, and the number of its bytes. `None`: more bytes are
    /// needed; [`Self::MAX_LEN`] bytes are always enough.
    ///
    /// The length counts the bytes between the two `#`, `$` included (thesis, sections 10.1 and 10.3). Blanks around it are
    /// allowed. A value must not contain a mark, even if the length covers it: such a message has swallowed its neighbour.
    ///
    /// # Errors
    /// The first corruption, with its offset in `bytes`. Look for the next `<` after the first byte.
    pub fn decode(bytes: &'a [u8], charset: Charset) -> Result<Option<(Self, usize)>, DecodeError> {
        let bytes = bytes.get(..Self::MAX_LEN).unwrap_or(bytes);
        match bytes.first() {
            None => return Ok(None),
            Some(&START) => {}
            Some(_) => {
                let length = bytes.iter().take_while(|byte| **byte != START).count();
                return Err(DecodeError::Garbage { offset: 0, length });
            }
        }
        let mut progress = Progress::NONE;
        let frame = Frame::decode(bytes, charset, Self::MAX_LEN, &mut progress)?;
        Ok(frame.map(|frame| (Self::of(frame, bytes), frame.len())))
    }

    /// Returns the message of a frame at the beginning of these bytes.
    #[inline(always)]
    pub(crate) fn of(frame: Frame, bytes: &'a [u8]) -> Self {
        let (name, header, fields) = frame.parts(bytes);
        Self { name, header, fields }
    }

    fn write<'o>(&self, out: &'o mut [u8]) -> Writer<'o> {
        let mut writer = Writer::named(out, self.name.as_bytes());
        self.header.iter().for_each(|value| writer.wire(value.as_bytes()));
        writer.data();
        self.fields.iter().for_each(|value| writer.wire(value.as_bytes()));
        writer
    }

    /// Appends the message to a growing buffer, as [`encode`](robot_session::Encode::encode) writes it.
    ///
    /// # Errors
    /// The buffer cannot grow as far; it is then unchanged.
    #[cfg(feature = "bytes")]
    pub fn append_to(&self, out: &mut impl bytes::BufMut) -> Result<(), EncodeError> {
        let mut wire = [0; Self::MAX_LEN];
        let length = robot_session::Encode::encode(self, &mut wire)?;
        if length > out.remaining_mut() {
            return Err(EncodeError::BufferTooSmall { needed: length, available: out.remaining_mut() });
        }
        out.put_slice(wire.get(..length).unwrap_or_default());
        Ok(())
    }
}

/// Writes the length without blanks.
impl robot_session::Encode for Message<'_> {
    type Error = EncodeError;

    fn encoded_len(&self) -> usize {
        self.write(&mut []).end()
    }

    fn encode(&self, out: &mut [u8]) -> Result<usize, EncodeError> {
        self.write(out).finish()
    }
}
