//! The decoded messages of both ends.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use anyhow::Result;
use serde_json::Value;

use super::split::{LineBytes, LineSplitter};
use crate::command::codec::LinkArgs;
use crate::io::tap::{ConnectionTransport, End, TapEvent, TapRecord};
use cellwire_links::codec::{Item, Kind, Stream};
use cellwire_links::link::Link;
use cellwire_links::shadow::{self, Complaint, Watcher};

/// An event of an end.
#[derive(Debug, Clone)]
pub(super) struct Entry {
    /// When it was whole.
    pub(super) at: SystemTime,
    /// The number of the connection, from 1.
    pub(super) connection: u32,
    /// The name of the end, or [`UNKNOWN`].
    pub(super) end: &'static str,
    pub(super) what: DecodedEvent,
}

/// On a line that carries both directions: the unknown sender of bytes that neither end sends.
pub(super) const UNKNOWN: &str = "unknown";

/// A message or another event of an end.
#[derive(Debug, Clone)]
pub(super) enum DecodedEvent {
    Opened(ConnectionTransport),
    Message {
        offset: u64,
        length: u64,
        content: Value,
    },
    /// Bytes that are not a message, with the clause that they break.
    Corrupt {
        offset: u64,
        error: Value,
        clause: Option<&'static str>,
        bytes: Vec<u8>,
    },
    /// Bytes of an end that sends no messages, or of an unknown sender.
    Bytes(Vec<u8>),
    /// The end breaks a rule, is late, or shows that an assumption is wrong.
    Wrong(Complaint),
    /// The number of bytes that were passed on, and not seen.
    Missed(u64),
    /// The end sends no more, or its connection broke.
    Closed(Option<String>),
}

/// Decodes the observed bytes.
pub(super) struct TapDecoder<'a> {
    args: &'a LinkArgs,
    /// The rate of the ports.
    baud: Option<u32>,
    connections: BTreeMap<u32, Connection>,
    watchers: BTreeMap<u32, Watcher>,
    /// Connections that an end has closed.
    closed: BTreeSet<u32>,
}

enum Connection {
    /// The bytes of the ends A and B.
    Ends([Direction; 2]),
    /// A line that carries both directions.
    Line(LineSplitter),
}

/// The bytes of one end.
struct Direction {
    /// The name of the end.
    end: &'static str,
    /// `None` where it sends no messages, and polls.
    decoded: Option<SideDecoder>,
    /// The end sends datagrams, each of which is whole.
    is_datagrams: bool,
}

/// A side that sends messages.
struct SideDecoder {
    side: &'static str,
    stream: Box<Stream>,
    /// The bytes that are in no item yet.
    held: VecDeque<u8>,
}

impl<'a> TapDecoder<'a> {
    /// # Errors
    /// When the link has no such setting.
    pub(super) fn new(args: &'a LinkArgs, baud: Option<u32>) -> Result<Self> {
        // Before anything is tapped.
        for side in args.link.sides {
            args.codec_of(side)?;
        }
        args.watcher(baud, baud.is_some())?;
        Ok(Self {
            args,
            baud,
            connections: BTreeMap::new(),
            watchers: BTreeMap::new(),
            closed: BTreeSet::new(),
        })
    }

    /// Handles observed bytes; `tell` gets the messages that are certain now, and the complaints.
    pub(super) fn take(&mut self, seen: &TapRecord, tell: &mut dyn FnMut(Entry) -> Result<()>) -> Result<()> {
        let TapRecord { at, connection, from, what } = seen;
        self.pass_time(*at, tell)?;
        if let TapEvent::Opened(place) = what {
            let is_serial = matches!(place, ConnectionTransport::Ports(_) | ConnectionTransport::Line(_));
            self.watchers.insert(*connection, self.args.watcher(self.baud, is_serial)?);
        }
        match what {
            TapEvent::Opened(_) => _ = self.closed.remove(connection),
            TapEvent::Closed(_) => _ = self.closed.insert(*connection),
            TapEvent::Bytes(_) | TapEvent::Missed(_) => {}
        }
        let mut watcher = self.watchers.remove(connection);
        if let (Some(watcher), TapEvent::Bytes(bytes)) = (&mut watcher, what)
            && let Some(Connection::Ends([a, b])) = self.connections.get(connection)
        {
            let from = if *from == End::A { a.end } else { b.end };
            let complaints = watcher.see(since(*at), &shadow::LineEvent::Bytes { from, bytes });
            complain(*at, *connection, complaints, tell)?;
        }
        let poller = self.args.poller();
        let outcome = self.decode(seen, &mut |entry| {
            let (at, connection) = (entry.at, entry.connection);
            let complaints = watcher.as_mut().map(|watcher| watch(watcher, &entry, poller));
            tell(entry)?;
            complain(at, connection, complaints.unwrap_or_default(), tell)
        });
        if let Some(watcher) = watcher {
            self.watchers.insert(*connection, watcher);
        }
        outcome
    }

