//! Captures: the bytes of TCP connections, UDP, serial lines and USB serial adapters, and the reasons that some of them
//! cannot be read. They are files of pcap and pcapng, the text of hex dumps, output of strace or socat, and traces.
//!
//! Everything is reported: bytes that should be a link's but cannot be read are a [`Fault`], and packets that never contain them
//! are counted in the [`Summary`]. The memory is bounded, however large the capture is: one block, fragments that wait for the
//! rest of their packet, and the caller's data of each connection (see [`reassembly`]). A hex dump is held whole, up to 256 MB.

mod blocks;
pub mod connections;
mod fault;
mod fragments;
mod hexdump;
mod network;
pub mod reassembly;
mod socat;
mod strace;
mod trace;
mod usb;
pub mod write;

use core::fmt;
use std::collections::BTreeMap;
use std::io::{BufReader, Read};
use std::net::{IpAddr, SocketAddr};
use std::time::Duration;

use anyhow::Result;
use etherparse::{IpNumber, TcpSlice, UdpSlice};

use self::blocks::{Block, Blocks, Frame};
use self::fragments::Fragments;
use self::network::{Network, OtherPacket};
use self::usb::{CapturedPacket, Devices};

pub use self::fault::Fault;
pub use self::hexdump::is_dump;
pub use self::socat::is_socat;
pub use self::usb::Adapter;

/// The form of a capture, and the part of it that is read.
#[derive(Debug, Clone, Copy, Default)]
pub struct Reading {
    /// The form of the capture.
    pub form: Form,
    /// The TCP or UDP port whose bytes alone are read, in both directions; `None`: all ports.
    pub port: Option<u16>,
    /// The type of a USB device that does not show it; `None` if it is not given.
    pub adapter: Option<Adapter>,
    /// The file descriptor whose bytes alone are read from an output of strace; `None`: all.
    pub descriptor: Option<u32>,
}

/// The forms of captures.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Form {
    /// A capture in the form pcap or pcapng.
    #[default]
    Pcap,
    /// A text that text2pcap reads.
    HexDump,
    /// An output of strace.
    Strace,
    /// An output of `socat -x`.
    Socat,
    /// A file that `--trace` has written.
    Trace,
}

/// Returns why an input that begins so is not read, with the command that makes a capture of it, if it is a known form of
/// captures.
pub fn unreadable(begin: &[u8]) -> Option<String> {
    const PACKED: [(&[u8], &str, &str); 6] = [
        (b"\x1F\x8B", "gzip", "gzip -dc"),
        (b"\x28\xB5\x2F\xFD", "zstd", "zstd -dc"),
        (b"\xFD7zXZ\0", "xz", "xz -dc"),
        (b"BZh", "bzip2", "bzip2 -dc"),
        (b"\x04\x22\x4D\x18", "lz4", "lz4 -dc"),
        (b"PK\x03\x04", "zip", "unzip -p"),
    ];
    const OTHERS: [(&[u8], &str); 6] = [
        (b"snoop\0\0\0", "snoop"),
        (b"btsnoop\0", "btsnoop"),
        (b"GMBU", "Network Monitor"),
        (b"RTSS", "Network Monitor 1"),
        (b"XCP\0", "NetXRay"),
        (b"TRSNIFF data    \x1A", "DOS Sniffer"),
    ];
    let packed = PACKED.iter().find(|(magic, ..)| begin.starts_with(magic));
    let packed = packed.map(|(_, name, command)| {
        format!("the input is compressed with {name}: unpack it first, as in `{command} FILE | cellwire …`")
    });
    packed.or_else(|| {
        let (_, name) = OTHERS.iter().find(|(magic, _)| begin.starts_with(magic))?;
        Some(format!("the input is a capture of {name}: convert it with `editcap -F pcapng FILE OUT.pcapng`"))
    })
}

/// The two ends of a flow, the sender first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Flow {
    /// One direction of a TCP connection.
    Tcp(SocketAddr, SocketAddr),
    /// UDP from one port to another.
    Udp(SocketAddr, SocketAddr),
    /// A serial line, captured with one of the user link types (147 to 162): the interface that it was captured on, from 0.
    Serial(usize),
    /// A line that was recorded at one of its ends, such as the PC with an adapter; whether that end sends.
    Kept(Line, bool),
}

