//! The connections of a capture: each direction separately, in order.

use std::collections::BTreeMap;
use std::io::Read;
use std::net::SocketAddr;
use std::time::Duration;

use anyhow::Result;

use super::reassembly::{Piece, Reassembly};
use super::{CaptureItem, Fault, Flow, Line, Packet, Reading, Segment, Summary};

/// The number of connections that are kept at once. With more, the half that has been silent the longest ends, and their next
/// packets are another connection. The memory of a connection is that of its two directions, and of the segments that wait.
const MAX_CONNECTIONS: usize = 2048;

/// A consumer of the directions of a capture.
pub trait Directions {
    /// The state of a direction that is taken.
    type Direction;

    /// Called with the capture time of the next packet.
    ///
    /// # Errors
    /// An error ends the reading.
    fn pass_time(&mut self, _at: Duration) -> Result<()> {
        Ok(())
    }

    /// Called for the first bytes of a direction: returns `None` to omit the direction. `connection` counts from 1 for the
    /// same two ends; `is_client` is whether the client sends the bytes. If the capture lacks the beginning of the
    /// connection (`is_whole` is false), the lower port counts as the server's; on a line that was recorded at one end, this
    /// end counts as the client.
    ///
    /// # Errors
    /// An error ends the reading.
    fn begin(
        &mut self,
        flow: Flow,
        is_client: bool,
        connection: u64,
        is_whole: bool,
    ) -> Result<Option<Self::Direction>>;

    /// Called with the next piece of a direction.
    ///
    /// # Errors
    /// An error ends the reading.
    fn take(&mut self, direction: &mut Self::Direction, piece: Piece<'_>) -> Result<()>;

    /// Called when a direction has ended.
    ///
    /// # Errors
    /// An error ends the reading.
    fn end(&mut self, direction: Self::Direction) -> Result<()>;

    /// Called with a fault of the packet with this number, or of the capture after it.
    ///
    /// # Errors
    /// An error ends the reading.
    fn fault(&mut self, packet: u64, fault: &Fault) -> Result<()>;
}

/// Reads every direction of a capture, or those that are asked for; and whether there was any that is taken.
///
/// # Errors
/// If the input cannot be read or is not a capture, or those of `to`.
pub fn read<D: Directions>(input: Box<dyn Read>, reading: &Reading, to: &mut D) -> Result<(Summary, bool)> {
    let mut table = Table { to, port: reading.port, connections: BTreeMap::new(), clock: 0, found: false };
    let summary = super::read(input, reading, |found| match found {
        CaptureItem::Packet(packet) => table.take(&packet),
        CaptureItem::Fault(number, fault) => table.to.fault(number, &fault),
    })?;
    table.finish()?;
    Ok((summary, table.found))
}

/// Two ends, the lesser first; for a serial line, the line alone.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Ends {
    Tcp(SocketAddr, SocketAddr),
    Udp(SocketAddr, SocketAddr),
    Serial(usize),
    Kept(Line),
}

impl Ends {
    /// Returns the two ends, and the sending one.
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
            Flow::Kept(line, by_keeper) => (Self::Kept(line), usize::from(!by_keeper)),
        }
    }
}

struct Table<'a, D: Directions> {
    to: &'a mut D,
    /// The only port.
    port: Option<u16>,
    /// Most captures have few: a tree finds one sooner than a hash of its addresses.
    connections: BTreeMap<Ends, Connection<D::Direction>>,
    /// Counts packets.
    clock: u64,
    /// Whether there was anything that is taken.
    found: bool,
}

/// The known facts about two ends.
struct Connection<T> {
    /// Counted from 1 for these ends.
    number: u64,
    /// The end that opened the connection, if the capture has that.
    client: Option<usize>,
    directions: [Direction<T>; 2],
    last: u64,
}

/// One direction.
struct Direction<T> {
    tcp: Reassembly,
    /// The sequence number of the first byte that the other end has not acknowledged yet, if the capture has it.
    acknowledged: Option<u32>,
    state: State<T>,
}

enum State<T> {
    /// Nothing was sent yet.
    Silent,
    /// The direction is left out.
    Ignored,
    Taken(T),
}

