//! `cellwire decode`: reads bytes, writes one JSON object per line.

use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};
use std::io::{self, BufRead, BufWriter, Read, Write};
use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use anyhow::{Context, Result};
use clap::ValueEnum;
use serde_json::json;

use super::codec::CodecArgs;
use crate::io::capture::{self, Flow, Piece, Reassembly};
use crate::io::input;
use crate::links::codec::{Item, Kind, Stream};

/// So much is read and written at once.
const CHUNK: usize = 64 * 1024;

/// Reads bytes and writes one JSON object per line.
///
/// A line is {"offset":…,"length":…,"message":{…}}, or has "error" in place of "message" where the bytes are corrupt. Every
/// byte of the input is in exactly one line. Decoding continues after corrupt bytes; the exit status is 1 if there were any.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    codec: CodecArgs,
    /// The format of the input
    #[arg(long, value_enum, default_value_t = Format::Hex)]
    format: Format,
    /// The input [default: standard input]
    file: Option<PathBuf>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Format {
    /// Hex digits; blanks and line ends anywhere, `#` begins a comment
    Hex,
    /// The bytes themselves
    Raw,
    /// A pcap or pcapng file: each direction of each connection is decoded separately, and its lines have "flow" and "from"
    Pcap,
}

/// Returns true when there were no corrupt bytes.
pub fn run(args: &Args) -> Result<bool> {
    let input = input::open(args.file.as_deref())?;
    let out = Arc::new(Mutex::new(BufWriter::with_capacity(CHUNK, io::stdout())));
    let input = Box::new(Tied { input, out: Arc::clone(&out) });
    let mut out = Lines { out, clean: true };
    match args.format {
        Format::Hex | Format::Raw => decode_stream(args, input, &mut out)?,
        Format::Pcap => decode_capture(args, input, &mut out)?,
    }
    lock(&out.out).flush()?;
    Ok(out.clean)
}

fn decode_stream(args: &Args, mut input: Box<dyn Read + Send>, out: &mut Lines) -> Result<()> {
    let mut stream = Stream::new(args.codec.codec()?);
    let mut hex = HexReader::default();
    let mut buffer = vec![0; CHUNK];
    loop {
        let n = input.read(&mut buffer).context("cannot read the input")?;
        if n == 0 {
            break;
        }
        let bytes = buffer.get(..n).unwrap_or_default();
        match args.format {
            Format::Hex => stream.push(&hex.read(bytes)?, |item| out.write("", item))?,
            Format::Raw | Format::Pcap => stream.push(bytes, |item| out.write("", item))?,
        }
    }
    hex.finish()?;
    stream.finish(|item| out.write("", item))
}

/// Each direction of each connection is a separate stream, and its lines name it.
fn decode_capture(args: &Args, input: Box<dyn Read + Send>, out: &mut Lines) -> Result<()> {
    let link = args.codec.link;
    let mut directions: BTreeMap<Flow, Direction> = BTreeMap::new();
    let mut clients: BTreeSet<SocketAddr> = BTreeSet::new();
    capture::read(input, |packet| {
        if let (Flow::Tcp(from, _), true) = (packet.flow, packet.opens) {
            clients.insert(from);
        }
        let direction = match directions.entry(packet.flow) {
            Entry::Occupied(known) => known.into_mut(),
            Entry::Vacant(_) if packet.payload.is_empty() && !packet.opens => return Ok(()),
            Entry::Vacant(new) => {
                let Some(direction) = Direction::new(args, packet.flow, &clients)? else { return Ok(()) };
                new.insert(direction)
            }
        };
        let pieces = match packet.flow {
            Flow::Tcp(..) => direction.tcp.push(packet.sequence, packet.payload),
            Flow::Udp(..) | Flow::Serial => vec![Piece::Bytes(packet.payload)],
        };
        direction.take(pieces, out)
    })?;
    anyhow::ensure!(
        !directions.is_empty(),
        "the capture contains no TCP, UDP or serial bytes for {}",
        link.name()
    );
    for (_, mut direction) in directions {
        let rest = core::mem::take(&mut direction.tcp).finish();
        direction.take(rest, out)?;
        let Direction { stream, label, .. } = direction;
        stream.finish(|item| out.write(&label, item))?;
    }
    Ok(())
}

/// One direction of a capture.
struct Direction {
    stream: Stream,
    tcp: Reassembly,
    /// Its fields before those of a line.
    label: String,
}