/// A line that was recorded at one of its ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Line {
    /// A port of a USB adapter.
    Usb {
        /// The bus of the device.
        bus: u16,
        /// The number of the device on the bus.
        device: u16,
        /// The port or the interface, from 0.
        port: u8,
    },
    /// A file that a program has opened.
    Opened {
        /// The number of the file descriptor.
        descriptor: u32,
        /// The number of files that have had this descriptor before.
        turn: u32,
    },
    /// The line of a hex dump, which does not name it.
    Dump,
    /// A trace of this name.
    Trace(&'static str),
}

impl fmt::Display for Line {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Usb { bus, device, port: 0 } => write!(f, "USB {bus}.{device}"),
            Self::Usb { bus, device, port } => write!(f, "USB {bus}.{device} port {port}"),
            Self::Opened { descriptor, turn: 0 } => write!(f, "descriptor {descriptor}"),
            Self::Opened { descriptor, turn } => write!(f, "descriptor {descriptor} file {}", turn + 1),
            Self::Dump => f.write_str("the dump"),
            Self::Trace(name) => f.write_str(name),
        }
    }
}

/// The header of a TCP segment.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Segment {
    /// The sequence number of the first byte of the payload.
    pub sequence: u32,
    /// Whether this end opens its direction.
    pub opens: bool,
    /// Whether this end accepts the connection that the other one opens.
    pub accepts: bool,
    /// The sequence number of the next byte that this end expects; `None` if the segment does not have one.
    pub acknowledges: Option<u32>,
    /// Whether the sender has nothing more to send at this time.
    pub pushes: bool,
}

/// A piece of a flow.
#[derive(Debug, Clone, Copy)]
pub struct Packet<'a> {
    /// The number of the packet in the capture, from 1; in a text, the line.
    pub number: u64,
    /// The time at which the packet was captured, from any beginning; `None` if the capture does not have it.
    pub at: Option<Duration>,
    /// The sender and the receiver.
    pub flow: Flow,
    /// The header of the TCP segment; `None` if the packet is not of TCP.
    pub segment: Option<Segment>,
    /// The captured bytes of the payload.
    pub payload: &'a [u8],
    /// The number of bytes of the payload that the capture has cut off.
    pub missing: u64,
}

/// An item of a capture.
#[derive(Debug)]
pub enum CaptureItem<'a> {
    /// A packet with bytes of a flow.
    Packet(Packet<'a>),
    /// A fault of the packet of this number, or of the capture after it.
    Fault(u64, Fault),
}

/// The contents of a capture beside flows.
#[derive(Debug, Default)]
pub struct Summary {
    /// The number of packets of the capture.
    pub packets: u64,
    /// The numbers of packets that never carry the bytes of a link, by protocol.
    pub others: BTreeMap<String, u64>,
    /// The serial adapters, and how their lines are set.
    pub adapters: Vec<String>,
}

