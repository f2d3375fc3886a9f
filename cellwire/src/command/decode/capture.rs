//! The connections of a capture, each direction decoded by itself.

use std::collections::HashMap;
use std::io::Read;
use std::net::SocketAddr;

use anyhow::{Result, ensure};
use serde::Serialize;
use serde_json::json;

use super::{Args, Lines};
use crate::io::capture::reassembly::{Piece, Reassembly};
use crate::io::capture::{self, Fault, Flow, Found, Packet, Segment, Summary};
use crate::io::output::remark;
use cellwire_links::codec::{Item, Kind, Stream};

/// So many connections are kept at once. With more, the half that has been silent the longest ends: what is incomplete in them is
/// an error, and what follows is another connection. A connection takes what its two decoders hold, and the segments that wait.
const MAX_CONNECTIONS: usize = 2048;

/// Decodes every flow of a capture.
///
/// # Errors
/// When the input is no capture, or holds nothing for the link.
pub(super) fn decode(args: &Args, input: Box<dyn Read + Send>, out: &mut Lines) -> Result<()> {
    let mut table = Table { args, connections: HashMap::new(), clock: 0, found: false };
    let summary = capture::read(input, |found| match found {
        Found::Packet(packet) => table.take(&packet, out),
        Found::Fault(number, fault) => write_fault(number, &fault, out),
    })?;
    table.finish(out)?;
    report(&summary);
    ensure!(
        table.found || !out.clean,
        "the capture contains no TCP, UDP or serial bytes for {}{}",
        args.codec.of.link.name,
        args.port.map_or_else(String::new, |port| format!(" on port {port}"))
    );
    Ok(())
}

/// A line of the capture itself: `{"packet":…,"error":{…}}`.
fn write_fault(packet: u64, fault: &Fault, out: &mut Lines) -> Result<()> {
    out.fault(format_args!("{}\n", json!({"packet": packet, "error": fault})))
}

/// What never holds bytes of a link is counted on standard error: it is no fault.
fn report(summary: &Summary) {
    if summary.others.is_empty() {
        return;
    }
    let total: u64 = summary.others.values().sum();
    let others: Vec<String> = summary.others.iter().map(|(what, count)| format!("{count} {what}")).collect();
    let packets = summary.packets;
    remark(&format!("{total} of {packets} packets are neither TCP nor UDP: {}", others.join(", ")));
}

/// Two ends, the lesser first; a serial line has none.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum Ends {
    Tcp(SocketAddr, SocketAddr),
    Udp(SocketAddr, SocketAddr),
    Serial(usize),
}

impl Ends {
    /// The ends, and which of them sends.
    fn of(flow: Flow) -> (Self, usize) {
        let ordered = |a: SocketAddr, b: SocketAddr| if a <= b { (a, b, 0) } else { (b, a, 1) };
        match flow {
            Flow::Tcp(from, to) => {
                let (a, b, sender) = ordered(from, to);
                (Self::Tcp(a, b), sender)
            }
            Flow::Udp(from, to) => {
                let (a, b, sender) = ordered(from, to);
                (Self::Udp(a, b), sender)
            }
            Flow::Serial(interface) => (Self::Serial(interface), 0),
        }
    }
}

struct Table<'a> {
    args: &'a Args,
    connections: HashMap<Ends, Connection>,
    /// Counts packets.
    clock: u64,
    /// Whether there was anything for the link.
    found: bool,
}

/// What is known of two ends.
#[derive(Default)]
struct Connection {
    /// Counted from 1 for these ends.
    number: u64,
    /// Which end opened it, if the capture has that.
    client: Option<usize>,
    directions: [Direction; 2],
    last: u64,
}

/// One direction.
#[derive(Default)]
struct Direction {
    tcp: Reassembly,
    state: State,
}

#[derive(Default)]
enum State {
    /// Nothing was sent yet.
    #[default]
    Silent,
    /// It is not that of the requested side.
    Ignored,
    Decoded(Box<Decoded>),
}

struct Decoded {
    stream: Stream,
    side: &'static str,
    /// Its fields before those of a line.
    label: String,
}

