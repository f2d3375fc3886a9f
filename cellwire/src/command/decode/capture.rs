//! The connections of a capture, each direction decoded separately; with --shadow, both are checked against the specification.

use core::fmt::Write as _;
use std::collections::HashMap;
use std::io::Read;
use std::net::SocketAddr;
use std::time::{Duration, UNIX_EPOCH};

use anyhow::{Context as _, Result, ensure};
use humantime::format_rfc3339_micros;
use serde::Serialize;
use serde_json::{Value, json};

use super::{Args, Lines};
use crate::command::source::report;
use crate::io::capture::connections::{self, Directions};
use crate::io::capture::reassembly::Piece;
use crate::io::capture::write::SERIAL;
use crate::io::capture::{Fault, Flow, Line, Reading};
use cellwire_io::output::{counted, remark};
use cellwire_links::codec::{Item, Kind, Stream};
use cellwire_links::shadow::{self, Complaint, LineEvent, Watcher};

/// Decodes every flow of a capture.
///
/// # Errors
/// If the input is not a capture, or contains nothing for the link.
pub(super) fn decode(args: &Args, reading: &Reading, input: Box<dyn Read>, out: &mut Lines) -> Result<()> {
    let (summary, found) = connections::read(input, reading, &mut FlowDecoder::new(args, out))?;
    report(&summary);
    ensure!(
        found || !out.clean,
        "the capture has no TCP, UDP or serial bytes for {}{}",
        args.codec.of.link.short,
        args.source.on_port()
    );
    Ok(())
}

/// Each direction becomes lines.
struct FlowDecoder<'a> {
    args: &'a Args,
    out: &'a mut Lines,
    now: Duration,
    /// The watcher of each conversation.
    watchers: HashMap<Ends, Watcher>,
}

/// The two ends of a conversation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum Ends {
    /// A client's and a server's, counted from 1 for the same two.
    Network(SocketAddr, SocketAddr, u64),
    /// A program and the end at the other side of its line.
    Kept(Line),
}

/// How lines have the time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Clock {
    /// `"at"`: seconds since the beginning of a trace.
    Trace,
    /// `"time"`: that of the packet.
    Packets,
}

struct Decoded {
    stream: Stream,
    side: &'static str,
    /// The fields of the direction, before those of a line.
    label: String,
    /// The conversation of this direction, if it is watched, and the end that sends.
    watched: Option<(Ends, &'static str)>,
    /// The number of bytes that are not a message, if the end may be one that only polls.
    polls: Option<u64>,
    /// The direction consists of datagrams, each of which is whole.
    is_datagrams: bool,
    /// The fields of `label` before its time.
    untimed: String,
    clock: Clock,
}

impl<'a> FlowDecoder<'a> {
    fn new(args: &'a Args, out: &'a mut Lines) -> Self {
        Self { args, out, now: Duration::ZERO, watchers: HashMap::new() }
    }

    /// Returns the conversation of a direction.
    fn watch(&mut self, flow: Flow, is_client: bool, number: u64, is_whole: bool) -> Result<Option<Ends>> {
        if !self.args.shadow {
            return Ok(None);
        }
        let (ends, is_serial) = match flow {
            Flow::Tcp(from, to) | Flow::Udp(from, to) => {
                let (client, server) = if is_client { (from, to) } else { (to, from) };
                // The address of a line in a tap's capture.
                (Ends::Network(client, server, number), server == SERIAL[1].into())
            }
            Flow::Kept(line, _) => (Ends::Kept(line), true),
            Flow::Serial(_) => return Ok(None),
        };
        if !self.watchers.contains_key(&ends) {
            // Earlier bytes of a line are unknown.
            let mut watcher = self.args.codec.of.watcher(None, is_serial)?;
            if is_whole && !is_serial {
                watcher.see(self.now, &LineEvent::Opened);
            }
            self.watchers.insert(ends, watcher);
        }
        Ok(Some(ends))
    }

    /// Reports the complaints about an event.
    fn see(&mut self, ends: &Ends, seen: &LineEvent<'_>) -> Result<()> {
        let Some(watcher) = self.watchers.get_mut(ends) else { return Ok(()) };
        let complaints = watcher.see(self.now, seen);
        self.out.complain(ends, self.now, &complaints)
    }
}

impl Directions for FlowDecoder<'_> {
    type Direction = Box<Decoded>;

    fn pass_time(&mut self, at: Duration) -> Result<()> {
        self.now = self.now.max(at);
        for (ends, watcher) in &mut self.watchers {
            self.out.complain(ends, self.now, &watcher.pass(self.now))?;
        }
        Ok(())
    }

