//! One line that carries both directions, which are distinguished by their contents.

use std::collections::VecDeque;
use std::time::SystemTime;

use anyhow::Result;
use serde_json::Value;

use crate::command::codec::LinkArgs;
use cellwire_links::codec::{Item, Kind, Stream};

/// Decodes all bytes as either side's. If both have a message at one offset, it belongs to the side that did not send last:
/// on a line for both directions, the ends take turns.
pub(super) struct LineSplitter {
    sides: Vec<Side>,
    /// The offset of the first byte whose sender is not yet known.
    at: u64,
    /// The bytes from there on.
    held: VecDeque<u8>,
    spoke_last: Option<&'static str>,
}

/// The decoding of the line as one side's bytes.
struct Side {
    name: &'static str,
    stream: Stream,
    messages: VecDeque<Message>,
    /// The offset before which all bytes are decoded: each is part of a message, or is not.
    decided: u64,
}

struct Message {
    found: SystemTime,
    offset: u64,
    length: u64,
    content: Value,
}

/// Bytes on the line.
pub(super) struct LineBytes {
    pub(super) at: SystemTime,
    pub(super) offset: u64,
    pub(super) bytes: Vec<u8>,
    /// The side, and the message; `None`: bytes that are not a message of either side.
    pub(super) message: Option<(&'static str, Value)>,
}

impl LineSplitter {
    /// # Errors
    /// If the link has no such setting.
    pub(super) fn new(args: &LinkArgs) -> Result<Self> {
        let side = |name| {
            let stream = Stream::new(args.codec_of(name)?);
            Ok(Side { name, stream, messages: VecDeque::new(), decided: 0 })
        };
        let sides = args.link.sides.iter().map(|name| side(*name)).collect::<Result<_>>()?;
        Ok(Self { sides, at: 0, held: VecDeque::new(), spoke_last: None })
    }

    /// Returns whether there are bytes of which more must arrive.
    pub(super) fn holds(&self) -> bool {
        !self.held.is_empty()
    }

    /// Takes bytes; `say` gets the messages that are certain now, in sequence.
    pub(super) fn push(
        &mut self,
        now: SystemTime,
        bytes: &[u8],
        say: impl FnMut(LineBytes) -> Result<()>,
    ) -> Result<()> {
        self.held.extend(bytes);
        for Side { stream, messages, decided, .. } in &mut self.sides {
            stream.push(bytes, |item| note(now, item, messages, decided))?;
        }
        self.clear_up(now, say)
    }

    /// Called when the line is silent: decodes the buffered bytes as they are.
    pub(super) fn finish(&mut self, now: SystemTime, say: impl FnMut(LineBytes) -> Result<()>) -> Result<()> {
        for Side { stream, messages, decided, .. } in &mut self.sides {
            stream.finish(|item| note(now, item, messages, decided))?;
        }
        self.clear_up(now, say)
    }

    fn clear_up(&mut self, now: SystemTime, mut say: impl FnMut(LineBytes) -> Result<()>) -> Result<()> {
        let decided = self.sides.iter().map(|side| side.decided).min().unwrap_or_default();
        loop {
            for side in &mut self.sides {
                while side.messages.front().is_some_and(|message| message.offset < self.at) {
                    side.messages.pop_front();
                }
            }
            let spoke_last = self.spoke_last;
            let first = self
                .sides
                .iter_mut()
                .filter(|side| side.messages.front().is_some_and(|it| it.offset + it.length <= decided))
                .min_by_key(|side| {
                    (side.messages.front().map(|it| it.offset), Some(side.name) == spoke_last)
                });
            let next = first.and_then(|side| Some((side.name, side.messages.pop_front()?)));
            let begin = next.as_ref().map_or(decided, |(_, message)| message.offset);
            if begin > self.at {
                let (offset, bytes) = (self.at, self.take(begin));
                say(LineBytes { at: now, offset, bytes, message: None })?;
            }
            let Some((name, Message { found, offset, length, content })) = next else { return Ok(()) };
            let bytes = self.take(offset + length);
            self.spoke_last = Some(name);
            say(LineBytes { at: found, offset, bytes, message: Some((name, content)) })?;
        }
    }

    /// Removes and returns the bytes up to `end`.
    fn take(&mut self, end: u64) -> Vec<u8> {
        let length = usize::try_from(end - self.at).unwrap_or(usize::MAX).min(self.held.len());
        self.at = end;
        self.held.drain(..length).collect()
    }
}

fn note(now: SystemTime, item: Item<'_>, messages: &mut VecDeque<Message>, decided: &mut u64) -> Result<()> {
    let Item { offset, length, kind, json } = item;
    *decided = offset + length;
    if kind == Kind::Message {
        messages.push_back(Message { found: now, offset, length, content: serde_json::from_slice(json)? });
    }
    Ok(())
}
