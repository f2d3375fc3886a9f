//! A stream of bytes in, messages out, whatever the reads and the string elements cut.

use crate::error::DecodeError;
use crate::message::{Head, Message};
use crate::value::{Charset, DATA, END, START};

/// Finds the messages in a stream of bytes.
///
/// Its verbs are those of [`robot_session::Decoder`]. A message may be cut anywhere and by any number of reads. An error costs the
/// bytes up to the next `<`, and nothing before or after them; it is returned when that `<` has come. Holds one message of
/// `MESSAGE` bytes and never more: a longer one is [`DecodeError::TooLong`].
///
/// ```
/// use kawasaki_msg::robot_session::Decoder as _;
/// use kawasaki_msg::{Charset, Decoder};
///
/// let mut decoder = Decoder::new(Charset::Ascii);
/// assert_eq!(decoder.push(b"<TilausKuit"), 11);
/// assert!(decoder.next_frame().is_none());
/// assert_eq!(decoder.push(b"taus$2#50#>"), 11);
/// assert_eq!(decoder.next_frame().expect("whole")?.name, "TilausKuittaus");
/// # Ok::<(), kawasaki_msg::DecodeError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Decoder<const MESSAGE: usize = { Message::MAX_LEN }> {
    /// What has come is in the first half. The second is only looked at, behind a mark that ends every job.
    buffer: [[u8; MESSAGE]; 2],
    charset: Charset,
    cursor: Cursor,
}

impl Decoder {
    /// An empty decoder at the beginning of a stream, for messages of every length.
    pub const fn new(charset: Charset) -> Self {
        Self::sized(charset)
    }
}

impl<const MESSAGE: usize> Decoder<MESSAGE> {
    /// An empty decoder at the beginning of a stream, for messages of `MESSAGE` bytes at most.
    pub const fn sized(charset: Charset) -> Self {
        Self { buffer: [[0; MESSAGE]; 2], charset, cursor: Cursor::START }
    }

    /// Takes of an input what fits, and gives back the rest; of more than fits only up to the end of a message: expected jobs after it
    /// are read where they are. No message goes on after the end of a datagram.
    pub(crate) fn take_next<'b>(&mut self, bytes: &'b [u8], is_datagram: bool) -> &'b [u8] {
        let end = if bytes.len() > MESSAGE { bytes.iter().position(|byte| *byte == END) } else { None };
        let part = end.map_or(bytes, |end| bytes.get(..=end).unwrap_or(bytes));
        let taken = robot_session::Decoder::push(self, part);
        let rest = bytes.get(taken..).unwrap_or_default();
        if rest.is_empty() && is_datagram {
            robot_session::Decoder::finish(self);
        }
        rest
    }

    /// Gives the messages that come next to `read`, which says how many of these bytes it has used: those in an input where they are,
    /// if nothing is held before them, then those that are held with what is [taken](Self::take_next). What is not is given back.
    pub(crate) fn read_in_place<'b>(
        &mut self,
        bytes: &'b [u8],
        is_datagram: bool,
        mut read: impl FnMut(&[u8]) -> usize,
    ) -> &'b [u8] {
        let mut rest = bytes;
        if self.cursor.start == self.cursor.end && self.cursor.position == self.cursor.offset {
            let used = read(rest);
            rest = rest.get(used..).unwrap_or_default();
            self.cursor.skip(used);
        }
        rest = self.take_next(rest, is_datagram);
        if self.cursor.position == self.cursor.offset {
            let used = read(self.held());
            if used > 0 {
                self.cursor.use_up(used);
            }
        }
        rest
    }

    /// What is held, and bytes to look at after it. A job among them, which is left of earlier messages, is never whole: no mark
    /// that begins one is inside another, and none begins where fewer bytes are left than one can have.
    fn held(&mut self) -> &[u8] {
        let Cursor { start, end, .. } = self.cursor;
        let buffer = self.buffer.as_flattened_mut();
        if let Some(after) = buffer.get_mut(end) {
            *after = START;
        }
        buffer.get(start..end + MESSAGE - 1).unwrap_or_default()
    }

    /// Whether the bytes so far end inside a message that may still become whole.
    pub fn is_inside_message(&self) -> bool {
        self.cursor.end > self.cursor.start
    }

    /// What the bytes begin with, from the first one on.
    #[inline(never)]
    fn next_item(&mut self) -> Option<Result<Message<'_>, DecodeError>> {
        let Self { buffer: [buffer, _], charset, cursor } = self;
        if cursor.head.is_none()
            && cursor.position == cursor.offset
            && let Some((message, used)) = Message::usual(buffer.get(cursor.start..cursor.end)?, *charset)
        {
            cursor.use_up(used);
            return Some(Ok(message));
        }
        if let Some(error) = cursor.find_start(buffer)? {
            return Some(Err(error));
        }
        let bytes = buffer.get(cursor.start..cursor.end)?;
        if let Some(message) = cursor.completed(bytes) {
            return Some(Ok(message));
        }
        match Message::decode_within(bytes, *charset, MESSAGE) {
            Ok(Some((message, used))) => {
                cursor.use_up(used);
                return Some(Ok(message));
            }
            Ok(None) if !cursor.finished => {
                cursor.search_from(bytes, MESSAGE);
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

    /// A mark came alone, after what is searched.
    #[inline(never)]
    fn next_mark(&mut self) -> Option<Result<Message<'_>, DecodeError>> {
        let Self { buffer: [buffer, _], cursor, .. } = self;
        let bytes = buffer.get(cursor.start..cursor.end)?;
        if cursor.goes_on_after_mark(bytes, MESSAGE) { None } else { self.next_item() }
    }
}

