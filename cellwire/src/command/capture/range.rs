//! A stretch of a conversation, as messages.

use std::time::Duration;

use anyhow::{Result, ensure};
use cellwire_links::codec::{Item, Kind, Stream};
use serde_json::Value;

use super::anonymous::Anonymous;
use super::message::Message;
use crate::command::codec::LinkArgs;
use crate::command::recorded::{Conversation, ConversationArgs};

/// The conversation, and the range of its messages.
#[derive(Debug, clap::Args)]
pub(super) struct RangeArgs {
    #[command(flatten)]
    pub(super) of: LinkArgs,
    #[command(flatten)]
    conversation: ConversationArgs,
    /// The first message, by its number from 1, or a time since the first such as 2.5s
    #[arg(long, value_name = "PLACE", value_parser = place)]
    from: Option<Position>,
    /// The last message, likewise
    #[arg(long, value_name = "PLACE", value_parser = place)]
    to: Option<Position>,
    /// Replace names, positions and measured values, and list what was replaced. Bytes outside of messages are
    /// left out
    #[arg(long)]
    anonymous: bool,
}

/// A position in a conversation: the number of a message, or a time.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Position {
    Number(usize),
    Time(Duration),
}

fn place(text: &str) -> Result<Position, String> {
    if let Some(seconds) = text.strip_suffix('s') {
        let seconds = seconds.parse().ok().and_then(|it| Duration::try_from_secs_f64(it).ok());
        return seconds.map(Position::Time).ok_or(format!("`{text}` is not a time in seconds"));
    }
    match text.parse() {
        Ok(number @ 1..) => Ok(Position::Number(number)),
        _ => Err(format!("`{text}` is neither a number from 1 nor a time such as 2.5s")),
    }
}

impl RangeArgs {
    /// Reads the conversation, and the messages of the stretch.
    ///
    /// # Errors
    /// When the range contains no message.
    pub(super) fn read(&self) -> Result<(Conversation, Vec<Message>)> {
        let conversation = self.conversation.read()?;
        let mut messages = messages(&self.of, &conversation)?;
        let count = messages.len();
        messages.retain(|it| {
            let is_after = match self.from {
                Some(Position::Number(number)) => it.number >= number,
                Some(Position::Time(at)) => it.at >= at,
                None => true,
            };
            let is_before = match self.to {
                Some(Position::Number(number)) => it.number <= number,
                Some(Position::Time(at)) => it.at <= at,
                None => true,
            };
            is_after && is_before
        });
        ensure!(!messages.is_empty(), "the range has none of the {count} messages");
        if self.anonymous {
            let mut anonymous = Anonymous::new(&self.of);
            messages.retain_mut(|message| anonymous.replace(message));
            anonymous.report();
        }
        Ok((conversation, messages))
    }
}

/// Reads the messages of both ends, in the sequence in which they were complete.
fn messages(of: &LinkArgs, conversation: &Conversation) -> Result<Vec<Message>> {
    let parties = conversation.parties(of.link)?;
    let mut all: Vec<Message> = Vec::new();
    for party in parties {
        let (is_first, side) = (party.is_first, party.side);
        let mut reading = Reading { all: &mut all, is_first, side, held: Vec::new(), after_gap: false };
        let mut stream = side.map(|side| of.codec_of(side)).transpose()?.map(Stream::new);
        for sent in conversation.sent.iter().filter(|sent| party.has_sent(sent)) {
            let at = sent.at;
            let (Some(codec), Some(side)) = (&mut stream, side) else {
                reading.add(at, sent.bytes.clone(), Ok(Value::Null));
                continue;
            };
            if sent.after_gap {
                codec.finish(|item| reading.item(at, item))?;
                *codec = Stream::new(of.codec_of(side)?);
                reading.after_gap = true;
            }
            reading.held.extend_from_slice(&sent.bytes);
            codec.push(&sent.bytes, |item| reading.item(at, item))?;
        }
        let last = conversation.sent.last().map_or(Duration::ZERO, |sent| sent.at);
        if let Some(codec) = &mut stream {
            codec.finish(|item| reading.item(last, item))?;
        }
    }
    all.sort_by_key(|message| message.at);
    (1..).zip(&mut all).for_each(|(number, message)| message.number = number);
    Ok(all)
}

/// The bytes of one end.
struct Reading<'a> {
    all: &'a mut Vec<Message>,
    is_first: bool,
    side: Option<&'static str>,
    /// Bytes that are in no message yet.
    held: Vec<u8>,
    /// Bytes are missing before the next message.
    after_gap: bool,
}

impl Reading<'_> {
    fn item(&mut self, at: Duration, item: Item<'_>) -> Result<()> {
        let length = usize::try_from(item.length)?.min(self.held.len());
        let bytes = self.held.drain(..length).collect();
        let value = serde_json::from_slice(item.json)?;
        self.add(at, bytes, if item.kind == Kind::Message { Ok(value) } else { Err(value) });
        Ok(())
    }

    fn add(&mut self, at: Duration, bytes: Vec<u8>, content: Result<Value, Value>) {
        let (number, is_first, side) = (0, self.is_first, self.side);
        let after_gap = core::mem::take(&mut self.after_gap);
        self.all.push(Message { number, at, is_first, side, bytes, content, after_gap });
    }
}
