//! `<name$header$…$length#field$field$…#>`

use crate::error::{DecodeError, EncodeError};
use crate::number::{self, Digits};
use crate::value::{Charset, DATA, END, SEPARATOR, START, Value, Values};

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

    /// A message of ours, with nothing between name and length.
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
        match Self::usual(bytes, charset) {
            None => Self::decode_within(bytes, charset, Self::MAX_LEN),
            found => Ok(found),
        }
    }

    /// As [`decode`](Self::decode), of at most so many bytes.
    pub(crate) fn decode_within(
        bytes: &'a [u8],
        charset: Charset,
        limit: usize,
    ) -> Result<Option<(Self, usize)>, DecodeError> {
        let bytes = bytes.get(..limit).unwrap_or(bytes);
        match Self::parse(bytes, charset, limit) {
            Ok(found) => Ok(Some(found)),
            Err(Stop::More) if bytes.len() == limit => Err(DecodeError::TooLong { offset: 0, limit }),
            Err(Stop::More) => Ok(None),
            Err(Stop::Corrupt(error)) => Err(error),
        }
    }

    /// A message as most are: a name, a length of one or two digits, and data. `None` for what [`parse`](Self::parse) finds, or finds wrong.
    #[inline(always)]
    pub(crate) fn usual(bytes: &'a [u8], charset: Charset) -> Option<(Self, usize)> {
        let [START, rest @ ..] = bytes else { return None };
        let mut name = 0;
        while let Some(byte) = rest.get(name)
            && *byte != SEPARATOR
        {
            if charset.ends_text(*byte) {
                return None;
            }
            name += 1;
        }
        let (name, rest) = rest.split_at_checked(name)?;
        let digit = |byte: u8| usize::from(byte - b'0');
        let (digits, length, rest) = match rest {
            [SEPARATOR, tens @ b'0'..=b'9', ones @ b'0'..=b'9', DATA, rest @ ..] => {
                (2, 10 * digit(*tens) + digit(*ones), rest)
            }
            [SEPARATOR, ones @ b'0'..=b'9', DATA, rest @ ..] => (1, digit(*ones), rest),
            _ => return None,
        };
        let (data, [DATA, END, ..]) = rest.split_at_checked(length)? else { return None };
        if name.is_empty() || data.is_empty() || !charset.is_text(data) {
            return None;
        }
        let message = Message { name: Value::Wire(name), header: Values::NONE, fields: Values::Wire(data) };
        Some((message, "<$##>".len() + name.len() + digits + data.len()))
    }

    /// The grammar: `< name $ header $ length # data # >`. The message, and where it ends.
    fn parse(input: &'a [u8], charset: Charset, limit: usize) -> Result<(Self, usize), Stop> {
        mark(input, 0, START)?;
        let data_at = charset.text_end(input, 1).ok_or(Stop::More)?;
        mark(input, data_at, DATA)?;
        let header = input.get(1..data_at).unwrap_or_default();
        let head = Head::read(header, limit).map_err(|error| Stop::Corrupt(error.moved(1)))?;
        let rest = input.get(head.data..).unwrap_or_default();
        if let Some((data, [DATA, END, ..])) = rest.split_at_checked(head.end - head.data)
            && charset.is_text(data)
        {
            return Ok((head.message(header, data), head.len()));
        }
        Err(head.lacks(input, charset))
    }

    /// Writes the message and gives its length: no blanks, no sign but `-`.
    ///
    /// # Errors
    /// See [`EncodeError`]; nothing of use is in `out` then.
    pub fn encode(&self, charset: Charset, out: &mut [u8]) -> Result<usize, EncodeError> {
        if self.name.is_empty() {
            return Err(EncodeError::NoName);
        }
        let data = self.fields.wire_len();
        let (needed, available) = (self.len_with(data), out.len());
        if needed > Self::MAX_LEN {
            return Err(EncodeError::TooLong { length: needed, limit: Self::MAX_LEN });
        }
        if needed > available {
            return Err(EncodeError::BufferTooSmall { needed, available });
        }
        let mut writer = Writer { out, length: 0 };
        writer.message(self, data, charset)?;
        Ok(writer.length)
    }

    /// How many bytes [`encode`](Self::encode) writes.
    pub fn encoded_len(&self) -> usize {
        self.len_with(self.fields.wire_len())
    }

    fn len_with(&self, data: usize) -> usize {
        let header: usize = self.header.iter().map(|value| value.wire_len() + 1).sum();
        self.name.wire_len() + header + number::len(decimal(data)) + data + "<$##>".len()
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

/// What the bytes before a data part say: where the parts of the message are in it, from its `<` on.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Head {
    /// Where the name ends.
    name: usize,
    /// Where the header ends: at the `$` before the length.
    header: usize,
    /// Where the data part begins, and where it has to end: at its second `#`.
    pub(crate) data: usize,
    pub(crate) end: usize,
}

impl Head {
    /// How many bytes its message has.
    pub(crate) fn len(&self) -> usize {
        self.end + "#>".len()
    }