impl<const MESSAGE: usize> robot_session::Decoder for Decoder<MESSAGE> {
    type Frame<'a> = Message<'a>;
    type Error = DecodeError;

    #[inline]
    fn push(&mut self, bytes: &[u8]) -> usize {
        let Self { buffer: [buffer, _], cursor, .. } = self;
        // A serial line brings its bytes one by one: a copy of one is no call.
        if let ([byte], Some(place)) = (bytes, buffer.get_mut(cursor.end)) {
            *place = *byte;
            cursor.end += 1;
            return 1;
        }
        if cursor.end + bytes.len() > MESSAGE {
            buffer.copy_within(cursor.start..cursor.end, 0);
            cursor.end -= cursor.start;
            cursor.start = 0;
        }
        let taken = bytes.len().min(MESSAGE - cursor.end);
        let place = buffer.get_mut(cursor.end..cursor.end + taken);
        if let (Some(place), Some(bytes)) = (place, bytes.get(..taken)) {
            place.copy_from_slice(bytes);
            cursor.end += taken;
        }
        taken
    }

    #[inline]
    fn next_frame(&mut self) -> Option<Result<Message<'_>, DecodeError>> {
        let Self { buffer: [buffer, _], charset, cursor } = self;
        let last = cursor.start + cursor.scanned;
        if last + 1 == cursor.end
            && last < MESSAGE - 1
            && let Some(byte) = buffer.get(last)
        {
            // A byte that came alone, and ends nothing.
            if cursor.scanned > 0 && !charset.ends_text(*byte) {
                cursor.scanned += 1;
                return None;
            }
            if !cursor.finished {
                if cursor.scanned == 0 && *byte != START {
                    cursor.advance(1);
                    return None;
                }
                return self.next_mark();
            }
        }
        self.next_item()
    }

    fn finish(&mut self) {
        // What is held is looked at once more, as the last that came.
        (self.cursor.scanned, self.cursor.head) = (0, None);
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
    /// What it says, once the `#` before the data part has come. Nothing is searched any more after the second one: whatever comes
    /// next ends the message, well or badly.
    head: Option<Head>,
    /// The stream's offset of `start`.
    offset: usize,
    /// The stream's offset after what was returned last.
    position: usize,
    /// Why the bytes from `position` to `offset` are skipped; without it they are garbage.
    corruption: Option<DecodeError>,
    finished: bool,
}

impl Cursor {
    const START: Self = Self {
        start: 0,
        end: 0,
        scanned: 0,
        head: None,
        offset: 0,
        position: 0,
        corruption: None,
        finished: false,
    };

    fn advance(&mut self, bytes: usize) {
        self.start += bytes;
        (self.scanned, self.head) = (0, None);
        self.offset = self.offset.wrapping_add(bytes);
    }

    /// Goes on after messages that were given of what is held.
    fn use_up(&mut self, bytes: usize) {
        self.start += bytes;
        self.skip(bytes);
    }

    /// Goes on after messages that were given.
    fn skip(&mut self, bytes: usize) {
        (self.scanned, self.head) = (0, None);
        self.offset = self.offset.wrapping_add(bytes);
        self.position = self.offset;
    }

    /// More of a message is needed than these bytes: where its end is looked for.
    fn search_from(&mut self, bytes: &[u8], limit: usize) {
        if self.head.is_none() {
            let data = bytes.iter().position(|byte| *byte == DATA);
            self.head = data.and_then(|data| Head::read(bytes.get(1..data)?, limit).ok());
        }
        let is_second = bytes.last() == Some(&DATA) && self.head.is_some_and(|head| head.data < bytes.len());
        self.scanned = if is_second { 0 } else { bytes.len() };
    }

    /// Whether a message goes on after these bytes, the last of which is a mark that came alone.
    fn goes_on_after_mark(&mut self, bytes: &[u8], limit: usize) -> bool {
        match (bytes, self.head) {
            ([START], _) => {
                let is_first = self.position == self.offset;
                self.scanned = usize::from(is_first);
                is_first
            }
            ([_, head @ .., DATA], None) => {
                self.head = Head::read(head, limit).ok();
                self.scanned = bytes.len();
                self.head.is_some()
            }
            ([.., DATA], Some(head)) if self.scanned == head.end => {
                self.scanned = 0;
                true
            }
            _ => false,
        }
    }

    /// The message that these bytes begin with, if its end was all that was missing.
    fn completed<'b>(&mut self, bytes: &'b [u8]) -> Option<Message<'b>> {
        let head = self.head.filter(|head| self.scanned == 0 && bytes.get(head.end + 1) == Some(&END))?;
        self.use_up(head.len());
        Some(head.whole(bytes))
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
mod tests;
