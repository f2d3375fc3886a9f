//! The blocks of a capture file, in bounded memory, from files and pipes.

use std::io::{self, Read};
use std::time::Duration;

use anyhow::{Context, Result, bail};
use pcap_parser::pcapng::{Block as NgBlock, parse_block_be, parse_block_le};
use pcap_parser::{
    PcapHeader, parse_pcap_frame, parse_pcap_frame_be, parse_pcap_frame_modified, parse_pcap_header,
};

use super::fault::Fault;
use super::unreadable;

/// The number of bytes that are read at once.
const CHUNK: usize = 1 << 20;
/// No packet is longer; a length above it is corrupt.
const MAX_BLOCK: usize = 16 << 20;
/// Describes the interfaces of one section.
const MAX_INTERFACES: usize = 65_536;

/// Type and length of every block of pcapng.
const SECTION_HEADER: u32 = 0x0A0D_0D0A;
const LITTLE: [u8; 4] = [0x4D, 0x3C, 0x2B, 0x1A];
const BIG: [u8; 4] = [0x1A, 0x2B, 0x3C, 0x4D];

/// The next block of a capture.
#[derive(Debug)]
pub(super) enum Block<'a> {
    /// A packet.
    Frame(Frame<'a>),
    /// The reason for which a packet is missing, or the rest.
    Fault(Fault),
    /// The end of the capture.
    End,
}

/// A packet as it was captured.
#[derive(Debug)]
pub(super) struct Frame<'a> {
    /// `None` when the capture does not describe the interface.
    pub(super) link_type: Option<u32>,
    /// The index of the interface in the section, from 0.
    pub(super) interface: usize,
    /// The section of the capture, from 0.
    pub(super) section: usize,
    pub(super) data: &'a [u8],
    /// The length of the packet on the wire.
    pub(super) original: u32,
    /// The time of capture since 1970; `None` for a simple packet of pcapng, which has no time.
    pub(super) at: Option<Duration>,
    /// The byte order of the file, which is that of usbmon's headers.
    pub(super) is_big: bool,
}

/// Reads block after block.
pub(super) struct Blocks {
    input: Box<dyn Read>,
    buffer: Vec<u8>,
    begin: usize,
    end: usize,
    /// The bytes of the capture before `begin`.
    passed: u64,
    is_over: bool,
    form: Form,
}

enum Form {
    Pcap { header: PcapHeader, link_type: u32 },
    PcapNg { is_big: bool, section: usize, interfaces: Vec<Interface> },
}

/// The description of an interface in a section.
struct Interface {
    link_type: u32,
    /// The maximum number of bytes that are captured of a packet; 0: all of it.
    limit: u32,
    /// The parts of a second in which its times are.
    resolution: u64,
    /// Seconds to be added to its times.
    offset: i64,
}

/// A block that was found at the beginning of the buffer.
enum Parsed<'a> {
    Frame(Frame<'a>),
    /// A block without a packet.
    Skip,
    Corrupt(String),
}

impl Blocks {
    pub(super) fn new(input: Box<dyn Read>) -> Result<Self> {
        let form = Form::PcapNg { is_big: false, section: 0, interfaces: Vec::new() };
        let (buffer, begin, end) = (vec![0; CHUNK], 0, 0);
        let mut blocks = Self { input, buffer, begin, end, passed: 0, is_over: false, form };
        const NONE: &str = "the input is not a capture: neither pcap nor pcapng";
        while blocks.data().len() < 24 && blocks.fill(24)? {}
        let data = blocks.data();
        if data.first_chunk().is_some_and(|magic| u32::from_le_bytes(*magic) == SECTION_HEADER) {
            return Ok(blocks);
        }
        let Ok((_, header)) = parse_pcap_header(data) else {
            bail!(unreadable(data).unwrap_or_else(|| NONE.into()));
        };
        let length = header.size();
        // The upper bits give the length of the checksum after each packet, which belongs to none of the headers.
        let link_type = header.network.0.cast_unsigned() & 0x0FFF_FFFF & 0xFFFF;
        blocks.form = Form::Pcap { header, link_type };
        blocks.skip(length);
        Ok(blocks)
    }