    /// Reports the messages that are missing by now.
    fn pass_time(&mut self, at: SystemTime, tell: &mut dyn FnMut(Entry) -> Result<()>) -> Result<()> {
        self.watchers
            .iter_mut()
            .try_for_each(|(connection, watcher)| complain(at, *connection, watcher.pass(since(at)), tell))
    }

    fn decode(&mut self, seen: &TapRecord, tell: &mut dyn FnMut(Entry) -> Result<()>) -> Result<()> {
        let TapRecord { at, connection, from, what } = seen;
        let (at, connection) = (*at, *connection);
        if let TapEvent::Opened(place) = what {
            self.connections.insert(connection, Connection::new(self.args, place)?);
            return tell(Entry { at, connection, end: UNKNOWN, what: DecodedEvent::Opened(place.clone()) });
        }
        let directions = match self.connections.get_mut(&connection) {
            Some(Connection::Ends(directions)) => directions,
            Some(Connection::Line(line)) => {
                let say = |said| tell(said_on_line(connection, said));
                return match what {
                    TapEvent::Bytes(bytes) => line.push(at, bytes, say),
                    _ => line.finish(at, say),
                };
            }
            None => return Ok(()),
        };
        let direction = match (from, directions) {
            (End::A, [a, _]) => a,
            (End::B, [_, b]) => b,
        };
        let end = direction.end;
        let mut tell = |what| tell(Entry { at, connection, end, what });
        match what {
            TapEvent::Opened(_) => Ok(()),
            TapEvent::Bytes(bytes) => direction.push(self.args.link, bytes, &mut tell),
            TapEvent::Missed(missing) => {
                direction.skip(self.args, *missing, &mut tell)?;
                tell(DecodedEvent::Missed(*missing))
            }
            TapEvent::Closed(why) => {
                direction.finish(self.args.link, &mut tell)?;
                tell(DecodedEvent::Closed(why.clone()))
            }
        }
    }

    /// Returns the state of the last connection.
    pub(super) fn state(&self) -> String {
        match self.watchers.last_key_value() {
            Some((connection, _)) if self.closed.contains(connection) => "the connection is closed".into(),
            Some((_, watcher)) => watcher.state(),
            None => String::new(),
        }
    }

    /// Called when no bytes were seen for a while: decodes the buffered bytes of a line as they are.
    pub(super) fn silence(&mut self, tell: &mut dyn FnMut(Entry) -> Result<()>) -> Result<()> {
        self.pass_time(SystemTime::now(), tell)?;
        for (number, connection) in &mut self.connections {
            if let Connection::Line(line) = connection
                && line.holds()
            {
                line.finish(SystemTime::now(), |said| tell(said_on_line(*number, said)))?;
            }
        }
        Ok(())
    }
}

/// Passes an event to the shadow; returns its complaints.
fn watch(watcher: &mut Watcher, entry: &Entry, poller: Option<&'static str>) -> Vec<Complaint> {
    let from = entry.end;
    let seen = match &entry.what {
        // Earlier bytes of lines and ports are unknown.
        DecodedEvent::Opened(ConnectionTransport::Tcp(..)) => shadow::LineEvent::Opened,
        DecodedEvent::Message { length, content, .. } => {
            shadow::LineEvent::Message { from, length: *length, message: content }
        }
        DecodedEvent::Corrupt { error, bytes, .. } => {
            shadow::LineEvent::Corrupt { from, length: bytes.len() as u64, error }
        }
        // On a line that carries both directions.
        DecodedEvent::Bytes(bytes) if from == UNKNOWN => match poller {
            Some(from) => shadow::LineEvent::Bytes { from, bytes },
            None => return Vec::new(),
        },
        DecodedEvent::Missed(_) => shadow::LineEvent::Missed { from },
        DecodedEvent::Closed(_) => shadow::LineEvent::Closed,
        DecodedEvent::Opened(_) | DecodedEvent::Bytes(_) | DecodedEvent::Wrong(_) => return Vec::new(),
    };
    watcher.see(since(entry.at), &seen)
}

fn complain(
    at: SystemTime,
    connection: u32,
    complaints: Vec<Complaint>,
    tell: &mut dyn FnMut(Entry) -> Result<()>,
) -> Result<()> {
    complaints.into_iter().try_for_each(|complaint| {
        tell(Entry { at, connection, end: complaint.end, what: DecodedEvent::Wrong(complaint) })
    })
}

/// Returns the time of a shadow.
fn since(at: SystemTime) -> Duration {
    at.duration_since(UNIX_EPOCH).unwrap_or_default()
}

/// Returns the entry for bytes on a line that carries both directions.
fn said_on_line(connection: u32, said: LineBytes) -> Entry {
    let LineBytes { at, offset, bytes, message } = said;
    let (end, what) = match message {
        Some((side, content)) => {
            (side, DecodedEvent::Message { offset, length: bytes.len() as u64, content })
        }
        None => (UNKNOWN, DecodedEvent::Bytes(bytes)),
    };
    Entry { at, connection, end, what }
}

