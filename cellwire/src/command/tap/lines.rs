//! The lines of a tap: what both ends say, decoded.

use std::collections::{BTreeMap, VecDeque};
use std::sync::mpsc::Receiver;
use std::time::SystemTime;

use anyhow::Result;
use humantime::format_rfc3339_micros;
use serde_json::{Map, Value, json};

use crate::command::codec::CodecArgs;
use crate::io::output::{self, remark};
use crate::io::tap::{End, Place, Seen, What};
use cellwire_links::codec::{Item, Kind, Stream};
use cellwire_links::link::Link;

/// Decodes what is seen, and prints it.
pub(super) struct Lines<'a> {
    args: &'a CodecArgs,
    connections: BTreeMap<u32, Connection>,
    /// Nobody reads the lines any more.
    is_closed: bool,
}

struct Connection {
    /// What the ends A and B send.
    directions: [Direction; 2],
}

/// What one end sends.
struct Direction {
    side: &'static str,
    stream: Stream,
    /// The bytes that are in no item yet.
    held: VecDeque<u8>,
    /// Whether one of them was a message: on a link where only one side sends messages, the other polls.
    has_messages: bool,
}

impl<'a> Lines<'a> {
    pub(super) fn new(args: &'a CodecArgs) -> Result<Self> {
        // Settings that cannot be are an error before anything is tapped.
        for side in args.link.sides {
            args.codec_of(side)?;
        }
        Ok(Self { args, connections: BTreeMap::new(), is_closed: false })
    }

    /// Until there is nothing more to see.
    pub(super) fn print(mut self, seen: &Receiver<Seen>) {
        while let Ok(seen) = seen.recv() {
            if let Err(error) = self.take(&seen)
                && !self.is_closed
            {
                self.is_closed = true;
                remark(&format!("warning: {error:#}: no more lines; the bytes pass all the same"));
            }
        }
    }

    fn take(&mut self, seen: &Seen) -> Result<()> {
        if self.is_closed {
            return Ok(());
        }
        let Seen { at, connection: number, from, what } = seen;
        if let What::Opened(place) = what {
            self.connections.insert(*number, Connection::new(self.args, place)?);
            return output::log(&opened(*at, *number, place));
        }
        let Some(connection) = self.connections.get_mut(number) else { return Ok(()) };
        let direction = match (from, &mut connection.directions) {
            (End::A, [a, _]) => a,
            (End::B, [_, b]) => b,
        };
        let label = Label { at: *at, connection: *number, side: direction.side };
        match what {
            What::Opened(_) => Ok(()),
            What::Bytes(bytes) => direction.push(self.args.link, &label, bytes),
            What::Missed(missing) => {
                direction.finish(self.args.link, &label)?;
                let stream = Stream::starting_at(
                    self.args.codec_of(direction.side)?,
                    direction.stream.offset() + missing,
                );
                direction.stream = stream;
                label.print([("error", json!({"kind": "gap", "missing": missing}))])
            }
            What::Closed(why) => {
                direction.finish(self.args.link, &label)?;
                let mut line = vec![("event", json!("closed"))];
                line.extend(why.as_ref().map(|why| ("why", json!(why))));
                label.print(line)
            }
        }
    }
}

impl Connection {
    fn new(args: &CodecArgs, place: &Place) -> Result<Self> {
        let port = match place {
            Place::Tcp(_, server) | Place::Udp(_, server) => server.port(),
            Place::Serial(_) => 0,
        };
        let [a, b] = [true, false].map(|is_client| Direction::new(args, (args.link.sender)(is_client, port)));
        Ok(Self { directions: [a?, b?] })
    }
}

impl Direction {
    fn new(args: &CodecArgs, side: &'static str) -> Result<Self> {
        let stream = Stream::new(args.codec_of(side)?);
        Ok(Self { side, stream, held: VecDeque::new(), has_messages: false })
    }

    fn push(&mut self, link: &Link, label: &Label, bytes: &[u8]) -> Result<()> {
        self.held.extend(bytes);
        let Self { stream, held, has_messages, .. } = self;
        stream.push(bytes, |item| show(link, label, item, held, has_messages))
    }

    fn finish(&mut self, link: &Link, label: &Label) -> Result<()> {
        let Self { stream, held, has_messages, .. } = self;
        stream.finish(|item| show(link, label, item, held, has_messages))
    }
}

fn show(
    link: &Link,
    label: &Label,
    item: Item<'_>,
    held: &mut VecDeque<u8>,
    has_messages: &mut bool,
) -> Result<()> {
    let length = (item.length as usize).min(held.len());
    let bytes: String = held.drain(..length).map(|byte| format!("{byte:02x}")).collect();
    let (offset, length) = (("offset", json!(item.offset)), ("length", json!(item.length)));
    let content: Value = serde_json::from_slice(item.json)?;
    match item.kind {
        Kind::Message => {
            *has_messages = true;
            label.print([offset, length, ("message", content)])
        }
        // Polls, of the end that sends no messages.
        Kind::Error if link.sides.len() == 1 && !*has_messages => {
            label.print([offset, length, ("bytes", json!(bytes))])
        }
        Kind::Error => {
            let clause = content.get("kind").and_then(Value::as_str).and_then(|kind| link.clause(kind));
            label.print([
                offset,
                length,
                ("error", content),
                ("clause", json!(clause)),
                ("bytes", json!(bytes)),
            ])
        }
    }
}

/// What a line begins with.
struct Label {
    at: SystemTime,
    connection: u32,
    side: &'static str,
}

impl Label {
    fn print(&self, rest: impl IntoIterator<Item = (&'static str, Value)>) -> Result<()> {
        let mut line = Map::new();
        line.insert("time".into(), time(self.at));
        line.insert("connection".into(), json!(self.connection));
        line.insert("from".into(), json!(self.side));
        line.extend(rest.into_iter().map(|(name, value)| (name.to_owned(), value)));
        output::log(&Value::Object(line))
    }
}

fn opened(at: SystemTime, connection: u32, place: &Place) -> Value {
    let mut line = json!({"time": time(at), "connection": connection, "event": "opened"});
    match place {
        Place::Tcp(a, b) | Place::Udp(a, b) => {
            line["a"] = json!(a.to_string());
            line["b"] = json!(b.to_string());
        }
        Place::Serial(ports) => line["ports"] = json!(ports),
    }
    line
}

fn time(at: SystemTime) -> Value {
    format_rfc3339_micros(at).to_string().into()
}
