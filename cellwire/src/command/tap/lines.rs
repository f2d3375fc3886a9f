//! The lines of a tap: what both ends say, decoded.

use std::collections::{BTreeMap, VecDeque};
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::{Duration, SystemTime};

use anyhow::Result;
use humantime::format_rfc3339_micros;
use serde_json::{Map, Value, json};

use super::split::{Said, Split};
use crate::command::codec::LinkArgs;
use crate::io::output::{self, remark};
use crate::io::tap::{End, Place, Seen, What};
use cellwire_links::codec::{Item, Kind, Stream};
use cellwire_links::link::Link;

/// On a line that carries both directions nothing more comes of what was sent before such a silence.
const SILENCE: Duration = Duration::from_millis(100);

/// Decodes what is seen, and prints it.
pub(super) struct Lines<'a> {
    args: &'a LinkArgs,
    connections: BTreeMap<u32, Connection>,
    /// Nobody reads the lines any more.
    is_closed: bool,
}

enum Connection {
    /// What the ends A and B send.
    Ends([Direction; 2]),
    /// A line that carries both directions.
    Line(Split),
}

/// What one end sends.
struct Direction {
    /// The name of the end.
    end: &'static str,
    /// `None` where it sends no messages, and polls.
    decoded: Option<Decoded>,
}

/// A side that sends messages.
struct Decoded {
    side: &'static str,
    stream: Stream,
    /// The bytes that are in no item yet.
    held: VecDeque<u8>,
}

impl<'a> Lines<'a> {
    pub(super) fn new(args: &'a LinkArgs) -> Result<Self> {
        // Settings that cannot be are an error before anything is tapped.
        for side in args.link.sides {
            args.codec_of(side)?;
        }
        Ok(Self { args, connections: BTreeMap::new(), is_closed: false })
    }

    /// Until there is nothing more to see.
    pub(super) fn print(mut self, seen: &Receiver<Seen>) {
        loop {
            let outcome = match seen.recv_timeout(SILENCE) {
                Ok(seen) => self.take(&seen),
                Err(RecvTimeoutError::Timeout) => self.silence(),
                Err(RecvTimeoutError::Disconnected) => return,
            };
            if let Err(error) = outcome
                && !self.is_closed
            {
                self.is_closed = true;
                remark(&format!("warning: {error:#}: no more lines; the bytes pass all the same"));
            }
        }
    }

    /// What is held on a line is all that was sent.
    fn silence(&mut self) -> Result<()> {
        for (number, connection) in &mut self.connections {
            if let Connection::Line(line) = connection
                && line.holds()
                && !self.is_closed
            {
                line.finish(SystemTime::now(), |said| said_on_line(*number, said))?;
            }
        }
        Ok(())
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
        let directions = match self.connections.get_mut(number) {
            Some(Connection::Ends(directions)) => directions,
            Some(Connection::Line(line)) => {
                let say = |said| said_on_line(*number, said);
                return match what {
                    What::Bytes(bytes) => line.push(*at, bytes, say),
                    _ => line.finish(*at, say),
                };
            }
            None => return Ok(()),
        };
        let direction = match (from, directions) {
            (End::A, [a, _]) => a,
            (End::B, [_, b]) => b,
        };
        let label = Label { at: *at, connection: *number, end: direction.end };
        match what {
            What::Opened(_) => Ok(()),
            What::Bytes(bytes) => direction.push(self.args.link, &label, bytes),
            What::Missed(missing) => {
                direction.skip(self.args, &label, *missing)?;
                label.print([("error", json!({"kind": "gap", "missing": missing}))])
            }
            What::Closed(why) => {
                direction.finish(self.args.link, &label)?;
                let why = why.as_ref().map(|why| ("why", json!(why)));
                label.print([("event", json!("closed"))].into_iter().chain(why))
            }
        }
    }
}

/// What is on a line that carries both directions.
fn said_on_line(connection: u32, said: Said) -> Result<()> {
    let Said { at, offset, bytes, message } = said;
    let (end, content) = match message {
        Some((side, message)) => (side, ("message", message)),
        None => ("unknown", ("bytes", hex(&bytes))),
    };
    let place = [("offset", json!(offset)), ("length", json!(bytes.len())), content];
    Label { at, connection, end }.print(place)
}