    /// Reads `name $ header $ length`: the last value is the length, what is before it is kept (thesis, section 10.1).
    #[inline(always)]
    pub(crate) fn read(bytes: &[u8], limit: usize) -> Result<Self, DecodeError> {
        let digit = |byte: u8| usize::from(byte - b'0');
        let (last, length) = match *bytes {
            [ref rest @ .., SEPARATOR, ones @ b'0'..=b'9'] => (rest.len(), digit(ones)),
            [ref rest @ .., SEPARATOR, tens @ b'0'..=b'9', ones @ b'0'..=b'9'] => {
                (rest.len(), 10 * digit(tens) + digit(ones))
            }
            _ => Self::length(bytes)?,
        };
        let name = bytes.iter().position(|byte| *byte == SEPARATOR).unwrap_or(last);
        if name == 0 {
            return Err(DecodeError::NoName { offset: 0 });
        }
        let data = bytes.len() + "<#".len();
        if data + length + "#>".len() > limit {
            return Err(DecodeError::TooLong { offset: 0, limit });
        }
        Ok(Self { name: 1 + name, header: 1 + last, data, end: data + length })
    }

    /// Where the `$` before any length is, and the length.
    #[inline(never)]
    fn length(bytes: &[u8]) -> Result<(usize, usize), DecodeError> {
        let no_length = |offset| DecodeError::NoLength { offset };
        let last = bytes.iter().rposition(|byte| *byte == SEPARATOR).ok_or(no_length(bytes.len()))?;
        let length = bytes.get(last + 1..).and_then(number::parse);
        let length = length.and_then(|n| usize::try_from(n).ok()).ok_or(no_length(last + 1))?;
        Ok((last, length))
    }

    /// Its message, of which these are the header and the data part.
    #[inline(always)]
    fn message<'a>(&self, header: &'a [u8], data: &'a [u8]) -> Message<'a> {
        let name = header.get(..self.name - 1).unwrap_or_default();
        let values = header.get(self.name..self.header - 1).map_or(Values::NONE, Values::Wire);
        let fields = if data.is_empty() { Values::NONE } else { Values::Wire(data) };
        Message { name: Value::Wire(name), header: values, fields }
    }

    /// Its message, which these bytes begin with.
    pub(crate) fn whole<'a>(&self, bytes: &'a [u8]) -> Message<'a> {
        let part = |range| bytes.get(range).unwrap_or_default();
        self.message(part(1..self.data - 1), part(self.data..self.end))
    }

    /// Why its message is not whole.
    #[cold]
    fn lacks(&self, input: &[u8], charset: Charset) -> Stop {
        let Some(end) = charset.text_end(input, self.data) else { return Stop::More };
        let length = || {
            let (expected, found) = (self.end - self.data, end - self.data);
            let error = DecodeError::Length { offset: self.data, expected, found };
            if found == expected { Ok(()) } else { Err(Stop::Corrupt(error)) }
        };
        let lacks = mark(input, end, DATA).and_then(|()| length()).and_then(|()| mark(input, end + 1, END));
        lacks.err().unwrap_or(Stop::More)
    }
}

/// Why there is no message.
enum Stop {
    /// It is not whole.
    More,
    Corrupt(DecodeError),
}

/// A mark at this place. A wrong byte there says what the corruption is.
#[inline(always)]
fn mark(input: &[u8], at: usize, expected: u8) -> Result<(), Stop> {
    match input.get(at) {
        None => Err(Stop::More),
        Some(found) if *found == expected => Ok(()),
        Some(found) => Err(Stop::Corrupt(no_mark(input, at, expected, *found))),
    }
}

#[cold]
fn no_mark(input: &[u8], offset: usize, expected: u8, found: u8) -> DecodeError {
    match (expected, found) {
        (START, _) => {
            let length = input.iter().take_while(|byte| **byte != START).count();
            DecodeError::Garbage { offset, length }
        }
        (_, START) => DecodeError::Mark { offset, found },
        (END, _) => DecodeError::NoEndMark { offset, found },
        (_, END | DATA) => DecodeError::Mark { offset, found },
        _ => DecodeError::NotAscii { offset, found },
    }
}

/// Writes one message into a buffer that is long enough.
struct Writer<'o> {
    out: &'o mut [u8],
    length: usize,
}

impl Writer<'_> {
    /// `data` is the length of the data part.
    fn message(&mut self, message: &Message<'_>, data: usize, charset: Charset) -> Result<(), EncodeError> {
        self.push(START);
        self.value(&message.name, charset)?;
        for value in message.header.iter() {
            self.push(SEPARATOR);
            self.value(&value, charset)?;
        }
        self.push(SEPARATOR);
        self.number(decimal(data));
        self.push(DATA);
        for (i, value) in message.fields.iter().enumerate() {
            if i > 0 {
                self.push(SEPARATOR);
            }
            self.value(&value, charset)?;
        }
        self.push(DATA);
        self.push(END);
        Ok(())
    }

    fn value(&mut self, value: &Value<'_>, charset: Charset) -> Result<(), EncodeError> {
        match value {
            Value::Number(number) => self.number(*number),
            Value::Text(text) => {
                for c in text.chars() {
                    self.push(charset.byte(c)?);
                }
            }
            Value::Wire(bytes) => {
                for byte in *bytes {
                    self.push(charset.byte(char::from(*byte))?);
                }
            }
        }
        Ok(())
    }

    fn number(&mut self, number: i32) {
        self.put(Digits::new(number).as_bytes());
    }

    fn put(&mut self, bytes: &[u8]) {
        let end = self.length + bytes.len();
        if let Some(place) = self.out.get_mut(self.length..end) {
            place.copy_from_slice(bytes);
            self.length = end;
        }
    }

    fn push(&mut self, byte: u8) {
        if let Some(place) = self.out.get_mut(self.length) {
            *place = byte;
            self.length += 1;
        }
    }
}

/// A length as a number to write.
fn decimal(length: usize) -> i32 {
    i32::try_from(length).unwrap_or(i32::MAX)
}
