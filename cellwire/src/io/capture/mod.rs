//! Captures (pcap and pcapng): the bytes of TCP connections, UDP and serial lines, and what keeps some of them from being read.
//!
//! Nothing is dropped without a word: what should hold a link's bytes and does not is a [`Fault`], and what never holds them
//! is counted in the [`Summary`]. The memory is bounded, however large the capture is: one block, fragments that wait for the
//! rest of their packet, and what the caller keeps of each connection (see [`reassembly`]).

mod blocks;
pub mod connections;
mod fault;
mod fragments;
mod network;
pub mod reassembly;
pub mod write;

use std::collections::BTreeMap;
use std::io::Read;
use std::net::{IpAddr, SocketAddr};
use std::time::Duration;

use anyhow::Result;
use etherparse::{IpNumber, TcpSlice, UdpSlice};

use self::blocks::{Block, Blocks};
use self::fragments::Fragments;
use self::network::{Network, Other};

pub use self::fault::Fault;

/// The two ends of a flow, the sender first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Flow {
    /// One direction of a TCP connection.
    Tcp(SocketAddr, SocketAddr),
    /// UDP from one port to another.
    Udp(SocketAddr, SocketAddr),
    /// A serial line, captured with one of the user link types (147 to 162): the interface that it was captured on, from 0.
    Serial(usize),
}

/// What a TCP segment says beside its payload.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Segment {
    /// The sequence number of the first byte of the payload.
    pub sequence: u32,
    /// This end opens its direction.
    pub opens: bool,
    /// This end accepts the connection that the other one opens.
    pub accepts: bool,
}

/// A piece of a flow.
#[derive(Debug, Clone, Copy)]
pub struct Packet<'a> {
    /// Which packet of the capture it is, from 1.
    pub number: u64,
    /// The sender and the receiver.
    pub flow: Flow,
    /// Of TCP.
    pub segment: Option<Segment>,
    /// The payload.
    pub payload: &'a [u8],
    /// How many bytes of the payload the capture has cut off.
    pub missing: u64,
    /// When it was captured: only the time between two packets means something.
    pub time: Duration,
}

/// What a capture holds.
#[derive(Debug)]
pub enum Found<'a> {
    /// Bytes of a flow.
    Packet(Packet<'a>),
    /// A fault of the packet of this number, or of the capture after it.
    Fault(u64, Fault),
}

/// What a capture held beside flows.
#[derive(Debug, Default)]
pub struct Summary {
    /// The packets of the capture.
    pub packets: u64,
    /// How many of them never carry the bytes of a link, by protocol.
    pub others: BTreeMap<String, u64>,
}

/// Calls `take` for every packet of a capture that carries TCP, UDP or bytes of a serial line, and for every fault.
///
/// # Errors
/// When the input cannot be read or is not a capture, or whatever `take` returns.
pub fn read(input: Box<dyn Read + Send>, mut take: impl FnMut(Found<'_>) -> Result<()>) -> Result<Summary> {
    let mut blocks = Blocks::new(input)?;
    let mut fragments = Fragments::default();
    let mut summary = Summary::default();
    let mut strange = Vec::new();
    loop {
        let frame = match blocks.next()? {
            Block::Frame(frame) => frame,
            Block::Fault(fault) => {
                take(Found::Fault(summary.packets, fault))?;
                continue;
            }
            Block::End => break,
        };
        summary.packets += 1;
        let number = summary.packets;
        let cut = u64::from(frame.original).saturating_sub(frame.data.len() as u64);
        let Some(link_type) = frame.link_type else {
            take(Found::Fault(number, Fault::NoInterface { interface: frame.interface }))?;
            continue;
        };
        match network::of(link_type, frame.data) {
            Network::Serial => {
                let flow = Flow::Serial(frame.interface);
                let packet = Packet {
                    number,
                    flow,
                    segment: None,
                    payload: frame.data,
                    missing: cut,
                    time: frame.time,
                };
                take(Found::Packet(packet))?;
            }
            Network::Ip(data) => {
                internet((number, frame.time), data, cut, &mut fragments, &mut summary, &mut take)?;
            }
            Network::Other(other) => summary.count(&other),
            Network::Unreadable(why) => {
                take(Found::Fault(number, Fault::Unreadable { why: why.into(), missing: cut }))?;
            }
            Network::UnknownLink(link_type) => {
                if !strange.contains(&(frame.section, frame.interface)) {
                    strange.push((frame.section, frame.interface));
                    let interface = frame.interface;
                    take(Found::Fault(number, Fault::LinkType { number: link_type, interface }))?;
                }
                summary.count(&Other::LinkType(link_type));
            }
        }
    }
    for fault in fragments.finish() {
        take(Found::Fault(summary.packets, fault))?;
    }
    Ok(summary)
}

/// An IP packet, or a fragment of one.
fn internet(
    (number, time): (u64, Duration),
    data: &[u8],
    cut: u64,
    fragments: &mut Fragments,
    summary: &mut Summary,
    take: &mut impl FnMut(Found<'_>) -> Result<()>,
) -> Result<()> {
    let ip = match network::ip(data) {
        Ok(ip) => ip,
        Err(why) => return take(Found::Fault(number, Fault::Unreadable { why, missing: cut })),
    };
    if let Some(fragment) = ip.fragment {
        let (whole, faults) = fragments.add(&ip, fragment);
        for fault in faults {
            take(Found::Fault(number, fault))?;
        }
        return match whole {
            None => Ok(()),
            Some(payload) => {
                let ends = (ip.source, ip.destination);
                transport((number, time), ends, (ip.protocol, &payload), 0, summary, take)
            }
        };
    }
    transport(
        (number, time),
        (ip.source, ip.destination),
        (ip.protocol, ip.payload),
        ip.missing,
        summary,
        take,
    )
}

fn transport(
    (number, time): (u64, Duration),
    (source, destination): (IpAddr, IpAddr),
    (protocol, payload): (IpNumber, &[u8]),
    missing: u64,
    summary: &mut Summary,
    take: &mut impl FnMut(Found<'_>) -> Result<()>,
) -> Result<()> {
    let ends = |from, to| ((source, from).into(), (destination, to).into());
    let packet = match protocol {
        IpNumber::TCP => TcpSlice::from_slice(payload).map_err(|error| error.to_string()).map(|tcp| {
            let (from, to) = ends(tcp.source_port(), tcp.destination_port());
            let segment = Segment {
                // A SYN takes one number itself.
                sequence: tcp.sequence_number().wrapping_add(u32::from(tcp.syn())),
                opens: tcp.syn(),
                accepts: tcp.syn() && tcp.ack(),
            };
            // What comes with a reset is a text for people, if anything.
            let payload = if tcp.rst() { &[] } else { tcp.payload() };
            Packet { number, flow: Flow::Tcp(from, to), segment: Some(segment), payload, missing, time }
        }),
        IpNumber::UDP => UdpSlice::from_slice_lax(payload).map_err(|error| error.to_string()).map(|udp| {
            let (from, to) = ends(udp.source_port(), udp.destination_port());
            Packet { number, flow: Flow::Udp(from, to), segment: None, payload: udp.payload(), missing, time }
        }),
        IpNumber(other) => {
            summary.count(&Other::Protocol(other));
            return Ok(());
        }
    };
    match packet {
        Ok(packet) => take(Found::Packet(packet)),
        Err(why) => take(Found::Fault(number, Fault::Unreadable { why, missing })),
    }
}

impl Summary {
    fn count(&mut self, other: &Other) {
        *self.others.entry(other.to_string()).or_default() += 1;
    }
}
