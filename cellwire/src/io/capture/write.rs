//! Writes a capture while it grows: pcapng, whole after each batch of packets.
//!
//! Every connection is written as TCP or UDP over IP, a serial line as well: Wireshark puts its messages together, its
//! dissectors know which end sends, and [`read`](super::read) finds it again. Bytes that are not in it are a gap in the
//! sequence numbers, and a comment.

use std::collections::HashMap;
use std::fs::File;
use std::io::{self, Seek as _, SeekFrom, Write as _};
use std::net::{IpAddr, SocketAddr};
use std::path::{Path, PathBuf};
use std::sync::mpsc::RecvTimeoutError;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use anyhow::{Context as _, Result};
use etherparse::{IpHeaders, IpNumber, Ipv4Header, Ipv6FlowLabel, Ipv6Header, PacketBuilder, TcpHeader};

use crate::io::tap::{ConnectionTransport, End, TapEvent, TapReceiver, TapRecord};
use cellwire_io::files;
use cellwire_io::output::remark;

/// The maximum number of bytes that are collected before they are written.
const BATCH: usize = 1 << 20;
/// The interval at which a pipe is checked for its reader.
const READER_CHECK_INTERVAL: Duration = Duration::from_millis(200);
/// The interval at which missing bytes are reported.
const REPORT: Duration = Duration::from_secs(10);

/// The ends of a serial line, which has no addresses (RFC 5737).
pub const SERIAL: [([u8; 4], u16); 2] = [([192, 0, 2, 1], 49_152), ([192, 0, 2, 2], 9100)];

/// A capture that grows.
#[derive(Debug)]
pub struct Writer {
    file: File,
    path: PathBuf,
    /// The length of the file with whole blocks.
    length: u64,
    waiting: Vec<u8>,
    connections: HashMap<u32, Connection>,
    /// Bytes that could not be written since this was last possible.
    failed: Option<u64>,
    /// The reader of a pipe may be gone.
    is_pipe: bool,
    missing: MissedBytes,
}

/// Bytes that came faster than they could be written.
#[derive(Debug, Default)]
struct MissedBytes {
    count: u64,
    /// How many of them were reported, and when.
    reported: u64,
    at: Option<Instant>,
}

/// The reason why a capture has ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CaptureEnd {
    /// There is nothing more to see.
    Complete,
    /// The pipe is not read any more.
    Unread,
}

#[derive(Debug)]
struct Connection {
    places: [SocketAddr; 2],
    is_tcp: bool,
    /// The places of A's and B's next bytes, of which the sequence numbers are the lower half.
    next: [u64; 2],
}