    fn begin(
        &mut self,
        flow: Flow,
        is_client: bool,
        connection: u64,
        is_whole: bool,
    ) -> Result<Option<Box<Decoded>>> {
        let mut begun = begin(self.args, flow, is_client, connection)?;
        if let Some((decoded, sender)) = &mut begun
            && let Some(ends) = self.watch(flow, is_client, connection, is_whole)?
        {
            let poller = self.args.codec.of.poller().unwrap_or(decoded.side);
            decoded.watched = Some((ends, sender.unwrap_or(poller)));
        }
        Ok(begun.map(|(decoded, _)| decoded))
    }

    fn take(&mut self, decoded: &mut Box<Decoded>, piece: Piece<'_>) -> Result<()> {
        if let (Some((ends, from)), Piece::Bytes(bytes)) = (decoded.watched, piece) {
            self.see(&ends, &LineEvent::Bytes { from, bytes })?;
        }
        decoded.label.clone_from(&decoded.untimed);
        match decoded.clock {
            // A quotient of whole numbers is the number that is nearest to the text of the trace.
            Clock::Trace => write!(decoded.label, "\"at\":{},", json!(self.now.as_micros() as f64 / 1e6))?,
            // A dump of bytes has no times.
            Clock::Packets if self.now.is_zero() => {}
            Clock::Packets => {
                write!(decoded.label, "\"time\":\"{}\",", format_rfc3339_micros(UNIX_EPOCH + self.now))?;
            }
        }
        let mut said = Vec::new();
        decoded.take(self.args, piece, self.out, &mut said)?;
        let Some((ends, from)) = decoded.watched else { return Ok(()) };
        for (kind, length, json) in said {
            // Skip the end that only polls: its bytes are not messages.
            if from != decoded.side {
                continue;
            }
            let json: Value = serde_json::from_slice(&json)?;
            let seen = match kind {
                _ if length == 0 => LineEvent::Missed { from },
                Kind::Message => LineEvent::Message { from, length, message: &json },
                Kind::Error => LineEvent::Corrupt { from, length, error: &json },
            };
            self.see(&ends, &seen)?;
        }
        Ok(())
    }

    fn end(&mut self, decoded: Box<Decoded>) -> Result<()> {
        let Decoded { mut stream, label, watched, mut polls, .. } = *decoded;
        if let Some((ends, _)) = watched {
            self.watchers.remove(&ends);
        }
        stream.finish(|item| write(&label, &mut polls, self.out, item))?;
        if let Some(bytes @ 1..) = polls {
            let bytes = counted(bytes, "byte");
            remark(&format!("skipped {bytes} of the end that sends no messages"));
        }
        Ok(())
    }

    /// Writes a line of the capture itself: `{"packet":…,"error":{…}}`.
    fn fault(&mut self, packet: u64, fault: &Fault) -> Result<()> {
        self.out.fault(format_args!("{}\n", json!({"packet": packet, "error": fault})))
    }
}

impl Lines {
    /// Writes a line for each complaint: `{"time":…,"ends":…,"from":…,"shadow":…,"clause":…,"text":…}`.
    fn complain(&mut self, ends: &Ends, at: Duration, complaints: &[Complaint]) -> Result<()> {
        for Complaint { end, kind, clause, text, .. } in complaints {
            self.clean &= *kind != shadow::Kind::Rule;
            let (between, number) = match ends {
                Ends::Network(client, server, number) => (format!("{client} > {server}"), *number),
                Ends::Kept(line) => (format!("program > {line}"), 1),
            };
            let mut line = json!({
                "time": format_rfc3339_micros(UNIX_EPOCH + at).to_string(),
                "ends": between,
                "from": end,
                "shadow": kind,
                "clause": clause,
                "text": text,
            });
            if let (Some(line), 2..) = (line.as_object_mut(), number) {
                line.insert("connection".into(), json!(number));
            }
            self.line(format_args!("{line}\n"))?;
        }
        Ok(())
    }
}

