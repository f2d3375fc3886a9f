//! A stream of bytes in, messages out, whatever the reads and the string elements cut.

use crate::error::DecodeError;
use crate::message::Message;
use crate::value::{Charset, START};

/// Finds the messages in a stream of bytes.
///
/// Call [`push`](Self::push) with what was read, then [`next_message`](Self::next_message) until it gives `None`, and push
/// the rest. A message may be cut anywhere and by as many reads as it likes. An error costs the bytes up to the next `<`,
/// and nothing before or behind them. Holds one message of the greatest length and never more.
///
/// ```
/// use kawasaki_msg::{Charset, Decoder};
///
/// let mut decoder = Decoder::new(Charset::Ascii);
/// assert_eq!(decoder.push(b"<TilausKuit"), 11);
/// assert!(decoder.next_message().is_none());
/// decoder.push(b"taus$2#50#>");
/// assert_eq!(decoder.next_message().unwrap().unwrap().name, "TilausKuittaus");
/// ```
#[derive(Debug, Clone)]
pub struct Decoder {
    buffer: [u8; Message::MAX_LEN],
    /// What is in the buffer and not yet used: `start..end`.
    start: usize,
    end: usize,
    /// The stream's offset of `start`.
    position: usize,
    charset: Charset,
    outside: Outside,
}

/// What to make of bytes before the next `<`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Outside {
    /// They belong to a damaged message that has been reported.
    Damaged,
    /// They belong to nothing: this many so far.
    Garbage(usize),
}

impl Decoder {
    /// An empty decoder at the beginning of a stream.
    pub const fn new(charset: Charset) -> Self {
        let (buffer, outside) = ([0; Message::MAX_LEN], Outside::Garbage(0));
        Self { buffer, start: 0, end: 0, position: 0, charset, outside }
    }

    /// Takes bytes and says how many: fewer than there are when the buffer is full, which
    /// [`next_message`](Self::next_message) empties.
    pub fn push(&mut self, bytes: &[u8]) -> usize {
        if self.start > 0 && self.end + bytes.len() > self.buffer.len() {
            self.buffer.copy_within(self.start..self.end, 0);
            self.end -= self.start;
            self.start = 0;
        }
        let taken = bytes.len().min(self.buffer.len() - self.end);
        let place = self.buffer.get_mut(self.end..self.end + taken);
        if let (Some(place), Some(bytes)) = (place, bytes.get(..taken)) {
            place.copy_from_slice(bytes);
            self.end += taken;
        }
        taken
    }

    /// The next message, or what was wrong in its place. `None`: more bytes are needed.
    pub fn next_message(&mut self) -> Option<Result<Message<'_>, DecodeError>> {
        let waiting = self.buffer.get(self.start..self.end).unwrap_or_default();
        let skipped = waiting.iter().position(|byte| *byte == START).unwrap_or(waiting.len());
        self.start += skipped;
        self.position = self.position.wrapping_add(skipped);
        if let Outside::Garbage(length) = &mut self.outside {
            *length += skipped;
        }
        let bytes = self.buffer.get(self.start..self.end).filter(|bytes| !bytes.is_empty())?;
        if let Some(error) = take_garbage(&mut self.outside, self.position) {
            return Some(Err(error));
        }
        match Message::decode(bytes, self.charset) {
            Ok(None) => None,
            Ok(Some((message, used))) => {
                self.start += used;
                self.position = self.position.wrapping_add(used);
                self.outside = Outside::Garbage(0);
                Some(Ok(message))
            }
            Err(error) => {
                let error = error.moved(self.position);
                self.start += 1;
                self.position = self.position.wrapping_add(1);
                self.outside = Outside::Damaged;
                Some(Err(error))
            }
        }
    }

    /// Says that nothing follows: a datagram or a file has ended. What is left over is the error, if anything is, and is
    /// gone. Call it when [`next_message`](Self::next_message) gives `None`.
    pub fn finish(&mut self) -> Option<DecodeError> {
        let (offset, found) = (self.position, self.end - self.start);
        self.position = self.position.wrapping_add(found);
        (self.start, self.end) = (0, 0);
        let garbage = take_garbage(&mut self.outside, offset);
        self.outside = Outside::Garbage(0);
        if found > 0 { Some(DecodeError::Incomplete { offset, found }) } else { garbage }
    }

    /// Forgets everything: a new connection begins at offset 0.
    pub fn clear(&mut self) {
        (self.start, self.end, self.position) = (0, 0, 0);
        self.outside = Outside::Garbage(0);
    }

    /// Where in the stream the next message is looked for. After an error it is behind the first byte of the damage.
    pub fn position(&self) -> usize {
        self.position
    }

    /// Whether the bytes so far end inside a message.
    pub fn is_inside_message(&self) -> bool {
        self.end > self.start
    }
}

/// The garbage before `position`, once.
fn take_garbage(outside: &mut Outside, position: usize) -> Option<DecodeError> {
    match core::mem::replace(outside, Outside::Garbage(0)) {
        Outside::Garbage(length @ 1..) => {
            Some(DecodeError::Garbage { offset: position.wrapping_sub(length), length })
        }
        _ => None,
    }
}