impl Writer {
    /// Creates a file with this name, or with a number if that exists. `about` describes the capture.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn create(path: &Path, about: &str) -> Result<Self> {
        let (file, path) = files::create_new(path)?;
        Self::begin(file, path, about, false)
    }

    /// Writes into a pipe, as long as it is read.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn into_pipe(path: &Path, about: &str) -> Result<Self> {
        let file = File::options().write(true).open(path);
        let file = file.with_context(|| format!("cannot write {}", path.display()))?;
        Self::begin(file, path.to_owned(), about, true)
    }

    fn begin(file: File, path: PathBuf, about: &str, is_pipe: bool) -> Result<Self> {
        let (waiting, connections) = (head(about)?, HashMap::new());
        let mut writer = Self {
            file,
            path,
            length: 0,
            waiting,
            connections,
            failed: None,
            is_pipe,
            missing: MissedBytes::default(),
        };
        writer.write().with_context(|| format!("cannot write {}", writer.path.display()))?;
        Ok(writer)
    }

    /// Returns the path of the capture.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes all events until the last one, or until the pipe is closed. Reports missing bytes.
    pub fn record(mut self, seen: &TapReceiver) -> CaptureEnd {
        let ended = loop {
            match seen.next_within(READER_CHECK_INTERVAL) {
                Ok(first) => self.add(&first),
                Err(RecvTimeoutError::Timeout) if self.is_pipe && files::is_unread(&self.file) => {
                    break CaptureEnd::Unread;
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => break CaptureEnd::Complete,
            }
            while self.waiting.len() < BATCH
                && let Some(next) = seen.next_now()
            {
                self.add(&next);
            }
            self.flush();
            if self.is_pipe && self.failed.is_some() {
                break CaptureEnd::Unread;
            }
            self.missing.report(&self.path, REPORT);
        };
        self.missing.report(&self.path, Duration::ZERO);
        ended
    }

    /// Writes the collected packets. If the disk is full, packets are left out until there is free space again.
    fn flush(&mut self) {
        let bytes = self.waiting.len() as u64;
        match (self.write(), self.failed) {
            (Ok(()), Some(lost)) => {
                self.failed = None;
                remark(&format!("{} continues; {lost} bytes are missing", self.path.display()));
            }
            (Ok(()), None) => {}
            (Err(error), before) => {
                if before.is_none() {
                    let path = self.path.display();
                    remark(&format!("warning: cannot write {path}: {error}; bytes are still forwarded"));
                }
                self.failed = Some(before.unwrap_or_default() + bytes);
            }
        }
    }

    /// Writes the buffered blocks; after an error the file ends with a whole block.
    fn write(&mut self) -> io::Result<()> {
        let outcome = self.file.write_all(&self.waiting);
        match &outcome {
            Ok(()) => self.length += self.waiting.len() as u64,
            Err(_) => {
                let _ = self.file.set_len(self.length);
                let _ = self.file.seek(SeekFrom::Start(self.length));
            }
        }
        self.waiting.clear();
        outcome
    }

    fn add(&mut self, seen: &TapRecord) {
        if let TapEvent::Opened(place) = &seen.what {
            self.connections.insert(seen.connection, Connection::new(place));
        }
        let Some(connection) = self.connections.get_mut(&seen.connection) else { return };
        let mut add = |packet: Result<Vec<u8>>| {
            // An event without a packet, such as a datagram that is too long for one, is a gap.
            if let Ok(block) = packet.and_then(|packet| packet_block(seen.at, &packet, "")) {
                self.waiting.extend(block);
            }
        };
        match &seen.what {
            TapEvent::Opened(_) if connection.is_tcp => {
                add(connection.tcp(End::A, &[], |header| header.syn = true));
                add(connection.tcp(End::B, &[], |header| header.syn = true));
            }
            TapEvent::Opened(_) => {}
            TapEvent::Bytes(bytes) if connection.is_tcp => {
                add(connection.tcp(seen.from, bytes, |header| header.psh = true));
            }
            TapEvent::Bytes(bytes) => add(connection.udp(seen.from, bytes)),
            TapEvent::Missed(count) => {
                self.missing.count += count;
                connection.skip(seen.from, *count);
                // The packet carries this remark. Without bytes after it, the gap in the sequence numbers would not be visible,
                // and datagrams have no sequence numbers.
                let about =
                    format!("{count} bytes are missing here: they came faster than the capture was written");
                let block = match connection.is_tcp {
                    true => connection
                        .tcp(seen.from, &[], |_| {})
                        .and_then(|packet| packet_block(seen.at, &packet, &about)),
                    false => statistics_block(seen.at, &about),
                };
                self.waiting.extend(block.into_iter().flatten());
            }
            TapEvent::Closed(_) if !connection.is_tcp => {}
            TapEvent::Closed(None) => add(connection.tcp(seen.from, &[], |header| header.fin = true)),
            TapEvent::Closed(Some(_)) => add(connection.tcp(seen.from, &[], |header| header.rst = true)),
        }
    }
}

