use crate::envelope::check_header;
use crate::error::DecodeError;
use crate::frame::Frame;

/// Bytes in, packets out, also after corrupt bytes. The verbs are those of [`robot_session::Decoder`].
///
/// An error covers everything up to the next packet header, so corruption costs one error and no packet but those it touched. A
/// packet whose checksum fails is searched again from its second byte. An error is therefore given only when that header has
/// come, or after `finish`.
#[derive(Debug, Clone)]
pub struct Decoder {
    buffer: [u8; Self::CAPACITY],
    start: usize,
    end: usize,
    position: u64,
    finished: bool,
}

impl Decoder {
    const CAPACITY: usize = 512;
    /// The longest run of bytes that one error covers: a header after it must fit the buffer.
    const MAX_SKIP: usize = Frame::MAX_LEN;

    /// An empty decoder.
    pub const fn new() -> Self {
        Self { buffer: [0; Self::CAPACITY], start: 0, end: 0, position: 0, finished: false }
    }
}

impl robot_session::Decoder for Decoder {
    type Frame<'a> = Frame<'a>;
    type Error = DecodeError;

    fn push(&mut self, bytes: &[u8]) -> usize {
        if bytes.len() > Self::CAPACITY - self.end {
            self.buffer.copy_within(self.start..self.end, 0);
            self.end -= self.start;
            self.start = 0;
        }
        let free = self.buffer.get_mut(self.end..).unwrap_or_default();
        let taken = bytes.len().min(free.len());
        if let (Some(to), Some(from)) = (free.get_mut(..taken), bytes.get(..taken)) {
            to.copy_from_slice(from);
        }
        self.end += taken;
        self.finished &= taken == 0;
        taken
    }

    fn next_frame(&mut self) -> Option<Result<Frame<'_>, DecodeError>> {
        let pending = self.buffer.get(self.start..self.end)?;
        let (length, error) = next_item(pending, self.finished)?;
        let from = self.start;
        self.start += length;
        self.position += length as u64;
        if let Some(error) = error {
            return Some(Err(error));
        }
        let bytes = self.buffer.get(from..self.start)?;
        Frame::new(bytes.get(3..length - 1)?).map(Ok)
    }

    fn finish(&mut self) {
        self.finished = true;
    }

    fn position(&self) -> u64 {
        self.position
    }

    fn clear(&mut self) {
        self.position += (self.end - self.start) as u64;
        self.start = self.end;
        self.finished = false;
    }
}

impl Default for Decoder {
    fn default() -> Self {
        Self::new()
    }
}

/// The length of the first frame (without error) or of the corrupt bytes before the next header.
fn next_item(bytes: &[u8], finished: bool) -> Option<(usize, Option<DecodeError>)> {
    let error = match Frame::decode(bytes) {
        Ok(Some((_, length))) => return Some((length, None)),
        Ok(None) if !finished || bytes.is_empty() => return None,
        Ok(None) => {
            let n = bytes.first().copied().unwrap_or_default();
            DecodeError::Incomplete { expected: usize::from(n) + Frame::OVERHEAD, found: bytes.len() }
        }
        Err(error) => error,
    };
    let length = corrupt_len(bytes, finished)?;
    Some((
        length,
        Some(match error {
            DecodeError::Header { .. } => DecodeError::Noise { length },
            DecodeError::Incomplete { expected, .. } => DecodeError::Incomplete { expected, found: length },
            error => error,
        }),
    ))
}

/// How far the corruption at the first byte reaches: to the next whole header, or to the end of a finished stream.
fn corrupt_len(bytes: &[u8], finished: bool) -> Option<usize> {
    let next = bytes.windows(3).skip(1).position(|header| check_header(header).is_ok()).map(|at| at + 1);
    match next {
        Some(length) => Some(length.min(Decoder::MAX_SKIP)),
        None if bytes.len() >= Decoder::MAX_SKIP + 3 => Some(Decoder::MAX_SKIP),
        None if finished => Some(bytes.len().min(Decoder::MAX_SKIP)),
        None => None,
    }
}
