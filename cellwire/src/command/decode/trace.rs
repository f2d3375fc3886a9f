//! The tool's own traces: the bytes of both directions, with their times.

use std::io::{BufRead, BufReader, Read};

use anyhow::{Context, Result, bail};
use serde_json::json;

use super::{Args, Lines};
use cellwire_io::output::remark;
use cellwire_io::trace::{Way, parse_line, parse_name};
use cellwire_links::codec::Stream;

/// No line of a trace is longer.
const MAX_LINE: u64 = 4096;

/// Decodes what both ends sent.
///
/// # Errors
/// When the input is no trace, with the number of the line.
pub(super) fn decode(args: &Args, input: Box<dyn Read>, out: &mut Lines) -> Result<()> {
    let mut lines = TraceLines::new(BufReader::new(input));
    let why = "line 1: not a trace; a trace begins with `# NAME: why the session ended`";
    let [sent, received] = sides(args, lines.next()?.and_then(parse_name).context(why)?)?;
    let (mut sent, mut received) = (Direction::new(args, sent)?, Direction::new(args, received)?);
    while let Some(text) = lines.next()? {
        if text.trim().is_empty() {
            continue;
        }
        let Some((at, way, bytes)) = parse_line(text) else {
            let text = text.trim().escape_debug().to_string();
            bail!("line {}: not a line of a trace: {text}", lines.number);
        };
        match way {
            Way::Sent => sent.push(at, &bytes, out)?,
            Way::Received => received.push(at, &bytes, out)?,
        }
    }
    sent.finish(out)?;
    received.finish(out)
}

/// Which sides sent what the trace has as sent and as received: by `--from`, the end that kept it, or by the trace's name.
fn sides(args: &Args, name: &str) -> Result<[Option<&'static str>; 2]> {
    let link = args.codec.of.link;
    if args.codec.from.is_none() {
        let trace = link.traces.iter().find(|(known, _)| *known == name);
        return trace.map(|(_, sides)| *sides).with_context(|| {
            let sides = link.sides.join(" or ");
            format!(
                "`{name}` is not an end of {}: give the end that wrote the trace, --from {sides}",
                link.short
            )
        });
    }
    let keeper = args.codec.side()?;
    Ok([Some(keeper), link.sides.iter().find(|side| **side != keeper).copied()])
}

/// The lines of a trace.
pub(in crate::command) struct TraceLines {
    input: BufReader<Box<dyn Read>>,
    text: String,
    number: u64,
}

impl TraceLines {
    pub(in crate::command) fn new(input: BufReader<Box<dyn Read>>) -> Self {
        Self { input, text: String::new(), number: 0 }
    }

    /// The number of the last line.
    pub(in crate::command) fn number(&self) -> u64 {
        self.number
    }

    pub(in crate::command) fn next(&mut self) -> Result<Option<&str>> {
        self.text.clear();
        self.number += 1;
        let read = self.input.by_ref().take(MAX_LINE).read_line(&mut self.text);
        let read = read.with_context(|| format!("line {}: cannot read the trace", self.number))?;
        Ok((read > 0).then_some(&self.text))
    }
}

/// What one end sent.
struct Direction {
    /// `None` where that end sends no messages.
    stream: Option<(&'static str, Stream)>,
    label: String,
    skipped: u64,
}

impl Direction {
    fn new(args: &Args, side: Option<&'static str>) -> Result<Self> {
        let stream = match side {
            Some(side) => Some((side, args.codec.of.stream_of(side, 0)?)),
            None => None,
        };
        Ok(Self { stream, label: String::new(), skipped: 0 })
    }

    fn push(&mut self, at: f64, bytes: &[u8], out: &mut Lines) -> Result<()> {
        match &mut self.stream {
            None => {
                self.skipped += bytes.len() as u64;
                Ok(())
            }
            Some((side, stream)) => {
                self.label = format!("\"from\":{},\"at\":{},", json!(side), json!(at));
                stream.push(bytes, |item| out.write(&self.label, item))
            }
        }
    }

    fn finish(self, out: &mut Lines) -> Result<()> {
        if self.skipped > 0 {
            remark(&format!("skipped {} bytes of the end that sends no messages", self.skipped));
        }
        match self.stream {
            Some((_, mut stream)) => stream.finish(|item| out.write(&self.label, item)),
            None => Ok(()),
        }
    }
}
