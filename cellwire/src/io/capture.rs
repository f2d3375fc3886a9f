//! Captures (pcap and pcapng): TCP payloads in order, UDP payloads, and serial lines that use a user link type.

use std::collections::BTreeMap;
use std::io::Read;
use std::net::{IpAddr, SocketAddr};

use anyhow::{Context, Result, bail};
use etherparse::{NetSlice, SlicedPacket, TransportSlice};
use pcap_parser::{Block, Linktype, PcapBlockOwned, PcapError};

/// The limit of segments that wait for an earlier one; with more, the earlier one counts as lost.
const MAX_WAITING: usize = 256;

/// The sender and the receiver.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Flow {
    /// One direction of a TCP connection.
    Tcp(SocketAddr, SocketAddr),
    /// UDP from one port to another.
    Udp(SocketAddr, SocketAddr),
    /// A serial line, captured with one of the user link types (147 to 162).
    Serial,
}

/// A piece of a flow.
#[derive(Debug)]
pub struct Packet {
    /// The sender and the receiver.
    pub flow: Flow,
    /// The TCP sequence number of the first byte.
    pub sequence: u32,
    /// This end opens the TCP connection: it is the client.
    pub opens: bool,
    /// The payload.
    pub payload: Vec<u8>,
}

/// Calls `take` for every packet of a capture that carries TCP, UDP or bytes of a serial line.
///
/// # Errors
/// When the input is not a capture, or whatever `take` returns.
pub fn read(input: Box<dyn Read + Send>, mut take: impl FnMut(Packet) -> Result<()>) -> Result<()> {
    let mut reader = pcap_parser::create_reader(1 << 20, input)
        .map_err(|_| anyhow::anyhow!("the input is not a capture: neither pcap nor pcapng"))?;
    let mut link_types: Vec<Linktype> = Vec::new();
    let mut refills = 0;
    loop {
        match reader.next() {
            Ok((used, block)) => {
                refills = 0;
                if let Some(packet) = packet_of(&block, &mut link_types)? {
                    take(packet)?;
                }
                reader.consume(used);
            }
            Err(PcapError::Eof) => return Ok(()),
            Err(PcapError::Incomplete(_)) => {
                // A capture whose last block was not written completely ends here.
                refills += 1;
                if refills > 2 {
                    return Ok(());
                }
                reader.refill().map_err(|e| anyhow::anyhow!("cannot read the capture: {e:?}"))?;
            }
            Err(error) => bail!("the capture is corrupt: {error:?}"),
        }
    }
}

fn packet_of(block: &PcapBlockOwned<'_>, link_types: &mut Vec<Linktype>) -> Result<Option<Packet>> {
    let (link_type, data) = match block {
        PcapBlockOwned::LegacyHeader(header) => {
            link_types.push(header.network);
            return Ok(None);
        }
        PcapBlockOwned::NG(Block::InterfaceDescription(interface)) => {
            link_types.push(interface.linktype);
            return Ok(None);
        }
        PcapBlockOwned::Legacy(packet) => (link_types.first(), packet.data),
        PcapBlockOwned::NG(Block::EnhancedPacket(packet)) => {
            let length = usize::try_from(packet.caplen)?.min(packet.data.len()); // without the padding
            (link_types.get(usize::try_from(packet.if_id)?), packet.data.get(..length).unwrap_or_default())
        }
        PcapBlockOwned::NG(Block::SimplePacket(packet)) => (link_types.first(), packet.data),
        PcapBlockOwned::NG(_) => return Ok(None),
    };
    let link_type =
        link_type.context("the capture is corrupt: a packet of an interface that it does not describe")?;
    if (147..=162).contains(&link_type.0) {
        return Ok(Some(Packet { flow: Flow::Serial, sequence: 0, opens: false, payload: data.to_vec() }));
    }
    // A packet that etherparse cannot read is skipped: ARP, or cut short by the capture.
    let sliced = match *link_type {
        Linktype::ETHERNET => SlicedPacket::from_ethernet(data),
        Linktype::LINUX_SLL => SlicedPacket::from_linux_sll(data),
        Linktype::RAW | Linktype::IPV4 | Linktype::IPV6 => SlicedPacket::from_ip(data),
        Linktype::NULL => SlicedPacket::from_ip(data.get(4..).unwrap_or_default()),
        other => bail!("the capture's link type {} is not supported", other.0),
    };
    Ok(sliced.ok().and_then(|sliced| transport(&sliced)))
}