impl<D: Directions> Table<'_, D> {
    fn take(&mut self, packet: &Packet<'_>) -> Result<()> {
        if !self.is_wanted(packet.flow) {
            return Ok(());
        }
        self.clock += 1;
        if let Some(at) = packet.at {
            self.to.pass_time(at)?;
        }
        let (ends, sender) = Ends::of(packet.flow);
        if self.connections.len() >= MAX_CONNECTIONS && !self.connections.contains_key(&ends) {
            self.forget_the_silent()?;
        }
        let connection = self.connections.entry(ends).or_insert_with(|| Connection::new(1));
        connection.last = self.clock;
        if let Some(segment) = packet.segment {
            connection.open(sender, segment, self.to)?;
        }
        let keeps_alive = connection.keeps_alive(sender, packet);
        if packet.payload.is_empty() && packet.missing == 0 || keeps_alive {
            return Ok(());
        }
        let Connection { number, client, directions, .. } = connection;
        let Some(direction) = directions.get_mut(sender) else { return Ok(()) };
        if let State::Silent = direction.state {
            let is_client = client.map_or_else(|| is_likely_client(packet.flow), |client| client == sender);
            let begun = self.to.begin(packet.flow, is_client, *number, client.is_some())?;
            direction.state = begun.map_or(State::Ignored, State::Taken);
        }
        let State::Taken(taken) = &mut direction.state else { return Ok(()) };
        self.found = true;
        match packet.segment {
            Some(Segment { sequence, .. }) => {
                let (payload, cut) = (packet.payload, packet.missing);
                direction.tcp.push(sequence, payload, cut, |piece| self.to.take(taken, piece))
            }
            None => {
                if !packet.payload.is_empty() {
                    self.to.take(taken, Piece::Bytes(packet.payload))?;
                }
                match packet.missing {
                    0 => Ok(()),
                    cut => self.to.take(taken, Piece::Cut(cut)),
                }
            }
        }
    }

    fn is_wanted(&self, flow: Flow) -> bool {
        match (self.port, flow) {
            (None, _) | (_, Flow::Serial(_) | Flow::Kept(..)) => true,
            (Some(port), Flow::Tcp(from, to) | Flow::Udp(from, to)) => {
                from.port() == port || to.port() == port
            }
        }
    }

    fn forget_the_silent(&mut self) -> Result<()> {
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
        self.end(silent)
    }

    fn finish(&mut self) -> Result<()> {
        let all = self.connections.iter().map(|(ends, connection)| (connection.last, *ends)).collect();
        self.end(all)
    }

    /// Ends the connections in the sequence of their last packets.
    fn end(&mut self, mut ended: Vec<(u64, Ends)>) -> Result<()> {
        ended.sort_unstable_by_key(|(last, _)| *last);
        for (_, ends) in ended {
            if let Some(connection) = self.connections.remove(&ends) {
                connection.end(self.to)?;
            }
        }
        Ok(())
    }
}

impl<T> Connection<T> {
    fn new(number: u64) -> Self {
        let silent = || Direction { tcp: Reassembly::default(), acknowledged: None, state: State::Silent };
        Self { number, client: None, directions: [silent(), silent()], last: 0 }
    }

    /// Handles a segment that opens a direction: again, for the first time, or for another connection between the same
    /// ports.
    fn open(
        &mut self,
        sender: usize,
        segment: Segment,
        to: &mut impl Directions<Direction = T>,
    ) -> Result<()> {
        if !segment.opens {
            return Ok(());
        }
        let is_another =
            self.directions.get_mut(sender).is_some_and(|direction| direction.tcp.open(segment.sequence));
        if is_another {
            let next = Self { last: self.last, ..Self::new(self.number + 1) };
            core::mem::replace(self, next).end(to)?;
            if let Some(direction) = self.directions.get_mut(sender) {
                direction.tcp.open(segment.sequence);
            }
        }
        self.client = Some(if segment.accepts { 1 - sender } else { sender });
        Ok(())
    }

    /// Returns whether a packet asks only whether the connection is alive, at the beginning of the capture: it repeats the
    /// byte before the next one. The other end has acknowledged that byte; if it has not sent anything yet, the packet is
    /// not the end of a program's bytes. Later ones are known by their position.
    fn keeps_alive(&mut self, sender: usize, packet: &Packet<'_>) -> bool {
        let Some(segment) = packet.segment else { return false };
        if let (Some(other), Some(next)) = (self.directions.get_mut(1 - sender), segment.acknowledges) {
            other.acknowledged = Some(next);
        }
        let Some(direction) = self.directions.get(sender) else { return false };
        let next = segment.sequence.wrapping_add(1);
        packet.payload.len() == 1
            && packet.missing == 0
            && !direction.tcp.has_begun()
            && direction.acknowledged.map_or(!segment.pushes, |acknowledged| acknowledged == next)
    }

    fn end(self, to: &mut impl Directions<Direction = T>) -> Result<()> {
        for Direction { mut tcp, state, .. } in self.directions {
            if let State::Taken(mut taken) = state {
                tcp.finish(|piece| to.take(&mut taken, piece))?;
                to.end(taken)?;
            }
        }
        Ok(())
    }
}

/// Returns whether the sender is the client, by the ports alone.
fn is_likely_client(flow: Flow) -> bool {
    match flow {
        Flow::Tcp(from, to) | Flow::Udp(from, to) => from.port() > to.port(),
        Flow::Serial(_) => false,
        Flow::Kept(_, by_keeper) => by_keeper,
    }
}
