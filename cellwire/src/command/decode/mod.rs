//! `cellwire decode`: reads bytes, writes one JSON object per line.

mod capture;
pub(super) mod hex;
mod trace;

use std::io::{self, BufRead, BufWriter, Read, Write};
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use anyhow::{Context, Result, ensure};
use clap::ValueEnum;

use self::hex::HexReader;

pub(super) use self::capture::report;
pub(super) use self::trace::TraceLines;
use super::codec::CodecArgs;
use crate::io::input;
use cellwire_links::codec::{Item, Kind, Stream};

/// So much is read and written at once.
const CHUNK: usize = 64 * 1024;

/// Reads bytes and writes one JSON object per line.
///
/// A line is {"offset":…,"length":…,"message":{…}}, or has "error" in place of "message" where the bytes are corrupt. Every
/// byte of the input is in exactly one line. Decoding continues after corrupt bytes; the exit status is 1 if there were any, or if
/// --shadow has found that an end breaks a rule.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    codec: CodecArgs,
    /// The format of the input
    #[arg(long, value_enum, default_value_t = Format::Hex)]
    format: Format,
    /// In a capture, read only what is sent from or to this TCP or UDP port
    #[arg(long, value_name = "N")]
    port: Option<u16>,
    /// In a capture, hold what both ends say against the link's specification: a line with "shadow" says that an end breaks a rule
    /// ("rule"), was later than the source allows ("budget"), or that a session of ours with its default settings would have assumed
    /// something wrong ("assumption"), and by which clause
    #[arg(long)]
    shadow: bool,
    /// The input; - is standard input [default: -]
    file: Option<PathBuf>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Format {
    /// Hex digits; blanks and line ends anywhere, `#` begins a comment
    Hex,
    /// The bytes themselves
    Raw,
    /// A pcap or pcapng file: each direction of each connection is decoded separately, and its lines have "flow" and "from".
    /// What the capture lacks is a line with "error": a gap, a packet that was cut off, fragments without the rest
    Pcap,
    /// A file that --trace has written: lines have "from" and "at", the seconds of the trace; --from is the end that wrote it
    Trace,
}

/// Returns true when there were no corrupt bytes.
pub fn run(args: &Args) -> Result<bool> {
    ensure!(
        !args.shadow || args.format == Format::Pcap,
        "--shadow needs both ends: use it with --format pcap"
    );
    let input = input::open(args.file.as_deref())?;
    let out = Arc::new(Mutex::new(BufWriter::with_capacity(CHUNK, io::stdout())));
    let input = Box::new(Tied { input, out: Arc::clone(&out) });
    let mut out = Lines { out, clean: true };
    match args.format {
        Format::Hex | Format::Raw => decode_stream(args, input, &mut out)?,
        Format::Pcap => capture::decode(args, input, &mut out)?,
        Format::Trace => trace::decode(args, input, &mut out)?,
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
            _ => stream.push(bytes, |item| out.write("", item))?,
        }
    }
    hex.finish()?;
    stream.finish(|item| out.write("", item))
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
    /// A line of the input itself.
    fn fault(&mut self, line: core::fmt::Arguments<'_>) -> Result<()> {
        self.clean = false;
        self.line(line)
    }

    fn line(&mut self, line: core::fmt::Arguments<'_>) -> Result<()> {
        Ok(lock(&self.out).write_fmt(line)?)
    }

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