fn transport(sliced: &SlicedPacket<'_>) -> Option<Packet> {
    let (source, destination): (IpAddr, IpAddr) = match sliced.net.as_ref()? {
        NetSlice::Ipv4(ip) => (ip.header().source_addr().into(), ip.header().destination_addr().into()),
        NetSlice::Ipv6(ip) => (ip.header().source_addr().into(), ip.header().destination_addr().into()),
        NetSlice::Arp(_) => return None,
    };
    match sliced.transport.as_ref()? {
        TransportSlice::Tcp(tcp) => Some(Packet {
            flow: Flow::Tcp((source, tcp.source_port()).into(), (destination, tcp.destination_port()).into()),
            // A SYN takes one number itself.
            sequence: tcp.sequence_number().wrapping_add(u32::from(tcp.syn())),
            opens: tcp.syn() && !tcp.ack(),
            payload: tcp.payload().to_vec(),
        }),
        TransportSlice::Udp(udp) => Some(Packet {
            flow: Flow::Udp((source, udp.source_port()).into(), (destination, udp.destination_port()).into()),
            sequence: 0,
            opens: false,
            payload: udp.payload().to_vec(),
        }),
        _ => None,
    }
}

/// Puts the segments of one TCP direction back in order.
#[derive(Debug, Default)]
pub struct Reassembly {
    next: Option<u32>,
    /// By distance from the first byte of the stream, so that the order survives the wrap of sequence numbers.
    waiting: BTreeMap<u64, Vec<u8>>,
    taken: u64,
}

/// What a segment completes.
#[derive(Debug, PartialEq, Eq)]
pub enum Piece {
    /// The next bytes of the stream.
    Bytes(Vec<u8>),
    /// The number of bytes that are missing from the capture.
    Gap(u64),
}

impl Reassembly {
    /// Takes a segment; returns what is now in order.
    pub fn push(&mut self, sequence: u32, payload: Vec<u8>) -> Vec<Piece> {
        let next = *self.next.get_or_insert(sequence);
        // Half of the sequence numbers are before `next`, half are after it.
        let ahead = i64::from(sequence.wrapping_sub(next).cast_signed());
        let Ok(start) = u64::try_from(self.taken.cast_signed() + ahead) else { return Vec::new() };
        if !payload.is_empty() {
            let kept = self.waiting.entry(start).or_default();
            if kept.len() < payload.len() {
                *kept = payload;
            }
        }
        let mut pieces = self.in_order();
        if self.waiting.len() > MAX_WAITING {
            pieces.extend(self.skip());
        }
        pieces
    }

    /// The end of the capture: the segments that still wait, with the gaps before them.
    pub fn finish(mut self) -> Vec<Piece> {
        let mut pieces = Vec::new();
        while !self.waiting.is_empty() {
            pieces.extend(self.skip());
        }
        pieces
    }

    fn in_order(&mut self) -> Vec<Piece> {
        let mut pieces = Vec::new();
        while let Some(entry) = self.waiting.first_entry() {
            if *entry.key() > self.taken {
                break;
            }
            let (start, mut bytes) = entry.remove_entry();
            // Bytes that were sent again were taken already.
            let again = usize::try_from(self.taken - start).unwrap_or(usize::MAX).min(bytes.len());
            bytes.drain(..again);
            self.advance(bytes.len() as u64);
            if !bytes.is_empty() {
                pieces.push(Piece::Bytes(bytes));
            }
        }
        pieces
    }

    fn skip(&mut self) -> Vec<Piece> {
        let Some((&start, _)) = self.waiting.first_key_value() else { return Vec::new() };
        let missing = start.saturating_sub(self.taken);
        self.advance(missing);
        let mut pieces = vec![Piece::Gap(missing)];
        pieces.extend(self.in_order());
        pieces
    }

    #[expect(clippy::cast_possible_truncation, reason = "sequence numbers wrap at 2^32")]
    fn advance(&mut self, by: u64) {
        self.taken += by;
        self.next = self.next.map(|next| next.wrapping_add(by as u32));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bytes(text: &[u8]) -> Piece {
        Piece::Bytes(text.to_vec())
    }

    #[test]
    fn each_byte_is_returned_once_and_in_order() {
        let start = u32::MAX - 2; // wraps in the middle
        let mut tcp = Reassembly::default();
        assert_eq!(tcp.push(start, vec![]), []);
        assert_eq!(tcp.push(start, b"abcd".to_vec()), [bytes(b"abcd")]);
        assert_eq!(tcp.push(start.wrapping_add(6), b"gh".to_vec()), []);
        assert_eq!(tcp.push(start, b"abcd".to_vec()), [], "sent again");
        assert_eq!(
            tcp.push(start.wrapping_add(3), b"def".to_vec()),
            [bytes(b"ef"), bytes(b"gh")],
            "overlaps"
        );
        assert_eq!(tcp.finish(), []);
    }

    #[test]
    fn a_lost_segment_is_a_gap() {
        let mut tcp = Reassembly::default();
        tcp.push(100, b"ab".to_vec());
        assert_eq!(tcp.push(105, b"fg".to_vec()), []);
        assert_eq!(tcp.finish(), [Piece::Gap(3), bytes(b"fg")]);
    }
}
