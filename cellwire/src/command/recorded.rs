//! One conversation of a capture: the bytes of both ends, in sequence, with times.

use std::time::Duration;

use anyhow::{Result, bail, ensure};
use cellwire_links::Link;

use super::source::{SourceArgs, report};
use crate::io::capture::connections::{self, Directions};
use crate::io::capture::reassembly::Piece;
use crate::io::capture::{Fault, Flow, Line};
use cellwire_io::output::{counted, remark};

/// The selection of a capture's conversation.
#[derive(Debug, clap::Args)]
pub(super) struct ConversationArgs {
    #[command(flatten)]
    source: SourceArgs,
    /// The number of the conversation in the capture [default: the one with most bytes]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    conversation: Option<u32>,
}

/// The bytes of both ends.
#[derive(Debug)]
pub(super) struct Conversation {
    name: String,
    /// The server's port, or 0.
    port: u16,
    place: ConversationKey,
    /// In the order of the capture.
    pub(super) sent: Vec<SentBytes>,
}

/// The key that distinguishes conversations.
#[derive(Debug, Clone, PartialEq, Eq)]
enum ConversationKey {
    /// The ends of a network, the client's first, and the how manyth connection it is.
    Network(Flow, u64),
    /// A line that was recorded at one end.
    Kept(Line),
}

/// Something that an end sent.
#[derive(Debug)]
pub(super) struct SentBytes {
    /// Since the first.
    pub(super) at: Duration,
    /// The direction is the client's, or that of the end that recorded the line.
    is_first: bool,
    pub(super) bytes: Vec<u8>,
    /// Bytes are missing before it.
    pub(super) after_gap: bool,
}

impl ConversationArgs {
    /// Reads the conversation.
    ///
    /// # Errors
    /// When the input is not a capture of both ends, or has no such conversation.
    pub(super) fn read(&self) -> Result<Conversation> {
        let (format, input) = self.source.open()?;
        let mut all = match self.source.reading(format) {
            Some(reading) => {
                let mut collecting = ConversationCollector::default();
                let (summary, _) = connections::read(input, &reading, &mut collecting)?;
                report(&summary);
                if collecting.faults > 0 {
                    remark(&format!(
                        "{} could not be read; cellwire decode lists them",
                        counted(collecting.faults, "packet")
                    ));
                }
                collecting.all
            }
            None => {
                bail!(
                    "the capture needs both ends: a file of pcap, a hex dump, output of strace or socat, or a trace"
                )
            }
        };
        all.retain(|it| !it.sent.is_empty());
        let count = all.len();
        let size = |it: &Conversation| it.sent.iter().map(|sent| sent.bytes.len()).sum::<usize>();
        let chosen = match self.conversation {
            Some(number) => (number as usize).checked_sub(1).filter(|index| *index < count),
            None => (0..count).max_by_key(|index| (all.get(*index).map(size), core::cmp::Reverse(*index))),
        };
        let Some(index) = chosen else {
            ensure!(
                count > 0,
                "the capture has no conversation with bytes of both ends{}",
                self.source.on_port()
            );
            bail!("the capture has {}", counted(count, "conversation"));
        };
        let mut conversation = all.swap_remove(index);
        if count > 1 && self.conversation.is_none() {
            remark(&format!(
                "using the largest of {count} conversations, number {}: {}; choose with --conversation or --port",
                index + 1,
                conversation.name
            ));
        }
        conversation.sent.sort_by_key(|sent| sent.at);
        let begin = conversation.sent.first().map_or(Duration::ZERO, |sent| sent.at);
        conversation.sent.iter_mut().for_each(|sent| sent.at -= begin);
        Ok(conversation)
    }
}

impl Conversation {
    /// Returns both ends: the client or the recording end, and the other end. Each has the side whose messages it sends, if
    /// it sends any.
    ///
    /// # Errors
    /// If the trace is not one of the link.
    pub(super) fn parties(&self, link: &Link) -> Result<[Party; 2]> {
        let sides = match &self.place {
            ConversationKey::Network(..) => {
                [true, false].map(|is_client| (link.sender)(is_client, self.port))
            }
            ConversationKey::Kept(Line::Trace(name)) => {
                let sides = [true, false].map(|by_keeper| link.traced(name, by_keeper));
                let [Some(sent), Some(received)] = sides else {
                    bail!("`{name}` is not an end of {}", link.short)
                };
                [sent, received]
            }
            ConversationKey::Kept(_) => [link.keeper(None, true)?, link.keeper(None, false)?],
        };
        let [first, second] = sides;
        let [first, second] =
            [(true, first), (false, second)].map(|(is_first, side)| Party { is_first, side });
        Ok([first, second])
    }

