//! The connections of a capture, each direction decoded by itself.

use std::io::Read;
use std::time::Duration;

use anyhow::{Result, ensure};
use serde::Serialize;
use serde_json::json;

use super::{Args, Lines};
use crate::io::capture::connections::{self, Directions};
use crate::io::capture::reassembly::Piece;
use crate::io::capture::{Fault, Flow, Summary};
use crate::io::output::remark;
use cellwire_links::codec::{Item, Kind, Stream};

/// Decodes every flow of a capture.
///
/// # Errors
/// When the input is no capture, or holds nothing for the link.
pub(super) fn decode(args: &Args, input: Box<dyn Read + Send>, out: &mut Lines) -> Result<()> {
    let (summary, found) = connections::read(input, args.port, &mut Decoding { args, out })?;
    report(&summary);
    ensure!(
        found || !out.clean,
        "the capture contains no TCP, UDP or serial bytes for {}{}",
        args.codec.of.link.name,
        args.port.map_or_else(String::new, |port| format!(" on port {port}"))
    );
    Ok(())
}

/// What never holds bytes of a link is counted on standard error: it is no fault.
pub(in crate::command) fn report(summary: &Summary) {
    if summary.others.is_empty() {
        return;
    }
    let total: u64 = summary.others.values().sum();
    let others: Vec<String> = summary.others.iter().map(|(what, count)| format!("{count} {what}")).collect();
    let packets = summary.packets;
    remark(&format!("{total} of {packets} packets are neither TCP nor UDP: {}", others.join(", ")));
}

/// Each direction becomes lines.
struct Decoding<'a> {
    args: &'a Args,
    out: &'a mut Lines,
}

struct Decoded {
    stream: Stream,
    side: &'static str,
    /// Its fields before those of a line.
    label: String,
}

impl Directions for Decoding<'_> {
    type Direction = Box<Decoded>;

    fn begin(&mut self, flow: Flow, is_client: bool, connection: u64) -> Result<Option<Box<Decoded>>> {
        begin(self.args, flow, is_client, connection)
    }

    fn take(&mut self, decoded: &mut Box<Decoded>, _: Duration, piece: Piece<'_>) -> Result<()> {
        decoded.take(self.args, piece, self.out)
    }

    fn end(&mut self, decoded: Box<Decoded>) -> Result<()> {
        let Decoded { mut stream, label, .. } = *decoded;
        stream.finish(|item| self.out.write(&label, item))
    }

    /// A line of the capture itself: `{"packet":…,"error":{…}}`.
    fn fault(&mut self, packet: u64, fault: &Fault) -> Result<()> {
        self.out.fault(format_args!("{}\n", json!({"packet": packet, "error": fault})))
    }
}

/// How a direction begins: which side sends, and what its lines are called.
fn begin(args: &Args, flow: Flow, is_client: bool, number: u64) -> Result<Option<Box<Decoded>>> {
    let wanted = args.codec.from.as_deref();
    let (side, mut label) = match flow {
        Flow::Tcp(from, to) | Flow::Udp(from, to) => {
            let server = if is_client { to.port() } else { from.port() };
            // Which of the two polls is not sure enough to leave its bytes out.
            let side = (args.codec.of.link.sender)(is_client, server)
                .map_or_else(|| args.codec.of.link.side(None), Ok)?;
            if wanted.is_some_and(|wanted| wanted != side) {
                return Ok(None);
            }
            (side, format!("\"flow\":{},\"from\":{},", json!(format!("{from} > {to}")), json!(side)))
        }
        Flow::Serial(0) => (args.codec.side()?, String::new()),
        Flow::Serial(interface) => (args.codec.side()?, format!("\"interface\":{interface},")),
    };
    if number > 1 {
        label.push_str(&format!("\"connection\":{number},"));
    }
    let stream = Stream::new(args.codec.of.codec_of(side)?);
    Ok(Some(Box::new(Decoded { stream, side, label })))
}

/// What the capture lacks of a flow.
#[derive(Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
enum Lack {
    /// No packet has these bytes.
    Gap { missing: u64 },
    /// The capture has cut them off.
    CutOff { missing: u64 },
    /// They came after their gap was reported.
    Late { bytes: u64 },
    /// They are before what was captured first.
    BeforeStart { bytes: u64 },
}

impl Decoded {
    fn take(&mut self, args: &Args, piece: Piece<'_>, out: &mut Lines) -> Result<()> {
        let lack = match piece {
            Piece::Bytes(bytes) => return self.stream.push(bytes, |item| out.write(&self.label, item)),
            Piece::Gap(missing) => Lack::Gap { missing },
            Piece::Cut(missing) => Lack::CutOff { missing },
            Piece::Late(bytes) => Lack::Late { bytes },
            Piece::BeforeStart(bytes) => Lack::BeforeStart { bytes },
        };
        let offset = self.stream.offset();
        if let Lack::Gap { .. } | Lack::CutOff { .. } = lack {
            // What is before the gap and what is after it are no frame together.
            let next = Stream::starting_at(args.codec.of.codec_of(self.side)?, offset);
            core::mem::replace(&mut self.stream, next).finish(|item| out.write(&self.label, item))?;
        }
        let mut json = Vec::new();
        cellwire_links::json::write(&lack, &mut json)?;
        out.write(&self.label, Item { offset, length: 0, kind: Kind::Error, json: &json })
    }
}
