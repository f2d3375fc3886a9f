//! `<name$header$…$length#field$field$…#>`

use crate::error::{DecodeError, EncodeError};
use crate::frame::{Frame, Progress, Writer, Written};
use crate::value::{Charset, START, Value, Values};

/// One message: what it is called, and its values.
///
/// ```
/// use kawasaki_msg::{Charset, Message, Value};
///
/// let start = Message::new("TilausAlkaa", &[Value::Number(50), Value::Number(1)]);
/// let mut wire = [0; 64];
/// let length = start.encode(Charset::Ascii, &mut wire)?;
/// assert_eq!(&wire[..length], b"<TilausAlkaa$4#50$1#>");
///
/// let (message, used) = Message::decode(&wire[..length], Charset::Ascii)?.expect("it is whole");
/// assert_eq!((message, used), (start, length));
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Message<'a> {
    /// What the message is called; never empty on the wire.
    pub name: Value<'a>,
    /// What is between the name and the length. The source shows none and allows them; they are kept.
    pub header: Values<'a>,
    /// The values of the data part. No value and one empty value are the same bytes; both decode to no value.
    pub fields: Values<'a>,
}

impl<'a> Message<'a> {
    /// The most bytes that a message can have: those of the longest packet (thesis, section 9.5).
    pub const MAX_LEN: usize = 4096;

    /// A message to send, with nothing between name and length.
    pub const fn new(name: &'a str, fields: &'a [Value<'a>]) -> Self {
        Self { name: Value::Text(name), header: Values::NONE, fields: Values::List(fields) }
    }

    /// Reads the message that begins with the first byte, and says how many bytes it took. `None` means that more bytes
    /// are needed; [`Self::MAX_LEN`] bytes are always enough.
    ///
    /// The length counts the bytes between the two `#`, `$` included (thesis, sections 10.1 and 10.3). Blanks around it
    /// are allowed. None of the marks may stand in a value, also where the length would cover it: such a message has
    /// swallowed its neighbour.
    ///
    /// # Errors
    /// The first corruption, with its place in `bytes`. Look for the next `<` after the first byte.
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

    /// The message of a frame that these bytes begin with.
    #[inline]
    pub(crate) fn of(frame: Frame, bytes: &'a [u8]) -> Self {
        let (name, header, data) = frame.parts(bytes);
        let fields = if data.is_empty() { Values::NONE } else { Values::Wire(data) };
        Self { name: Value::Wire(name), header: header.map_or(Values::NONE, Values::Wire), fields }
    }

    /// Writes the message and gives its length: no blanks, no sign but `-`.
    ///
    /// # Errors
    /// See [`EncodeError`]; nothing of use is in `out` then.
    pub fn encode(&self, charset: Charset, out: &mut [u8]) -> Result<usize, EncodeError> {
        if self.name.is_empty() {
            return Err(EncodeError::NoName);
        }
        let written = self.write(charset, out);
        let length = written.fit(Self::MAX_LEN)?;
        written.error.map_or(Ok(length), Err)
    }

    /// How many bytes [`encode`](Self::encode) writes.
    pub fn encoded_len(&self) -> usize {
        self.write(Charset::Latin1, &mut []).length
    }

    fn write(&self, charset: Charset, out: &mut [u8]) -> Written {
        let header = |writer: &mut Writer<'_>| {
            writer.value(&self.name);
            self.header.iter().for_each(|value| writer.value(&value));
        };
        Frame::encode(out, charset, header, |writer| {
            self.fields.iter().for_each(|value| writer.value(&value))
        })
    }

    /// Appends the message to a growing buffer.
    ///
    /// # Errors
    /// See [`EncodeError`]; the buffer is as it was then.
    #[cfg(feature = "bytes")]
    pub fn append_to(&self, charset: Charset, out: &mut impl bytes::BufMut) -> Result<(), EncodeError> {
        let mut wire = [0; Self::MAX_LEN];
        let length = self.encode(charset, &mut wire)?;
        if length > out.remaining_mut() {
            return Err(EncodeError::BufferTooSmall { needed: length, available: out.remaining_mut() });
        }
        out.put_slice(wire.get(..length).unwrap_or_default());
        Ok(())
    }
}

/// A message and the character set that it is to be written in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct InCharset<'a>(pub Message<'a>, pub Charset);

impl robot_session::Encode for InCharset<'_> {
    type Error = EncodeError;

    fn encoded_len(&self) -> usize {
        self.0.encoded_len()
    }

    fn encode(&self, out: &mut [u8]) -> Result<usize, EncodeError> {
        self.0.encode(self.1, out)
    }
}
