//! The bytes to play, and the messages that are expected of the other end.

use std::time::Duration;

use anyhow::Result;
use cellwire_links::codec::{Item, Kind, Stream};
use serde_json::{Value, json};

use crate::command::codec::LinkArgs;
use crate::command::recorded::{Conversation, Party};

/// One end of a conversation, to be played.
#[derive(Debug)]
pub(super) struct Script {
    pub(super) parts: Vec<Part>,
    /// The other end's messages.
    pub(super) expected: Vec<Value>,
}

/// Messages that this end sent together.
#[derive(Debug)]
pub(super) struct Part {
    /// When they began.
    pub(super) at: Duration,
    pub(super) bytes: Vec<u8>,
    /// The bytes of each, and their message if they are one.
    pub(super) messages: Vec<(Vec<u8>, Option<Value>)>,
    /// The number of messages of the other end that came before it.
    pub(super) after: usize,
    /// The time since the preceding part, of either end.
    pub(super) delay: Duration,
}

impl Script {
    pub(super) fn new(args: &LinkArgs, conversation: &Conversation, parties: [Party; 2]) -> Result<Self> {
        let [ours, theirs] = parties;
        let mut script = Self { parts: Vec::new(), expected: Vec::new() };
        let (mut reader, mut own) = (Reader::new(args, theirs.side)?, Reader::new(args, ours.side)?);
        // A message of this end that has begun.
        let mut begun: Option<Part> = None;
        let mut last = Duration::ZERO;
        for sent in &conversation.sent {
            let at = sent.at;
            if sent.after_gap {
                let reader = if ours.has_sent(sent) { &mut own } else { &mut reader };
                let mut items = Vec::new();
                reader.finish(&mut |content| items.push(content))?;
                if !ours.has_sent(sent) {
                    script.expected.extend(items);
                } else if let Some(part) = begun.take() {
                    script.parts.push(part);
                }
            }
            if ours.has_sent(sent) {
                let (after, delay) = (script.expected.len(), at.saturating_sub(last));
                let part = begun.get_or_insert_with(|| Part {
                    at,
                    bytes: Vec::new(),
                    messages: Vec::new(),
                    after,
                    delay,
                });
                part.bytes.extend_from_slice(&sent.bytes);
                let mut items = Vec::new();
                own.push(&sent.bytes, &mut |content| items.push(content))?;
                if !items.is_empty()
                    && let Some(mut part) = begun.take()
                {
                    part.messages = messages(args, ours, &part.bytes)?;
                    script.parts.push(part);
                }
            } else {
                reader.push(&sent.bytes, &mut |content| script.expected.push(content))?;
            }
            last = at;
        }
        script.parts.extend(begun);
        reader.finish(&mut |content| script.expected.push(content))?;
        Ok(script)
    }
}

/// Returns the messages in these bytes.
fn messages(args: &LinkArgs, party: Party, bytes: &[u8]) -> Result<Vec<(Vec<u8>, Option<Value>)>> {
    let Some(side) = party.side else { return Ok(Vec::new()) };
    let (mut stream, mut rest, mut found) = (Stream::new(args.codec_of(side)?), bytes, Vec::new());
    stream.push(bytes, |item| {
        let (its, after) = rest.split_at_checked(usize::try_from(item.length)?).unwrap_or((rest, &[]));
        rest = after;
        let message = match item.kind {
            Kind::Message => Some(serde_json::from_slice(item.json)?),
            Kind::Error => None,
        };
        found.push((its.to_vec(), message));
        Ok(())
    })?;
    // An incomplete message is completed by the next part.
    found.push((rest.to_vec(), None));
    Ok(found)
}

/// The bytes of an end as messages; those of an end that polls one by one.
#[allow(missing_debug_implementations, reason = "a stream has none")]
pub(super) struct Reader(Option<Stream>);

impl Reader {
    pub(super) fn new(args: &LinkArgs, side: Option<&'static str>) -> Result<Self> {
        Ok(Self(side.map(|side| args.codec_of(side)).transpose()?.map(Stream::new)))
    }

    pub(super) fn push(&mut self, bytes: &[u8], add: &mut dyn FnMut(Value)) -> Result<()> {
        match &mut self.0 {
            Some(stream) => stream.push(bytes, |item| content(item, add)),
            None => {
                bytes.iter().for_each(|byte| add(json!({"byte": format!("{byte:02x}")})));
                Ok(())
            }
        }
    }

    /// Called when no more bytes come.
    pub(super) fn finish(&mut self, add: &mut dyn FnMut(Value)) -> Result<()> {
        match &mut self.0 {
            Some(stream) => stream.finish(|item| content(item, add)),
            None => Ok(()),
        }
    }
}

fn content(item: Item<'_>, add: &mut dyn FnMut(Value)) -> Result<()> {
    let value: Value = serde_json::from_slice(item.json)?;
    add(if item.kind == Kind::Message { value } else { json!({"error": value}) });
    Ok(())
}