/// Begins a direction: returns its decoder, and the sending side, if it is known.
fn begin(
    args: &Args,
    flow: Flow,
    is_client: bool,
    number: u64,
) -> Result<Option<(Box<Decoded>, Option<&'static str>)>> {
    let wanted = args.codec.from.as_deref();
    let (mut sender, mut polls) = (None, None);
    let (side, mut label) = match flow {
        Flow::Tcp(from, to) | Flow::Udp(from, to) => {
            let server = if is_client { to.port() } else { from.port() };
            sender = (args.codec.of.link.sender)(is_client, server);
            // The end that polls is not certain enough to leave its messages out.
            polls = sender.is_none().then_some(0);
            let side = sender.map_or_else(|| args.codec.of.link.side(None), Ok)?;
            if wanted.is_some_and(|wanted| wanted != side) {
                return Ok(None);
            }
            (side, format!("\"flow\":{},\"from\":{},", json!(format!("{from} > {to}")), json!(side)))
        }
        Flow::Kept(Line::Trace(name), by_keeper) => {
            sender = traced(args, name, by_keeper)?;
            polls = sender.is_none().then_some(0);
            let side = sender.map_or_else(|| args.codec.of.link.side(None), Ok)?;
            (side, format!("\"from\":{},", json!(side)))
        }
        Flow::Kept(line, by_keeper) => {
            let Some(side) = args.codec.of.link.keeper(wanted, by_keeper)? else { return Ok(None) };
            sender = Some(side);
            let ends = if by_keeper { format!("program > {line}") } else { format!("{line} > program") };
            (side, format!("\"flow\":{},\"from\":{},", json!(ends), json!(side)))
        }
        Flow::Serial(0) => (args.codec.side()?, String::new()),
        Flow::Serial(interface) => (args.codec.side()?, format!("\"interface\":{interface},")),
    };
    if number > 1 {
        label.push_str(&format!("\"connection\":{number},"));
    }
    let is_datagrams = matches!(flow, Flow::Udp(..));
    let clock = if matches!(flow, Flow::Kept(Line::Trace(_), _)) { Clock::Trace } else { Clock::Packets };
    let stream = args.codec.of.stream_of(side, 0)?;
    let untimed = label.clone();
    Ok(Some((
        Box::new(Decoded { stream, side, label, watched: None, polls, is_datagrams, untimed, clock }),
        sender,
    )))
}

/// Returns the side that sent the bytes that a trace lists as sent, or as received: by `--from`, the end that wrote the
/// trace, or by the trace's name.
fn traced(args: &Args, name: &str, by_keeper: bool) -> Result<Option<&'static str>> {
    let link = args.codec.of.link;
    match args.codec.from.as_deref() {
        Some(from) => link.keeper(Some(from), by_keeper),
        None => link.traced(name, by_keeper).with_context(|| {
            let sides = link.sides.join(" or ");
            format!(
                "`{name}` is not an end of {}: give the end that wrote the trace, --from {sides}",
                link.short
            )
        }),
    }
}

/// Writes an item; for an end that may only poll, only messages and missing bytes.
fn write(label: &str, polls: &mut Option<u64>, out: &mut Lines, item: Item<'_>) -> Result<()> {
    match polls {
        Some(bytes) if item.kind == Kind::Error && item.length > 0 => *bytes += item.length,
        _ => out.write(label, item)?,
    }
    Ok(())
}

/// The bytes of a flow that the capture lacks.
#[derive(Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
enum MissingBytes {
    /// No packet has these bytes.
    Gap { missing: u64 },
    /// The capture has cut them off.
    CutOff { missing: u64 },
    /// The bytes came after their gap was reported.
    Late { bytes: u64 },
    /// The bytes are before the first captured ones.
    BeforeStart { bytes: u64 },
}

/// The kind of an item of a stream, the number of its bytes, and its object.
type DecodedItem = (Kind, u64, Vec<u8>);

impl Decoded {
    /// Decodes a piece; `said` gets the items for the watcher.
    fn take(
        &mut self,
        args: &Args,
        piece: Piece<'_>,
        out: &mut Lines,
        said: &mut Vec<DecodedItem>,
    ) -> Result<()> {
        let is_watched = self.watched.is_some();
        let polls = &mut self.polls;
        let mut write = |label: &str, item: Item<'_>| {
            if is_watched {
                said.push((item.kind, item.length, item.json.to_vec()));
            }
            write(label, polls, out, item)
        };
        let lack = match piece {
            Piece::Bytes(bytes) => {
                self.stream.push(bytes, |item| write(&self.label, item))?;
                if self.is_datagrams {
                    self.stream.finish(|item| write(&self.label, item))?;
                }
                return Ok(());
            }
            Piece::Gap(missing) => MissingBytes::Gap { missing },
            Piece::Cut(missing) => MissingBytes::CutOff { missing },
            Piece::Late(bytes) => MissingBytes::Late { bytes },
            Piece::BeforeStart(bytes) => MissingBytes::BeforeStart { bytes },
        };
        let offset = self.stream.offset();
        if let MissingBytes::Gap { .. } | MissingBytes::CutOff { .. } = lack {
            // The bytes before and after the gap are not one frame.
            let next = args.codec.of.stream_of(self.side, offset)?;
            core::mem::replace(&mut self.stream, next).finish(|item| write(&self.label, item))?;
        }
        let mut json = Vec::new();
        cellwire_links::json::write(&lack, &mut json)?;
        write(&self.label, Item { offset, length: 0, kind: Kind::Error, json: &json })
    }
}
