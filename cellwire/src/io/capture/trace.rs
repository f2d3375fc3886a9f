//! The traces of this project's programs: the last bytes of both directions of one end, with their times.

use std::io::{BufRead, BufReader, Read};
use std::time::Duration;

use anyhow::{Context, Result, bail};

use super::{CaptureItem, Flow, Line, Packet, Summary};
use cellwire_io::trace::{TraceDirection, parse_line, parse_name};

/// The longest line of a trace.
const MAX_LINE: u64 = 4096;

pub(super) fn read(
    mut input: BufReader<Box<dyn Read>>,
    mut take: impl FnMut(CaptureItem<'_>) -> Result<()>,
) -> Result<Summary> {
    let (mut packets, mut kept, mut line) = (0, None, Vec::new());
    for number in 1.. {
        line.clear();
        let length = input.by_ref().take(MAX_LINE).read_until(b'\n', &mut line);
        let length = length.with_context(|| format!("line {number}: cannot read the trace"))?;
        let text = String::from_utf8_lossy(&line);
        let Some(end) = kept else {
            let name = parse_name(&text)
                .context("line 1: not a trace; a trace begins with `# NAME: why the session ended`")?;
            // Lines are copied; an input has one name.
            kept = Some(Line::Trace(name.to_owned().leak()));
            continue;
        };
        if length == 0 {
            break;
        }
        if text.trim().is_empty() {
            continue;
        }
        let Some((at, way, bytes)) = parse_line(&text) else {
            bail!("line {number}: not a line of a trace: {}", text.trim().escape_debug());
        };
        packets += 1;
        let (at, flow) = (Duration::try_from_secs_f64(at).ok(), Flow::Kept(end, way == TraceDirection::Sent));
        take(CaptureItem::Packet(Packet { number, at, flow, segment: None, payload: &bytes, missing: 0 }))?;
    }
    Ok(Summary { packets, ..Summary::default() })
}