impl MissedBytes {
    /// Reports the missing packets, if some were not reported, and the last report is at least this old.
    fn report(&mut self, path: &Path, after: Duration) {
        if self.count > self.reported && self.at.is_none_or(|at| at.elapsed() >= after) {
            let (path, count) = (path.display(), self.count);
            remark(&format!(
                "warning: {path} lacks {count} bytes so far: they came faster than it was written; they were forwarded"
            ));
            (self.reported, self.at) = (count, Some(Instant::now()));
        }
    }
}

impl Connection {
    fn new(place: &ConnectionTransport) -> Self {
        let (a, b, is_tcp) = match *place {
            ConnectionTransport::Tcp(a, b) => (a, b, true),
            ConnectionTransport::Udp(a, b) => (a, b, false),
            ConnectionTransport::Ports(_) | ConnectionTransport::Line(_) => {
                (SERIAL[0].into(), SERIAL[1].into(), true)
            }
        };
        Self { places: [a, b], is_tcp, next: [0, 0] }
    }

    /// Returns the addresses of a packet, and the numbers of its sender's and its receiver's next bytes.
    fn ways(&self, from: End) -> ([SocketAddr; 2], [u64; 2]) {
        let ([a, b], [next_a, next_b]) = (self.places, self.next);
        match from {
            End::A => ([a, b], [next_a, next_b]),
            End::B => ([b, a], [next_b, next_a]),
        }
    }

    fn skip(&mut self, from: End, count: u64) {
        let [a, b] = &mut self.next;
        let next = if from == End::A { a } else { b };
        *next += count;
    }

    fn tcp(&mut self, from: End, bytes: &[u8], flags: impl FnOnce(&mut TcpHeader)) -> Result<Vec<u8>> {
        let ([source, destination], [sequence, acknowledged]) = self.ways(from);
        let mut header = TcpHeader::new(source.port(), destination.port(), low(sequence), u16::MAX);
        flags(&mut header);
        // Only the first of all packets acknowledges nothing.
        (header.ack, header.acknowledgment_number) = (acknowledged > 0 || !header.syn, low(acknowledged));
        self.skip(from, bytes.len() as u64 + u64::from(header.syn || header.fin));
        let mut packet = Vec::new();
        let builder = PacketBuilder::ip(ip(source.ip(), destination.ip())?).tcp_header(header);
        builder.write(&mut packet, bytes)?;
        Ok(packet)
    }

    fn udp(&self, from: End, bytes: &[u8]) -> Result<Vec<u8>> {
        let ([source, destination], _) = self.ways(from);
        let mut packet = Vec::new();
        let ip = PacketBuilder::ip(ip(source.ip(), destination.ip())?);
        ip.udp(source.port(), destination.port()).write(&mut packet, bytes)?;
        Ok(packet)
    }
}

/// Returns the headers; their lengths and contents come with the packet.
fn ip(source: IpAddr, destination: IpAddr) -> Result<IpHeaders> {
    const HOPS: u8 = 64;
    Ok(match (source, destination) {
        (IpAddr::V4(source), IpAddr::V4(destination)) => {
            let header = Ipv4Header::new(0, HOPS, IpNumber::TCP, source.octets(), destination.octets())?;
            IpHeaders::Ipv4(header, Default::default())
        }
        (source, destination) => {
            let [source, destination] = [source, destination].map(|place| match place {
                IpAddr::V4(place) => place.to_ipv6_mapped().octets(),
                IpAddr::V6(place) => place.octets(),
            });
            let header = Ipv6Header {
                traffic_class: 0,
                flow_label: Ipv6FlowLabel::ZERO,
                payload_length: 0,
                next_header: IpNumber::TCP,
                hop_limit: HOPS,
                source,
                destination,
            };
            IpHeaders::Ipv6(header, Default::default())
        }
    })
}