impl Connection {
    fn new(args: &LinkArgs, place: &Place) -> Result<Self> {
        let port = match place {
            Place::Tcp(_, server) | Place::Udp(_, server) => server.port(),
            Place::Ports(_) => 0,
            Place::Line(_) => return Ok(Self::Line(Split::new(args)?)),
        };
        let [a, b] = [true, false].map(|is_client| Direction::new(args, (args.link.sender)(is_client, port)));
        Ok(Self::Ends([a?, b?]))
    }
}

impl Direction {
    fn new(args: &LinkArgs, side: Option<&'static str>) -> Result<Self> {
        let Some(side) = side else {
            let end = args.link.ends.iter().find(|end| !args.link.sides.contains(&end.name));
            return Ok(Self { end: end.map_or("", |end| end.name), decoded: None });
        };
        Ok(Self { end: side, decoded: Some(Decoded::new(args, side, 0)?) })
    }

    fn push(&mut self, link: &Link, label: &Label, bytes: &[u8]) -> Result<()> {
        match &mut self.decoded {
            Some(decoded) => decoded.push(link, label, bytes),
            None => label.print([("bytes", hex(bytes))]),
        }
    }

    /// What is before missing bytes and what is after them are no frame together.
    fn skip(&mut self, args: &LinkArgs, label: &Label, missing: u64) -> Result<()> {
        self.finish(args.link, label)?;
        if let Some(decoded) = &mut self.decoded {
            *decoded = Decoded::new(args, decoded.side, decoded.stream.offset() + missing)?;
        }
        Ok(())
    }

    fn finish(&mut self, link: &Link, label: &Label) -> Result<()> {
        let Some(Decoded { stream, held, .. }) = &mut self.decoded else { return Ok(()) };
        stream.finish(|item| show(link, label, item, held))
    }
}

impl Decoded {
    fn new(args: &LinkArgs, side: &'static str, begin: u64) -> Result<Self> {
        Ok(Self { side, stream: Stream::starting_at(args.codec_of(side)?, begin), held: VecDeque::new() })
    }

    fn push(&mut self, link: &Link, label: &Label, bytes: &[u8]) -> Result<()> {
        self.held.extend(bytes);
        let Self { stream, held, .. } = self;
        stream.push(bytes, |item| show(link, label, item, held))
    }
}

/// Prints an item, whose bytes are the first that are held.
fn show(link: &Link, label: &Label, item: Item<'_>, held: &mut VecDeque<u8>) -> Result<()> {
    let length = (item.length as usize).min(held.len());
    let bytes: Vec<u8> = held.drain(..length).collect();
    let place = [("offset", json!(item.offset)), ("length", json!(item.length))];
    let content: Value = serde_json::from_slice(item.json)?;
    match item.kind {
        Kind::Message => label.print(place.into_iter().chain([("message", content)])),
        Kind::Error => {
            let clause = content.get("kind").and_then(Value::as_str).and_then(|kind| link.clause(kind));
            let rest = [("error", content), ("clause", json!(clause)), ("bytes", hex(&bytes))];
            label.print(place.into_iter().chain(rest))
        }
    }
}

fn hex(bytes: &[u8]) -> Value {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect::<String>().into()
}

/// What a line begins with.
struct Label {
    at: SystemTime,
    connection: u32,
    end: &'static str,
}

impl Label {
    fn print(&self, rest: impl IntoIterator<Item = (&'static str, Value)>) -> Result<()> {
        let mut line = Map::new();
        line.insert("time".into(), time(self.at));
        line.insert("connection".into(), json!(self.connection));
        line.insert("from".into(), json!(self.end));
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
        Place::Ports([a, b]) => {
            line["a"] = json!(a);
            line["b"] = json!(b);
        }
        Place::Line(port) => line["port"] = json!(port),
    }
    line
}

fn time(at: SystemTime) -> Value {
    format_rfc3339_micros(at).to_string().into()
}