/// Calls `take` for every packet of a capture that carries TCP, UDP or bytes of a serial line, and for every fault.
///
/// # Errors
/// If the input cannot be read or is not a capture, and any error of `take`.
pub fn read(
    input: Box<dyn Read>,
    reading: &Reading,
    take: impl FnMut(CaptureItem<'_>) -> Result<()>,
) -> Result<Summary> {
    match reading.form {
        Form::Pcap => read_packets(input, reading.adapter, take),
        Form::HexDump => hexdump::read(BufReader::new(input), take),
        Form::Strace => strace::read(BufReader::new(input), reading.descriptor, take),
        Form::Socat => socat::read(BufReader::new(input), take),
        Form::Trace => trace::read(BufReader::new(input), take),
    }
}

fn read_packets(
    input: Box<dyn Read>,
    adapter: Option<Adapter>,
    mut take: impl FnMut(CaptureItem<'_>) -> Result<()>,
) -> Result<Summary> {
    let mut devices = Devices::new(adapter);
    let mut blocks = Blocks::new(input)?;
    let mut fragments = Fragments::default();
    let mut summary = Summary::default();
    let mut strange = Vec::new();
    loop {
        let frame = match blocks.next()? {
            Block::Frame(frame) => frame,
            Block::Fault(fault) => {
                take(CaptureItem::Fault(summary.packets, fault))?;
                continue;
            }
            Block::End => break,
        };
        summary.packets += 1;
        let number = summary.packets;
        let at = frame.at;
        let cut = u64::from(frame.original).saturating_sub(frame.data.len() as u64);
        let Some(link_type) = frame.link_type else {
            take(CaptureItem::Fault(number, Fault::NoInterface { interface: frame.interface }))?;
            continue;
        };
        match network::of(link_type, frame.data) {
            Network::Serial => {
                let flow = Flow::Serial(frame.interface);
                let packet = Packet { number, at, flow, segment: None, payload: frame.data, missing: cut };
                take(CaptureItem::Packet(packet))?;
            }
            Network::Usb(header) => {
                let Frame { data, is_big, .. } = frame;
                let captured = CapturedPacket { number, at, header, data, is_big, missing: cut };
                devices.add(&captured, &mut take)?;
            }
            Network::Ip(data) => {
                internet((number, at), data, cut, &mut fragments, &mut summary, &mut take)?;
            }
            Network::Other(other) => summary.count(&other),
            Network::Unreadable(why) => {
                take(CaptureItem::Fault(number, Fault::Unreadable { why: why.into(), missing: cut }))?;
            }
            Network::UnknownLink(link_type) => {
                if !strange.contains(&(frame.section, frame.interface)) {
                    strange.push((frame.section, frame.interface));
                    let interface = frame.interface;
                    take(CaptureItem::Fault(number, Fault::LinkType { number: link_type, interface }))?;
                }
                summary.count(&OtherPacket::LinkType(link_type));
            }
        }
    }
    devices.finish(&mut summary, &mut take)?;
    for fault in fragments.finish() {
        take(CaptureItem::Fault(summary.packets, fault))?;
    }
    Ok(summary)
}

/// Handles an IP packet, or a fragment of one.
fn internet(
    (number, at): (u64, Option<Duration>),
    data: &[u8],
    cut: u64,
    fragments: &mut Fragments,
    summary: &mut Summary,
    take: &mut impl FnMut(CaptureItem<'_>) -> Result<()>,
) -> Result<()> {
    let ip = match network::ip(data) {
        Ok(ip) => ip,
        Err(why) => return take(CaptureItem::Fault(number, Fault::Unreadable { why, missing: cut })),
    };
    if let Some(fragment) = ip.fragment {
        let (whole, faults) = fragments.add(&ip, fragment);
        for fault in faults {
            take(CaptureItem::Fault(number, fault))?;
        }
        return match whole {
            None => Ok(()),
            Some(payload) => {
                let ends = (ip.source, ip.destination);
                transport((number, at), ends, (ip.protocol, &payload), 0, summary, take)
            }
        };
    }
    transport((number, at), (ip.source, ip.destination), (ip.protocol, ip.payload), ip.missing, summary, take)
}

fn transport(
    (number, at): (u64, Option<Duration>),
    (source, destination): (IpAddr, IpAddr),
    (protocol, payload): (IpNumber, &[u8]),
    missing: u64,
    summary: &mut Summary,
    take: &mut impl FnMut(CaptureItem<'_>) -> Result<()>,
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
                acknowledges: tcp.ack().then(|| tcp.acknowledgment_number()),
                pushes: tcp.psh(),
            };
            // A reset contains a text for people, if anything.
            let payload = if tcp.rst() { &[] } else { tcp.payload() };
            Packet { number, at, flow: Flow::Tcp(from, to), segment: Some(segment), payload, missing }
        }),
        IpNumber::UDP => UdpSlice::from_slice_lax(payload).map_err(|error| error.to_string()).map(|udp| {
            let (from, to) = ends(udp.source_port(), udp.destination_port());
            Packet { number, at, flow: Flow::Udp(from, to), segment: None, payload: udp.payload(), missing }
        }),
        IpNumber(other) => {
            summary.count(&OtherPacket::Protocol(other));
            return Ok(());
        }
    };
    match packet {
        Ok(packet) => take(CaptureItem::Packet(packet)),
        Err(why) => take(CaptureItem::Fault(number, Fault::Unreadable { why, missing })),
    }
}

impl Summary {
    fn count(&mut self, other: &OtherPacket) {
        *self.others.entry(other.to_string()).or_default() += 1;
    }
}