impl Table<'_> {
    fn take(&mut self, packet: &Packet<'_>, out: &mut Lines) -> Result<()> {
        if !self.is_wanted(packet.flow) {
            return Ok(());
        }
        self.clock += 1;
        let (ends, sender) = Ends::of(packet.flow);
        if self.connections.len() >= MAX_CONNECTIONS && !self.connections.contains_key(&ends) {
            self.forget_the_silent(out)?;
        }
        let connection =
            self.connections.entry(ends).or_insert_with(|| Connection { number: 1, ..Connection::default() });
        connection.last = self.clock;
        if let Some(segment) = packet.segment {
            connection.open(sender, segment, self.args, out)?;
        }
        if packet.payload.is_empty() && packet.missing == 0 {
            return Ok(());
        }
        let Connection { number, client, directions, .. } = connection;
        let Some(direction) = directions.get_mut(sender) else { return Ok(()) };
        if let State::Silent = direction.state {
            direction.state = begin(self.args, packet.flow, client.map(|client| client == sender), *number)?;
        }
        let State::Decoded(decoded) = &mut direction.state else { return Ok(()) };
        self.found = true;
        match packet.segment {
            Some(Segment { sequence, .. }) => {
                let (payload, cut) = (packet.payload, packet.missing);
                direction.tcp.push(sequence, payload, cut, |piece| decoded.take(self.args, piece, out))
            }
            None => {
                if !packet.payload.is_empty() {
                    decoded.take(self.args, Piece::Bytes(packet.payload), out)?;
                }
                match packet.missing {
                    0 => Ok(()),
                    cut => decoded.take(self.args, Piece::Cut(cut), out),
                }
            }
        }
    }

    fn is_wanted(&self, flow: Flow) -> bool {
        match (self.args.port, flow) {
            (None, _) | (_, Flow::Serial(_)) => true,
            (Some(port), Flow::Tcp(from, to) | Flow::Udp(from, to)) => {
                from.port() == port || to.port() == port
            }
        }
    }

    fn forget_the_silent(&mut self, out: &mut Lines) -> Result<()> {
        let mut times: Vec<u64> = self.connections.values().map(|connection| connection.last).collect();
        let middle = times.len() / 2;
        let (_, limit, _) = times.select_nth_unstable(middle);
        let limit = *limit;
        let silent: Vec<(u64, Ends)> = self
            .connections
            .iter()
            .map(|(ends, it)| (it.last, *ends))
            .filter(|(last, _)| *last < limit)
            .collect();
        self.end(silent, out)
    }

    fn finish(&mut self, out: &mut Lines) -> Result<()> {
        let all = self.connections.iter().map(|(ends, connection)| (connection.last, *ends)).collect();
        self.end(all, out)
    }

    /// In the order of their last packets.
    fn end(&mut self, mut ended: Vec<(u64, Ends)>, out: &mut Lines) -> Result<()> {
        ended.sort_unstable_by_key(|(last, _)| *last);
        for (_, ends) in ended {
            if let Some(connection) = self.connections.remove(&ends) {
                connection.end(self.args, out)?;
            }
        }
        Ok(())
    }
}

impl Connection {
    /// A segment that opens a direction: again, for the first time, or of another connection between the same ports.
    fn open(&mut self, sender: usize, segment: Segment, args: &Args, out: &mut Lines) -> Result<()> {
        if !segment.opens {
            return Ok(());
        }
        let is_another =
            self.directions.get_mut(sender).is_some_and(|direction| direction.tcp.open(segment.sequence));
        if is_another {
            let number = self.number + 1;
            let last = self.last;
            core::mem::replace(self, Self { number, last, ..Self::default() }).end(args, out)?;
            if let Some(direction) = self.directions.get_mut(sender) {
                direction.tcp.open(segment.sequence);
            }
        }
        self.client = Some(if segment.accepts { 1 - sender } else { sender });
        Ok(())
    }

    fn end(self, args: &Args, out: &mut Lines) -> Result<()> {
        for Direction { mut tcp, state } in self.directions {
            if let State::Decoded(mut decoded) = state {
                tcp.finish(|piece| decoded.take(args, piece, out))?;
                let Decoded { mut stream, label, .. } = *decoded;
                stream.finish(|item| out.write(&label, item))?;
            }
        }
        Ok(())
    }
}

/// How a direction begins: which side sends, and what its lines are called.
fn begin(args: &Args, flow: Flow, is_client: Option<bool>, number: u64) -> Result<State> {
    let wanted = args.codec.from.as_deref();
    let (side, mut label) = match flow {
        Flow::Tcp(from, to) | Flow::Udp(from, to) => {
            // If the capture lacks the beginning of the connection, the lower port counts as the server's.
            let is_client = is_client.unwrap_or(from.port() > to.port());
            let server = if is_client { to.port() } else { from.port() };
            // Which of the two polls is not sure enough to leave its bytes out.
            let side = (args.codec.of.link.sender)(is_client, server)
                .map_or_else(|| args.codec.of.link.side(None), Ok)?;
            if wanted.is_some_and(|wanted| wanted != side) {
                return Ok(State::Ignored);
            }
            (side, format!("\"flow\":{},\"from\":{},", json!(format!("{from} > {to}")), json!(side)))
        }
        Flow::Serial(0) => (args.codec.side()?, String::new()),
        Flow::Serial(interface) => (args.codec.side()?, format!("\"interface\":{interface},")),
    };
    if number > 1 {
        label.push_str(&format!("\"connection\":{number},"));
    }
    let stream = Stream::new(args.codec.of.codec_of(side)?);
    Ok(State::Decoded(Box::new(Decoded { stream, side, label })))
}

/// What the capture lacks of a flow.
#[derive(Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
enum Lack {
    /// No packet has these bytes.
    Gap { missing: u64 },
    /// The capture has cut them off.
    CutOff { missing: u64 },
    /// They came after their gap was reported.
    Late { bytes: u64 },
    /// They are before what was captured first.
    BeforeStart { bytes: u64 },
}

impl Decoded {
    fn take(&mut self, args: &Args, piece: Piece<'_>, out: &mut Lines) -> Result<()> {
        let lack = match piece {
            Piece::Bytes(bytes) => return self.stream.push(bytes, |item| out.write(&self.label, item)),
            Piece::Gap(missing) => Lack::Gap { missing },
            Piece::Cut(missing) => Lack::CutOff { missing },
            Piece::Late(bytes) => Lack::Late { bytes },
            Piece::BeforeStart(bytes) => Lack::BeforeStart { bytes },
        };
        let offset = self.stream.offset();
        if let Lack::Gap { .. } | Lack::CutOff { .. } = lack {
            // What is before the gap and what is after it are no frame together.
            let next = Stream::starting_at(args.codec.of.codec_of(self.side)?, offset);
            core::mem::replace(&mut self.stream, next).finish(|item| out.write(&self.label, item))?;
        }
        let mut json = Vec::new();
        cellwire_links::json::write(&lack, &mut json)?;
        out.write(&self.label, Item { offset, length: 0, kind: Kind::Error, json: &json })
    }
}