    /// Returns the ends of a link: the named one, and the other.
    ///
    /// # Errors
    /// When the link has no such end.
    pub(super) fn ends(&self, link: &Link, named: &str) -> Result<[Party; 2]> {
        let [first, second] = self.parties(link)?;
        let silent = link.ends.iter().map(|end| end.name).find(|end| !link.sides.contains(end));
        let names = [first, second].map(|party| party.side.or(silent).unwrap_or_default());
        // A side may be called after its kind of device, and its end only `device`.
        let is_named = |index: usize| {
            names.get(index) == Some(&named) || named == "device" && names.get(index) != Some(&"central")
        };
        match (is_named(0), is_named(1)) {
            (true, _) => Ok([first, second]),
            (_, true) => Ok([second, first]),
            _ => bail!(
                "the capture has no end `{named}` of {}: use --as {}",
                link.short,
                names.join(" or --as ")
            ),
        }
    }
}

/// An end of a conversation.
#[derive(Debug, Clone, Copy)]
pub(super) struct Party {
    /// The end is the client, or the one that recorded the line.
    pub(super) is_first: bool,
    /// The side of the link whose messages it sends; none where it polls.
    pub(super) side: Option<&'static str>,
}

impl Party {
    /// Returns whether the end has sent bytes.
    pub(super) fn has_sent(self, sent: &SentBytes) -> bool {
        sent.is_first == self.is_first
    }
}

#[derive(Default)]
struct ConversationCollector {
    all: Vec<Conversation>,
    faults: usize,
    /// The time of the last packet.
    now: Duration,
}

/// A direction: of which conversation, and whether the client's.
struct Direction {
    index: usize,
    is_first: bool,
    has_gap: bool,
}

impl Directions for ConversationCollector {
    type Direction = Direction;

    fn pass_time(&mut self, at: Duration) -> Result<()> {
        self.now = at;
        Ok(())
    }

    fn begin(&mut self, flow: Flow, is_first: bool, connection: u64, _: bool) -> Result<Option<Direction>> {
        let ordered = |from, to| if is_first { (from, to) } else { (to, from) };
        let (place, name, port) = match flow {
            Flow::Tcp(from, to) => {
                let (client, server) = ordered(from, to);
                (
                    ConversationKey::Network(Flow::Tcp(client, server), connection),
                    format!("TCP {client} > {server}"),
                    server.port(),
                )
            }
            Flow::Udp(from, to) => {
                let (client, server) = ordered(from, to);
                (
                    ConversationKey::Network(Flow::Udp(client, server), connection),
                    format!("UDP {client} > {server}"),
                    server.port(),
                )
            }
            Flow::Kept(line, _) => (ConversationKey::Kept(line), line.to_string(), 0),
            // One direction, or both at once.
            Flow::Serial(_) => return Ok(None),
        };
        let index = self.all.iter().position(|it| it.place == place).unwrap_or_else(|| {
            self.all.push(Conversation { name, port, place, sent: Vec::new() });
            self.all.len() - 1
        });
        Ok(Some(Direction { index, is_first, has_gap: false }))
    }

    fn take(&mut self, direction: &mut Direction, piece: Piece<'_>) -> Result<()> {
        match piece {
            Piece::Bytes(bytes) => {
                if let Some(conversation) = self.all.get_mut(direction.index) {
                    let (is_first, after_gap) = (direction.is_first, direction.has_gap);
                    conversation.sent.push(SentBytes {
                        at: self.now,
                        is_first,
                        bytes: bytes.to_vec(),
                        after_gap,
                    });
                }
                direction.has_gap = false;
            }
            Piece::Gap(_) | Piece::Cut(_) => direction.has_gap = true,
            Piece::Late(_) | Piece::BeforeStart(_) => {}
        }
        Ok(())
    }

    fn end(&mut self, _: Direction) -> Result<()> {
        Ok(())
    }

    fn fault(&mut self, _: u64, _: &Fault) -> Result<()> {
        self.faults += 1;
        Ok(())
    }
}