    pub(super) fn next(&mut self) -> Result<Block<'_>> {
        loop {
            if self.is_over {
                return Ok(Block::End);
            }
            let wanted = match self.form.length(self.data()) {
                Ok(Some(length)) if length <= self.data().len() => {
                    let at = self.passed;
                    let (begin, stop) = (self.begin, self.begin + length);
                    self.skip(length);
                    let block = self.buffer.get(begin..stop).unwrap_or_default();
                    // Only the borrow checker needs the second look at a block without a packet.
                    match self.form.parse(block) {
                        Parsed::Skip => continue,
                        Parsed::Frame(_) => {}
                        Parsed::Corrupt(why) => {
                            self.is_over = true;
                            return Ok(Block::Fault(Fault::Corrupt { at, why }));
                        }
                    }
                    let block = self.buffer.get(begin..stop).unwrap_or_default();
                    return Ok(match self.form.parse(block) {
                        Parsed::Frame(frame) => Block::Frame(frame),
                        Parsed::Skip | Parsed::Corrupt(_) => Block::End,
                    });
                }
                Ok(length) => length.unwrap_or(16),
                Err(why) => {
                    self.is_over = true;
                    return Ok(Block::Fault(Fault::Corrupt { at: self.passed, why }));
                }
            };
            if !self.fill(wanted)? {
                self.is_over = true;
                let length = self.data().len();
                return Ok(if length == 0 { Block::End } else { Block::Fault(Fault::Truncated { length }) });
            }
        }
    }

    fn data(&self) -> &[u8] {
        self.buffer.get(self.begin..self.end).unwrap_or_default()
    }

    fn skip(&mut self, length: usize) {
        self.begin += length;
        self.passed += length as u64;
    }

    /// Reads more, into a buffer that holds a block of this length; false at the end of the input.
    fn fill(&mut self, wanted: usize) -> Result<bool> {
        if self.begin > 0
            && (self.begin == self.end || self.buffer.len() - self.begin < wanted.max(CHUNK / 8))
        {
            self.buffer.copy_within(self.begin..self.end, 0);
            (self.begin, self.end) = (0, self.end - self.begin);
        }
        if self.buffer.len() - self.begin < wanted {
            self.buffer.resize(self.begin + wanted, 0);
        }
        if self.end == self.buffer.len() {
            self.buffer.resize(self.end + CHUNK, 0);
        }
        loop {
            match self.input.read(self.buffer.get_mut(self.end..).unwrap_or_default()) {
                Ok(0) => return Ok(false),
                Ok(n) => {
                    self.end += n;
                    return Ok(true);
                }
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(error).context("cannot read the capture"),
            }
        }
    }
}

impl Form {
    /// Returns the length of the block that begins here; `None` if more bytes are needed.
    fn length(&self, data: &[u8]) -> Result<Option<usize>, String> {
        let word = |at: usize, is_big: bool| -> Option<u32> {
            let bytes = *data.get(at..)?.first_chunk::<4>()?;
            Some(if is_big { u32::from_be_bytes(bytes) } else { u32::from_le_bytes(bytes) })
        };
        let (length, least) = match self {
            Self::Pcap { header, .. } => {
                let head = if header.is_modified_format() { 24 } else { 16 };
                let Some(captured) = word(8, header.is_bigendian()) else { return Ok(None) };
                ((captured as usize).saturating_add(head), head)
            }
            Self::PcapNg { is_big, .. } => {
                let is_big = match data.get(8..12) {
                    _ if word(0, false) != Some(SECTION_HEADER) => *is_big,
                    Some(order) if order == LITTLE => false,
                    Some(order) if order == BIG => true,
                    Some(_) => return Err("a section without a byte order".into()),
                    None => return Ok(None),
                };
                let Some(length) = word(4, is_big) else { return Ok(None) };
                if !length.is_multiple_of(4) {
                    return Err(format!("a block of {length} bytes, not a multiple of 4"));
                }
                let least = match word(0, is_big) {
                    Some(SECTION_HEADER) => 28,
                    Some(1) => 20,
                    Some(6) => 32,
                    Some(3) => 16,
                    _ => 12,
                };
                (length as usize, least)
            }
        };
        match length {
            _ if length > MAX_BLOCK => Err(format!("a block of {length} bytes")),
            _ if length < least => Err(format!("a block of {length} bytes, which is too short for its kind")),
            _ => Ok(Some(length)),
        }
    }

