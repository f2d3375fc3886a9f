//! `cellwire decode`: reads bytes, writes one JSON object per line.

mod capture;
pub(super) mod hex;

use std::cell::RefCell;
use std::io::{self, BufRead, BufWriter, Read, Write};
use std::rc::Rc;

use anyhow::{Context, Result, ensure};

use self::hex::HexReader;

use super::codec::CodecArgs;
use super::source::{Format, SourceArgs};
use cellwire_io::output::{EventArgs, OutputFailed, is_for_people, log, remark};
use cellwire_links::codec::{Item, Kind, Stream};

/// The number of bytes that are read and written at once.
const CHUNK: usize = 64 * 1024;

/// Reads bytes, and prints each message as a line: of JSON, at a terminal as text.
///
/// A line is {"offset":…,"length":…,"message":{…}}, or has "error" in place of "message" where the bytes are corrupt; of a
/// capture also "flow", "from" and "time" (UTC). Every byte of the input is in exactly one line. Decoding continues after
/// corrupt bytes; the exit status is 1 if there were any.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    codec: CodecArgs,
    #[command(flatten)]
    source: SourceArgs,
    /// In a capture, check both ends against the link's specification: a line with "shadow" reports that an end broke a rule
    /// ("rule"), was later than the source allows ("budget"), or contradicted a default setting of this project's sessions
    /// ("assumption"), with the clause
    #[arg(long)]
    shadow: bool,
    #[command(flatten)]
    events: EventArgs,
}

/// Returns true when there were no corrupt bytes.
pub fn run(args: &Args) -> Result<bool> {
    args.events.choose();
    let (format, input) = args.source.open()?;
    let reading = args.source.reading(format);
    ensure!(
        !args.shadow || reading.is_some(),
        "--shadow needs both ends: use it with a capture, such as a file of pcap"
    );
    let out = Rc::new(RefCell::new(DecodeOutput {
        out: BufWriter::with_capacity(CHUNK, io::stdout()),
        error: None,
    }));
    let input = Box::new(TiedInput { input, out: Rc::clone(&out) });
    let mut out = Lines { out, clean: true, messages: 0 };
    let decoded = match (format, reading) {
        (_, Some(reading)) => capture::decode(args, &reading, input, &mut out),
        (_, None) => decode_stream(args, format, input, &mut out),
    };
    let printed = decoded.and_then(|()| Ok(out.out.borrow_mut().flush()?));
    if let Some(error) = out.out.borrow_mut().error.take() {
        return Err(error).context(OutputFailed);
    }
    printed?;
    if !out.clean && out.messages == 0 {
        remark(&format!(
            "nothing here is a message of {}: `cellwire identify {}` says what it is",
            args.codec.of.link.short,
            args.source.name()
        ));
    }
    Ok(out.clean)
}

fn decode_stream(args: &Args, format: Format, mut input: Box<dyn Read>, out: &mut Lines) -> Result<()> {
    let side = args.codec.side()?;
    // As the reference reads it: XON and XOFF are bytes like others.
    let mut stream = Stream::new(args.codec.of.codec_of(side)?);
    let mut hex = HexReader::default();
    let mut buffer = vec![0; CHUNK];
    loop {
        let n = input.read(&mut buffer).context("cannot read the input")?;
        if n == 0 {
            break;
        }
        let bytes = buffer.get(..n).unwrap_or_default();
        match format {
            Format::Hex => stream.push(&hex.read(bytes)?, |item| out.write("", item))?,
            _ => stream.push(bytes, |item| out.write("", item))?,
        }
    }
    hex.finish()?;
    stream.finish(|item| out.write("", item))?;
    let others: Vec<_> = args.codec.of.link.sides.iter().filter(|other| **other != side).copied().collect();
    if !out.clean && args.codec.from.is_none() && !others.is_empty() {
        remark(&format!(
            "decoded as sent by the {side}; use --from {} for the other side",
            others.join(" or --from ")
        ));
    }
    Ok(())
}

/// Standard output, and the reason that it does not accept output: an input that is tied to it has the error too.
struct DecodeOutput {
    out: BufWriter<io::Stdout>,
    error: Option<io::Error>,
}

impl DecodeOutput {
    fn note<T>(&mut self, result: io::Result<T>) -> io::Result<T> {
        result.map_err(|error| {
            let kind = error.kind();
            self.error.get_or_insert(error);
            kind.into()
        })
    }
}

impl Write for DecodeOutput {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.out.write(bytes);
        self.note(written)
    }

    /// Writes pieces of a line into the buffer: a line has many small pieces, and the buffer's own function copies each only
    /// once.
    fn write_all(&mut self, bytes: &[u8]) -> io::Result<()> {
        let written = self.out.write_all(bytes);
        self.note(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        let flushed = self.out.flush();
        self.note(flushed)
    }
}

/// Standard output, shared by the lines and by the input that is tied to it.
type Output = Rc<RefCell<DecodeOutput>>;

/// Standard output, and whether every line so far was a message.
struct Lines {
    out: Output,
    clean: bool,
    /// The number of messages so far.
    messages: u64,
}

impl Lines {
    /// Writes a line about the input itself.
    fn fault(&mut self, line: core::fmt::Arguments<'_>) -> Result<()> {
        self.clean = false;
        self.line(line)
    }

    fn line(&mut self, line: core::fmt::Arguments<'_>) -> Result<()> {
        if is_for_people() {
            return log(&serde_json::from_str(&line.to_string())?);
        }
        Ok(self.out.borrow_mut().write_fmt(line)?)
    }

    fn write(&mut self, label: &str, item: Item<'_>) -> Result<()> {
        self.clean &= item.kind == Kind::Message;
        self.messages += u64::from(item.kind == Kind::Message);
        if is_for_people() {
            let mut line = Vec::new();
            item.write_line(label, &mut line)?;
            return log(&serde_json::from_slice(&line)?);
        }
        Ok(item.write_line(label, &mut *self.out.borrow_mut())?)
    }
}

/// The input. Before it may have to wait for bytes, the lines so far are written.
struct TiedInput {
    input: Box<dyn BufRead>,
    out: Output,
}

impl Read for TiedInput {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.out.borrow_mut().flush()?;
        self.input.read(buffer)
    }
}
