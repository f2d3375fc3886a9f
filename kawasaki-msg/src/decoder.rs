//! A stream of bytes in, messages out, whatever the reads and the string elements cut.

use crate::error::DecodeError;
use crate::job::{BUFFER, Expected, Job, Work};
use crate::message::Message;
use crate::value::{Charset, DATA, START};

/// Finds the messages in a stream of bytes.
///
/// Its verbs are those of [`robot_session::Decoder`]. A message may be cut anywhere and by any number of reads. An error costs the
/// bytes up to the next `<`, and nothing before or after them; it is returned when that `<` has come. Holds one message of the
/// greatest length and never more.
///
/// ```
/// use kawasaki_msg::robot_session::Decoder as _;
/// use kawasaki_msg::{Charset, Decoder};
///
/// let mut decoder = Decoder::new(Charset::Ascii);
/// assert_eq!(decoder.push(b"<TilausKuit"), 11);
/// assert!(decoder.next_frame().is_none());
/// assert_eq!(decoder.push(b"taus$2#50#>"), 11);
/// assert_eq!(decoder.next_frame().unwrap().unwrap().name, "TilausKuittaus");
/// ```
#[derive(Debug, Clone)]
pub struct Decoder {
    /// The bytes after the longest message are only looked at, eight at a time, never filled.
    buffer: [u8; BUFFER],
    charset: Charset,
    cursor: Cursor,
}

impl Decoder {
    /// An empty decoder at the beginning of a stream.
    pub const fn new(charset: Charset) -> Self {
        Self { buffer: [0; BUFFER], charset, cursor: Cursor::START }
    }

    /// Takes of an input what fits, and gives back the rest. No message goes on after the end of a datagram.
    pub(crate) fn take<'b>(&mut self, bytes: &'b [u8], is_datagram: bool) -> &'b [u8] {
        let taken = robot_session::Decoder::push(self, bytes);
        let rest = bytes.get(taken..).unwrap_or_default();
        if rest.is_empty() && is_datagram {
            robot_session::Decoder::finish(self);
        }
        rest
    }

    /// Gives the jobs that come next to `take`, as long as each is the expected one, until it refuses one.
    #[inline(always)]
    pub(crate) fn expected_jobs<W: Work>(
        &mut self,
        expected: &mut Expected,
        ranges: &W::Ranges,
        mut take: impl FnMut(&Job<W>) -> bool,
    ) {
        let Self { buffer, cursor, .. } = self;
        if cursor.position != cursor.offset {
            return;
        }
        // No more is ever filled: it only shows the bound of every place.
        let end = cursor.end.min(Message::MAX_LEN);
        let swar = expected.swar();
        let mut at = cursor.start;
        while at < end {
            let mut job = Job { order: 0, number: 0, work: W::default() };
            let Some(after) = expected.read(&swar, buffer, (at, end), ranges, &mut job) else { break };
            if !take(&job) {
                break;
            }
            at = after;
            expected.advance();
        }
        cursor.advance(at - cursor.start);
        cursor.position = cursor.offset;
    }

    /// Whether the bytes so far end inside a message that may still become whole.
    pub fn is_inside_message(&self) -> bool {
        self.cursor.end > self.cursor.start
    }
}

impl robot_session::Decoder for Decoder {
    type Frame<'a> = Message<'a>;
    type Error = DecodeError;

    fn push(&mut self, bytes: &[u8]) -> usize {
        let Self { buffer, cursor, .. } = self;
        if cursor.end + bytes.len() > Message::MAX_LEN {
            buffer.copy_within(cursor.start..cursor.end, 0);
            cursor.end -= cursor.start;
            cursor.start = 0;
        }
        let taken = bytes.len().min(Message::MAX_LEN - cursor.end);
        let place = buffer.get_mut(cursor.end..cursor.end + taken);
        if let (Some(place), Some(bytes)) = (place, bytes.get(..taken)) {
            place.copy_from_slice(bytes);
            cursor.end += taken;
        }
        taken
    }

