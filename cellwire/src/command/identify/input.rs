//! The bytes of each conversation.

use std::io::{BufRead, Read};
use std::time::Duration;

use anyhow::{Context, Result, ensure};
use cellwire_identify::{Sender, Stream};
use cellwire_links::link::Carrier;

use super::Args;
use crate::command::decode::hex::HexReader;
use crate::command::source::{Format, report};
use crate::io::capture::connections::{self, Directions};
use crate::io::capture::reassembly::Piece;
use crate::io::capture::{Fault, Flow, Line, Reading};
use cellwire_io::output::{counted, remark};

/// The number of bytes of each stream that are read.
const MAX_STREAM_LEN: u64 = 1 << 20;
/// The number of conversations that are examined: those with most bytes.
const CONVERSATIONS: usize = 8;

/// The bytes of both ends of one link, on any number of connections.
#[derive(Debug)]
pub(super) struct Conversation {
    pub(super) name: String,
    pub(super) carrier: Carrier,
    pub(super) streams: Vec<Stream>,
}

impl Conversation {
    pub(super) fn len(&self) -> usize {
        self.streams.iter().flat_map(|stream| &stream.parts).map(Vec::len).sum()
    }
}

/// Reads the input.
pub(super) fn read(args: &Args) -> Result<Vec<Conversation>> {
    let (format, input) = args.source.open()?;
    let mut all = match args.source.reading(format) {
        Some(reading) => capture(args, &reading, input)?,
        None => vec![stream(args, format, input)?],
    };
    all.retain(|conversation| conversation.len() > 0);
    ensure!(!all.is_empty(), "the input is empty");
    all.sort_by_key(|conversation| core::cmp::Reverse(conversation.len()));
    if let Some((first, rest)) = all.split_at_checked(CONVERSATIONS).filter(|(_, rest)| !rest.is_empty()) {
        let (looked, others) = (first.len(), rest.len());
        remark(&format!(
            "only the {looked} largest conversations are examined, not {}: choose with --port",
            counted(others, "other")
        ));
        all.truncate(CONVERSATIONS);
    }
    Ok(all)
}

fn stream(args: &Args, format: Format, input: Box<dyn BufRead>) -> Result<Conversation> {
    let (mut bytes, mut hex) = (Vec::new(), HexReader::default());
    let mut input = input;
    loop {
        let chunk = input.fill_buf().context("cannot read the input")?;
        let taken = chunk.len();
        if taken == 0 || bytes.len() as u64 >= MAX_STREAM_LEN {
            break;
        }
        match format {
            Format::Hex => bytes.extend(hex.read(chunk)?),
            _ => bytes.extend_from_slice(chunk),
        }
        input.consume(taken);
    }
    if bytes.len() as u64 >= MAX_STREAM_LEN {
        remark("only the first 1 MiB is examined");
    } else if let Format::Hex = format {
        hex.finish()?;
    }
    let sender = args.from.clone().map_or(Sender::Unknown, Sender::Named);
    Ok(Conversation {
        name: "the input".into(),
        carrier: Carrier::Unknown,
        streams: vec![Stream { sender, parts: vec![bytes], arrivals: Vec::new() }],
    })
}

fn capture(args: &Args, reading: &Reading, input: Box<dyn Read>) -> Result<Vec<Conversation>> {
    let mut collecting = StreamCollector {
        from: args.from.as_deref(),
        conversations: Vec::new(),
        faults: 0,
        cut: false,
        at: Duration::ZERO,
        now: Duration::ZERO,
    };
    let (summary, found) = connections::read(input, reading, &mut collecting)?;
    report(&summary);
    let StreamCollector { conversations, faults, cut, .. } = collecting;
    if faults > 0 {
        remark(&format!("{} could not be read; cellwire decode lists them", counted(faults, "packet")));
    }
    if cut {
        remark("only the first 1 MiB of each direction is examined");
    }
    ensure!(found, "the capture has no TCP, UDP or serial bytes{}", args.source.on_port());
    Ok(conversations)
}

/// Returns the time of bytes that came after others: the capture may lack the time, or have the same one.
fn after(before: Duration, at: Duration) -> Duration {
    at.max(before.saturating_add(Duration::from_nanos(1)))
}

struct StreamCollector<'a> {
    from: Option<&'a str>,
    conversations: Vec<Conversation>,
    faults: usize,
    cut: bool,
    /// The time of the last packet, where it has one.
    at: Duration,
    /// The time of the last piece, which shows the direction that came first.
    now: Duration,
}

/// A direction, and where it goes.
struct CollectedStream {
    name: String,
    carrier: Carrier,
    stream: Stream,
    len: u64,
}

impl Directions for StreamCollector<'_> {
    type Direction = CollectedStream;

    fn pass_time(&mut self, at: Duration) -> Result<()> {
        self.at = at;
        Ok(())
    }

    fn begin(&mut self, flow: Flow, is_client: bool, _: u64, _: bool) -> Result<Option<CollectedStream>> {
        let (name, sender, carrier) = match flow {
            Flow::Tcp(from, to) | Flow::Udp(from, to) => {
                let server = if is_client { to } else { from };
                let kind = if let Flow::Tcp(..) = flow { "TCP" } else { "UDP" };
                (
                    format!("{kind} {server}"),
                    Sender::Connected { is_client, port: server.port() },
                    Carrier::Network,
                )
            }
            Flow::Serial(_) => ("the serial line".into(), Sender::Unknown, Carrier::Serial(None)),
            Flow::Kept(Line::Trace(name), sent) => {
                (name.into(), Sender::Traced { name: name.into(), sent }, Carrier::Unknown)
            }
            Flow::Kept(line, is_client) => {
                (line.to_string(), Sender::Kept { by_keeper: is_client }, Carrier::Serial(None))
            }
        };
        let sender = match (self.from, flow) {
            (Some(from), Flow::Serial(_) | Flow::Kept(_, true)) => Sender::Named(from.into()),
            (Some(from), Flow::Kept(_, false)) => Sender::Other(from.into()),
            _ => sender,
        };
        Ok(Some(CollectedStream {
            name,
            carrier,
            stream: Stream { sender, parts: vec![Vec::new()], arrivals: Vec::new() },
            len: 0,
        }))
    }

    fn take(&mut self, direction: &mut CollectedStream, piece: Piece<'_>) -> Result<()> {
        match piece {
            Piece::Bytes(bytes) if direction.len < MAX_STREAM_LEN => {
                direction.len += bytes.len() as u64;
                self.now = after(self.now, self.at);
                direction.stream.arrivals.push((direction.stream.size(), self.now));
                if let Some(part) = direction.stream.parts.last_mut() {
                    part.extend_from_slice(bytes);
                }
            }
            Piece::Bytes(_) => self.cut = true,
            // The bytes before and after the gap are not one message.
            Piece::Gap(_) | Piece::Cut(_) => direction.stream.parts.push(Vec::new()),
            Piece::Late(_) | Piece::BeforeStart(_) => {}
        }
        Ok(())
    }

    fn end(&mut self, CollectedStream { name, carrier, stream, .. }: CollectedStream) -> Result<()> {
        match self.conversations.iter_mut().find(|conversation| conversation.name == name) {
            Some(conversation) => conversation.streams.push(stream),
            None => self.conversations.push(Conversation { name, carrier, streams: vec![stream] }),
        }
        Ok(())
    }

    fn fault(&mut self, _: u64, _: &Fault) -> Result<()> {
        self.faults += 1;
        Ok(())
    }
}