/// Returns a section and its one interface, whose packets begin with their IP header.
fn head(about: &str) -> Result<Vec<u8>> {
    const BYTE_ORDER: u32 = 0x1A2B_3C4D;
    const LINK_RAW_IP: u32 = 101;
    const NANOSECONDS: u8 = 9;
    // Options of both blocks, of a section, and of an interface.
    const PROGRAM: u16 = 4;
    const DESCRIPTION: u16 = 3;
    const RESOLUTION: u16 = 9;
    const OFFSET: u16 = 14;
    let mut section: Vec<u8> = [BYTE_ORDER, 1].into_iter().flat_map(u32::to_le_bytes).collect(); // version 1.0
    section.extend([0xFF; 8]); // its length is open
    option(&mut section, PROGRAM, concat!("cellwire ", env!("CARGO_PKG_VERSION")).as_bytes())?;
    option(&mut section, END, &[])?;
    let mut interface: Vec<u8> = [LINK_RAW_IP, 0].into_iter().flat_map(u32::to_le_bytes).collect(); // packets of any length
    option(&mut interface, DESCRIPTION, about.as_bytes())?;
    option(&mut interface, RESOLUTION, &[NANOSECONDS])?;
    option(&mut interface, OFFSET, &[0; 8])?;
    option(&mut interface, END, &[])?;
    Ok([block(0x0A0D_0D0A, &section)?, block(1, &interface)?].concat())
}

/// The option of any block that is shown to people.
const COMMENT: u16 = 1;
/// The end of the options of any block.
const END: u16 = 0;

/// Returns a packet, with a comment if there is one.
fn packet_block(at: SystemTime, packet: &[u8], comment: &str) -> Result<Vec<u8>> {
    let at = nanoseconds(at)?;
    let length = u32::try_from(packet.len())?;
    // The interface, the time, and the lengths as captured and on the line.
    let mut body = Vec::with_capacity(packet.len() + 24);
    body.extend([0, low(at >> 32), low(at), length, length].into_iter().flat_map(u32::to_le_bytes));
    body.extend(packet);
    if !comment.is_empty() {
        body.resize(body.len().next_multiple_of(4), 0);
        option(&mut body, COMMENT, comment.as_bytes())?;
        option(&mut body, END, &[])?;
    }
    block(6, &body)
}

/// Statistics of the interface, of which there is only a comment.
fn statistics_block(at: SystemTime, comment: &str) -> Result<Vec<u8>> {
    let at = nanoseconds(at)?;
    let mut body: Vec<u8> = [0, low(at >> 32), low(at)].into_iter().flat_map(u32::to_le_bytes).collect();
    option(&mut body, COMMENT, comment.as_bytes())?;
    option(&mut body, END, &[])?;
    block(5, &body)
}

/// Returns a time in the form of blocks.
fn nanoseconds(at: SystemTime) -> Result<u64> {
    Ok(u64::try_from(at.duration_since(UNIX_EPOCH).unwrap_or_default().as_nanos())?)
}

/// Appends an option of a block: its code, its length and its value.
fn option(body: &mut Vec<u8>, code: u16, value: &[u8]) -> Result<()> {
    body.extend(code.to_le_bytes());
    body.extend(u16::try_from(value.len())?.to_le_bytes());
    body.extend(value);
    body.resize(body.len().next_multiple_of(4), 0);
    Ok(())
}

/// Returns a block of pcapng: its type, its length, its padded body and its length again.
fn block(kind: u32, body: &[u8]) -> Result<Vec<u8>> {
    let padded = body.len().next_multiple_of(4);
    let length = u32::try_from(padded + 12)?.to_le_bytes();
    let mut block = Vec::with_capacity(padded + 12);
    block.extend(kind.to_le_bytes());
    block.extend(length);
    block.extend(body);
    block.resize(padded + 8, 0);
    block.extend(length);
    Ok(block)
}

/// Returns the lower half of a number.
fn low(number: u64) -> u32 {
    let [.., a, b, c, d] = number.to_be_bytes();
    u32::from_be_bytes([a, b, c, d])
}