impl Direction {
    /// `None` when the direction is not that of the requested side.
    fn new(args: &Args, flow: Flow, clients: &BTreeSet<SocketAddr>) -> Result<Option<Self>> {
        let (mut found, mut label) = (None, String::new());
        if let Flow::Tcp(from, to) | Flow::Udp(from, to) = flow {
            // If the capture lacks the beginning of the connection, the lower port counts as the server's.
            let is_client = match (clients.contains(&from), clients.contains(&to)) {
                (true, false) => true,
                (false, true) => false,
                _ => from.port() > to.port(),
            };
            let side = args.codec.link.sender(is_client, if is_client { to.port() } else { from.port() });
            if args.codec.from.as_deref().is_some_and(|requested| requested != side) {
                return Ok(None);
            }
            found = Some(side);
            label = format!("\"flow\":{},\"from\":{},", json!(format!("{from} > {to}")), json!(side));
        }
        let stream = Stream::new(match found {
            Some(side) => args.codec.codec_of(side)?,
            None => args.codec.codec()?,
        });
        Ok(Some(Self { stream, tcp: Reassembly::default(), label }))
    }

    fn take(&mut self, pieces: Vec<Piece>, out: &mut Lines) -> Result<()> {
        for piece in pieces {
            match piece {
                Piece::Bytes(bytes) => self.stream.push(&bytes, |item| out.write(&self.label, item))?,
                Piece::Gap(bytes) => {
                    let json = json!({"kind": "gap", "missing": bytes}).to_string();
                    let offset = self.stream.offset();
                    out.write(
                        &self.label,
                        Item { offset, length: 0, kind: Kind::Error, json: json.as_bytes() },
                    )?;
                }
            }
        }
        Ok(())
    }
}

type Output = Arc<Mutex<BufWriter<io::Stdout>>>;

fn lock(out: &Output) -> MutexGuard<'_, BufWriter<io::Stdout>> {
    out.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Standard output, and whether every line so far was a message.
struct Lines {
    out: Output,
    clean: bool,
}

impl Lines {
    fn write(&mut self, label: &str, item: Item<'_>) -> Result<()> {
        self.clean &= item.kind == Kind::Message;
        Ok(item.write_line(label, &mut *lock(&self.out))?)
    }
}

/// The input. Before it may have to wait for bytes, the lines so far are written.
struct Tied {
    input: Box<dyn BufRead + Send>,
    out: Output,
}

impl Read for Tied {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        lock(&self.out).flush()?;
        self.input.read(buffer)
    }
}

/// Reads hex that may be cut anywhere.
struct HexReader {
    high: Option<u8>,
    comment: bool,
    line: usize,
}

impl Default for HexReader {
    fn default() -> Self {
        Self { high: None, comment: false, line: 1 }
    }
}

impl HexReader {
    fn read(&mut self, text: &[u8]) -> Result<Vec<u8>> {
        let mut bytes = Vec::with_capacity(text.len() / 2);
        for &c in text {
            match c {
                b'\n' => {
                    self.line += 1;
                    self.comment = false;
                }
                _ if self.comment => {}
                b'#' => self.comment = true,
                b' ' | b'\t' | b'\r' => {}
                _ => {
                    let digit =
                        char::from(c).to_digit(16).and_then(|d| u8::try_from(d).ok()).with_context(|| {
                            format!(
                                "line {}: `{}` is not a hex digit; use --format raw for the bytes themselves",
                                self.line,
                                char::from(c).escape_default()
                            )
                        })?;
                    match self.high.take() {
                        None => self.high = Some(digit),
                        Some(high) => bytes.push(high << 4 | digit),
                    }
                }
            }
        }
        Ok(bytes)
    }

    fn finish(&self) -> Result<()> {
        anyhow::ensure!(
            self.high.is_none(),
            "the input ends in the middle of a byte: an odd number of hex digits"
        );
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hex_may_be_cut_anywhere() {
        let text = b"3C 54\n# a comment 00\n 6 9";
        for cut in 0..text.len() {
            let mut hex = HexReader::default();
            let mut bytes = hex.read(&text[..cut]).unwrap();
            bytes.extend(hex.read(&text[cut..]).unwrap());
            hex.finish().unwrap();
            assert_eq!(bytes, [0x3C, 0x54, 0x69]);
        }
    }

    #[test]
    fn an_error_names_the_character_and_its_line() {
        let error = HexReader::default().read(b"00\n0G").unwrap_err();
        assert_eq!(
            error.to_string(),
            "line 2: `G` is not a hex digit; use --format raw for the bytes themselves"
        );
        let mut hex = HexReader::default();
        hex.read(b"00 1").unwrap();
        assert!(hex.finish().is_err());
    }
}