impl Connection {
    fn new(args: &LinkArgs, place: &ConnectionTransport) -> Result<Self> {
        let port = match place {
            ConnectionTransport::Tcp(_, server) | ConnectionTransport::Udp(_, server) => server.port(),
            ConnectionTransport::Ports(_) => 0,
            ConnectionTransport::Line(_) => return Ok(Self::Line(LineSplitter::new(args)?)),
        };
        let is_datagrams = matches!(place, ConnectionTransport::Udp(..));
        let [a, b] = [true, false]
            .map(|is_client| Direction::new(args, (args.link.sender)(is_client, port), is_datagrams));
        Ok(Self::Ends([a?, b?]))
    }
}

type EventSink<'a> = &'a mut dyn FnMut(DecodedEvent) -> Result<()>;

impl Direction {
    fn new(args: &LinkArgs, side: Option<&'static str>, is_datagrams: bool) -> Result<Self> {
        let Some(side) = side else {
            let end = args.link.ends.iter().find(|end| !args.link.sides.contains(&end.name));
            return Ok(Self { end: end.map_or(UNKNOWN, |end| end.name), decoded: None, is_datagrams });
        };
        Ok(Self { end: side, decoded: Some(SideDecoder::new(args, side, 0)?), is_datagrams })
    }

    fn push(&mut self, link: &Link, bytes: &[u8], tell: EventSink<'_>) -> Result<()> {
        let Some(SideDecoder { stream, held, .. }) = &mut self.decoded else {
            return tell(DecodedEvent::Bytes(bytes.into()));
        };
        // Flow control is in no item.
        let (flow, data): (Vec<u8>, Vec<u8>) =
            bytes.iter().partition(|byte| link.flow_control.is_some_and(|bytes| bytes.contains(byte)));
        held.extend(data);
        stream.push(bytes, |item| tell(told(link, item, held)?))?;
        if self.is_datagrams {
            stream.finish(|item| tell(told(link, item, held)?))?;
        }
        if flow.is_empty() { Ok(()) } else { tell(DecodedEvent::Bytes(flow)) }
    }

    /// Skips missing bytes: those before and after them are not one frame.
    fn skip(&mut self, args: &LinkArgs, missing: u64, tell: EventSink<'_>) -> Result<()> {
        self.finish(args.link, tell)?;
        if let Some(decoded) = &mut self.decoded {
            *decoded = SideDecoder::new(args, decoded.side, decoded.stream.offset() + missing)?;
        }
        Ok(())
    }

    fn finish(&mut self, link: &Link, tell: EventSink<'_>) -> Result<()> {
        let Some(SideDecoder { stream, held, .. }) = &mut self.decoded else { return Ok(()) };
        stream.finish(|item| tell(told(link, item, held)?))
    }
}

impl SideDecoder {
    fn new(args: &LinkArgs, side: &'static str, begin: u64) -> Result<Self> {
        Ok(Self { side, stream: Box::new(args.stream_of(side, begin)?), held: VecDeque::new() })
    }
}

/// Returns an item, whose bytes are the first in the buffer.
fn told(link: &Link, item: Item<'_>, held: &mut VecDeque<u8>) -> Result<DecodedEvent> {
    let Item { offset, length, kind, json } = item;
    let length_held = usize::try_from(length).unwrap_or(usize::MAX).min(held.len());
    let bytes: Vec<u8> = held.drain(..length_held).collect();
    let content: Value = serde_json::from_slice(json)?;
    Ok(match kind {
        Kind::Message => DecodedEvent::Message { offset, length, content },
        Kind::Error => {
            let clause = content.get("kind").and_then(Value::as_str).and_then(|kind| link.clause(kind));
            DecodedEvent::Corrupt { offset, error: content, clause, bytes }
        }
    })
}

/// Returns bytes as hex text.
pub(super) fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Cli {
        #[command(flatten)]
        of: LinkArgs,
    }

    #[test]
    fn a_connection_that_was_seen_from_its_beginning_is_closed_and_not_unknown() {
        let cli = Cli::parse_from(["tap", "ball"]);
        let mut decoding = TapDecoder::new(&cli.of, None).unwrap();
        let mut state = |what| {
            let seen = TapRecord { at: UNIX_EPOCH, connection: 1, from: End::A, what };
            decoding.take(&seen, &mut |_| Ok(())).unwrap();
            decoding.state()
        };
        let place =
            || ConnectionTransport::Tcp("127.0.0.1:4000".parse().unwrap(), "127.0.0.1:9600".parse().unwrap());
        assert_eq!(state(TapEvent::Opened(place())), "no poll is open");
        assert_eq!(state(TapEvent::Bytes([5].as_slice().into())), "a poll waits for its packet");
        assert_eq!(state(TapEvent::Closed(None)), "the connection is closed");
        assert_eq!(state(TapEvent::Opened(place())), "no poll is open");
        assert_eq!(state(TapEvent::Missed(1)), "the state is not known yet");
    }
}