    fn next_frame(&mut self) -> Option<Result<Message<'_>, DecodeError>> {
        let Self { buffer, charset, cursor } = self;
        if let Some(error) = cursor.find_start(buffer)? {
            return Some(Err(error));
        }
        let bytes = buffer.get(cursor.start..cursor.end)?;
        if let Some(new) = bytes.get(cursor.scanned..)
            && cursor.scanned > 0
            && !(cursor.finished || bytes.len() == Message::MAX_LEN)
            && !new.iter().any(|byte| charset.ends_text(*byte))
        {
            cursor.scanned = bytes.len();
            return None;
        }
        match Message::decode(bytes, *charset) {
            Ok(Some((message, used))) => {
                cursor.advance(used);
                cursor.position = cursor.offset;
                return Some(Ok(message));
            }
            Ok(None) if !cursor.finished => {
                // After a `#` any byte may end it.
                cursor.scanned = if bytes.last() == Some(&DATA) { 0 } else { bytes.len() };
                return None;
            }
            Ok(None) => {
                cursor.corruption =
                    Some(DecodeError::Incomplete { offset: cursor.offset, found: bytes.len() });
            }
            Err(error) => cursor.corruption = Some(error.moved(cursor.offset)),
        }
        cursor.advance(1);
        cursor.find_start(buffer).flatten().map(Err)
    }

    fn finish(&mut self) {
        self.cursor.finished = true;
    }

    fn position(&self) -> u64 {
        self.cursor.position as u64
    }

    fn clear(&mut self) {
        let Cursor { start, end, offset, .. } = self.cursor;
        let offset = offset.wrapping_add(end - start);
        self.cursor = Cursor { offset, position: offset, ..Cursor::START };
    }
}

/// Where the decoder is, apart from its bytes.
#[derive(Debug, Clone)]
struct Cursor {
    /// What is in the buffer and not yet used: `start..end`.
    start: usize,
    end: usize,
    /// How much of it is known to be the beginning of a message that only a mark can end.
    scanned: usize,
    /// The stream's offset of `start`.
    offset: usize,
    /// The stream's offset after what was returned last.
    position: usize,
    /// Why the bytes from `position` to `offset` are skipped; without it they are garbage.
    corruption: Option<DecodeError>,
    finished: bool,
}

impl Cursor {
    const START: Self =
        Self { start: 0, end: 0, scanned: 0, offset: 0, position: 0, corruption: None, finished: false };

    fn advance(&mut self, bytes: usize) {
        self.start += bytes;
        self.scanned = 0;
        self.offset = self.offset.wrapping_add(bytes);
    }

    /// Goes to the next `<`: `None` if there is none yet, else the error that covers what was skipped.
    fn find_start(&mut self, buffer: &[u8]) -> Option<Option<DecodeError>> {
        let waiting = buffer.get(self.start..self.end)?;
        let skipped = waiting.iter().position(|byte| *byte == START).unwrap_or(waiting.len());
        if skipped != 0 {
            self.advance(skipped);
        }
        let ended = self.start == self.end;
        if ended && !self.finished {
            return None;
        }
        let (offset, length) = (self.position, self.offset.wrapping_sub(self.position));
        if length > 0 {
            self.position = self.offset;
            return Some(Some(self.corruption.take().unwrap_or(DecodeError::Garbage { offset, length })));
        }
        if ended {
            self.finished = false;
            return None;
        }
        Some(None)
    }
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use robot_session::Decoder as _;

    use super::*;
    use crate::dialect::Dialect;
    use crate::job::{Bounds, Line};

    const JOBS: &[u8] = b"<Tyo$14#50$1$1$0$0$3$4#><Tyo$14#50$2$2$3$4$5$6#><Tyo$14#50$3$1$5$6$7$8#>";

    fn from_first() -> Expected {
        Expected::new(&Dialect::DEFAULT, 50, 1, 9999).unwrap()
    }

    /// The numbers that a decoder gives one after the other, up to the first that is refused.
    fn numbers(decoder: &mut Decoder, expected: &mut Expected, refused: u16) -> Vec<u16> {
        let mut numbers = Vec::new();
        decoder.expected_jobs::<Line>(expected, &Bounds::WIDEST, |job| {
            numbers.push(job.number);
            job.number != refused
        });
        numbers
    }

    #[test]
    fn expected_jobs_are_given_up_to_the_last_whole_one() {
        for (length, given) in [(JOBS.len(), 3), (JOBS.len() - 1, 2), (25, 1), (24, 1), (23, 0)] {
            let mut decoder = Decoder::new(Charset::Ascii);
            assert_eq!(decoder.push(&JOBS[..length]), length);
            let expected = &mut from_first();
            assert_eq!(numbers(&mut decoder, expected, 9), [1, 2, 3][..given], "of {length} bytes");
            assert_eq!((decoder.position(), usize::from(expected.number())), (24 * given as u64, given + 1));
            let _ = decoder.push(&JOBS[length..]);
            assert_eq!(numbers(&mut decoder, expected, 9), [1, 2, 3][given..]);
            assert_eq!((decoder.position(), decoder.is_inside_message()), (72, false));
        }
    }

    #[test]
    fn a_job_that_is_refused_is_the_next_message() {
        let mut decoder = Decoder::new(Charset::Ascii);
        let _ = decoder.push(JOBS);
        let expected = &mut from_first();
        assert_eq!(numbers(&mut decoder, expected, 2), [1, 2]);
        assert_eq!((decoder.position(), expected.number()), (24, 2));
        let message = decoder.next_frame().unwrap().unwrap();
        assert_eq!(message.fields.get(1).unwrap(), "2");
    }
}