    fn parse<'a>(&mut self, block: &'a [u8]) -> Parsed<'a> {
        let corrupt = || Parsed::Corrupt("a block that cannot be read".into());
        match self {
            Self::Pcap { header, link_type } => {
                let parsed = match (header.is_modified_format(), header.is_bigendian()) {
                    (true, _) => parse_pcap_frame_modified(block),
                    (false, true) => parse_pcap_frame_be(block),
                    (false, false) => parse_pcap_frame(block),
                };
                let Ok((_, packet)) = parsed else { return corrupt() };
                let (data, original, is_big) = (packet.data, packet.origlen, header.is_bigendian());
                let parts = if header.is_nanosecond_precision() { 1 } else { 1000 };
                let nanoseconds = packet.ts_usec.saturating_mul(parts);
                let at = Some(Duration::new(packet.ts_sec.into(), nanoseconds));
                let link_type = Some(*link_type);
                Parsed::Frame(Frame { link_type, interface: 0, section: 0, data, original, at, is_big })
            }
            Self::PcapNg { is_big, section, interfaces } => {
                let parsed = if *is_big { parse_block_be(block) } else { parse_block_le(block) };
                let Ok((_, parsed)) = parsed else { return corrupt() };
                let section = match parsed {
                    NgBlock::SectionHeader(header) => {
                        // The interfaces of a section are its own.
                        *is_big = header.big_endian();
                        *section += 1;
                        interfaces.clear();
                        return Parsed::Skip;
                    }
                    NgBlock::InterfaceDescription(interface) => {
                        if interfaces.len() >= MAX_INTERFACES {
                            return Parsed::Corrupt(format!("more than {MAX_INTERFACES} interfaces"));
                        }
                        interfaces.push(Interface {
                            link_type: interface.linktype.0.cast_unsigned(),
                            limit: interface.snaplen,
                            resolution: interface.ts_resolution().unwrap_or(1_000_000),
                            offset: interface.if_tsoffset,
                        });
                        return Parsed::Skip;
                    }
                    _ => *section,
                };
                let (interface, data, original, ticks) = match parsed {
                    NgBlock::EnhancedPacket(packet) => {
                        let length = (packet.caplen as usize).min(packet.data.len());
                        let data = packet.data.get(..length).unwrap_or_default(); // without the padding
                        let ticks = u64::from(packet.ts_high) << 32 | u64::from(packet.ts_low);
                        (packet.if_id as usize, data, packet.origlen, Some(ticks))
                    }
                    NgBlock::SimplePacket(packet) => {
                        // The block does not state the captured length: it is the lesser of the packet's length and the
                        // interface's limit.
                        let limit = match interfaces.first() {
                            Some(Interface { limit: limit @ 1.., .. }) => *limit,
                            _ => u32::MAX,
                        };
                        let length = (packet.origlen.min(limit) as usize).min(packet.data.len());
                        (0, packet.data.get(..length).unwrap_or_default(), packet.origlen, None)
                    }
                    // The packet block of the first drafts: 2 bytes of interface, 2 of drops, times, lengths.
                    NgBlock::Unknown(unknown) if unknown.block_type == 2 => {
                        match obsolete(unknown.data, *is_big) {
                            Some(packet) => packet,
                            None => return corrupt(),
                        }
                    }
                    _ => return Parsed::Skip,
                };
                let about = interfaces.get(interface);
                let link_type = about.map(|about| about.link_type);
                let at = about.zip(ticks).and_then(|(about, ticks)| about.time(ticks));
                Parsed::Frame(Frame { link_type, interface, section, data, original, at, is_big: *is_big })
            }
        }
    }
}

impl Interface {
    fn time(&self, ticks: u64) -> Option<Duration> {
        let seconds = ticks.checked_div(self.resolution)?;
        let parts = u128::from(ticks.checked_rem(self.resolution)?) * 1_000_000_000;
        let nanoseconds = u32::try_from(parts.checked_div(self.resolution.into())?).ok()?;
        Some(Duration::new(seconds.checked_add_signed(self.offset)?, nanoseconds))
    }
}

fn obsolete(data: &[u8], is_big: bool) -> Option<(usize, &[u8], u32, Option<u64>)> {
    let word = |at: usize| -> Option<u32> {
        let bytes = *data.get(at..)?.first_chunk::<4>()?;
        Some(if is_big { u32::from_be_bytes(bytes) } else { u32::from_le_bytes(bytes) })
    };
    let interface = *data.first_chunk::<2>()?;
    let interface = if is_big { u16::from_be_bytes(interface) } else { u16::from_le_bytes(interface) };
    let ticks = u64::from(word(4)?) << 32 | u64::from(word(8)?);
    let (captured, original) = (word(12)? as usize, word(16)?);
    Some((interface.into(), data.get(20..)?.get(..captured)?, original, Some(ticks)))
}
