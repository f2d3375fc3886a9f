use crate::error::DecodeError;
use crate::message::PosePacket;

/// Bytes in, poses out, also after corrupt bytes. The verbs are those of [`robot_session::Decoder`].
///
/// A line begins with `$`, which is nowhere else in it, and ends with its line feed. An error covers a whole line, or everything
/// up to the next `$`: corruption costs no packet but those it touched.
#[derive(Debug, Clone)]
pub struct Decoder {
    buffer: [u8; Self::CAPACITY],
    start: usize,
    end: usize,
    position: u64,
    finished: bool,
}

impl Decoder {
    const CAPACITY: usize = 256;

    /// An empty decoder.
    pub const fn new() -> Self {
        Self { buffer: [0; Self::CAPACITY], start: 0, end: 0, position: 0, finished: false }
    }
}

impl robot_session::Decoder for Decoder {
    type Frame<'a> = PosePacket;
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

    fn next_frame(&mut self) -> Option<Result<PosePacket, DecodeError>> {
        let pending = self.buffer.get(self.start..self.end)?;
        let (length, item) = next_item(pending, self.finished)?;
        self.start += length;
        self.position += length as u64;
        Some(item)
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

/// The first line, or what there is instead up to where one may begin, and its length.
fn next_item(bytes: &[u8], finished: bool) -> Option<(usize, Result<PosePacket, DecodeError>)> {
    let is_line = *bytes.first()? == b'$';
    let window = bytes.get(..PosePacket::MAX_LEN).unwrap_or(bytes);
    let is_end = |(at, byte): (usize, &u8)| *byte == b'\n' || *byte == b'$' && at > 0;
    let length = match window.iter().enumerate().position(is_end) {
        Some(at) if window.get(at) == Some(&b'\n') => {
            let length = at + 1;
            let item = match PosePacket::decode(window.get(..length)?) {
                Ok(Some((packet, _))) => Ok(packet),
                Ok(None) => Err(DecodeError::Format { offset: length }),
                Err(error) => Err(error),
            };
            return Some((length, item));
        }
        Some(at) => at,
        None if window.len() == PosePacket::MAX_LEN && is_line => {
            let limit = PosePacket::MAX_LEN;
            return Some((limit, Err(DecodeError::TooLong { limit })));
        }
        None if window.len() == PosePacket::MAX_LEN || finished => window.len(),
        None => return None,
    };
    let error = if is_line { DecodeError::Incomplete { length } } else { DecodeError::Noise { length } };
    Some((length, Err(error)))
}
